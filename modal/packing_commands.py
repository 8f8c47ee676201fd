"""The commands that make samples: pack (frictionless chains) and relax (balance of the law)."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from modal.equilibrium import TOLERANCE, Balance, relax
from modal.network import write_network
from modal.provenance import Provenance, packing_of
from modal.random_packing import ASPECT, WALK, check_stress, cloud, walk
from modal.sample import read_sample, write_sample
from modal.statistics import summary
from modal.storage import InputError


def add_pack(commands: Any) -> None:
    """The options of `pack`."""
    text = "pack frictionless spheres from a cloud over 200 MPa to each stress"
    pack = commands.add_parser("pack", help=text, description=text)
    pack.add_argument("--spheres", type=int, default=35201, metavar="N")
    pack.add_argument("--aspect", type=float, default=ASPECT, metavar="A", help="length over width")
    pack.add_argument("--seed", type=int, default=1, metavar="S")
    pack.add_argument("--stress", type=float, nargs="+", default=list(WALK), metavar="PA")
    pack.add_argument(
        "--tolerance", type=float, default=1e-3, help="mean net force over contact force; 1e-3"
    )
    pack.add_argument("--json", action="store_true", help="print one JSON object")
    pack.add_argument("-o", "--output", required=True, metavar="DIR", help="goes on where it was")


def add_relax(commands: Any) -> None:
    """The options of `relax`."""
    text = "bring a sample to the balance of its contact law"
    balance = commands.add_parser("relax", help=text, description=text)
    balance.add_argument("sample", help="*.sample.h5")
    balance.add_argument("--friction", type=float, metavar="MU", help="of the wave; as it is")
    balance.add_argument("--tolerance", type=float, default=TOLERANCE, help="relative; 1e-10")
    balance.add_argument("--network", metavar="FILE", help="write the contact network as well")
    balance.add_argument("--json", action="store_true", help="print one JSON object")
    balance.add_argument("-o", "--output", required=True, metavar="FILE", help="*.sample.h5")


def pack(options: argparse.Namespace) -> dict[str, Any]:
    """Run or continue a frictionless chain; names of the files that hold its states."""
    for stress in options.stress:
        check_stress(stress)
    if not 0 < options.tolerance < 1:
        raise InputError(f"--tolerance {options.tolerance:g}: outside 0 to 1; 1e-3 is usual")
    start = cloud(options.spheres, options.aspect, options.seed)
    start = replace(
        start,
        study={"spheres": options.spheres, "aspect": options.aspect, "seed": options.seed},
        provenance={"command": "python -m modal pack", "seed": options.seed},
    )
    files = walk(Path(options.output), start, options.stress, options.tolerance, _say)
    return {"samples": {str(path): stress for stress, path in files}}


def relax_sample(options: argparse.Namespace) -> dict[str, Any]:
    """Bring one sample to rest; its residuals before and after, and its reserve of friction."""
    sample = read_sample(options.sample)
    if options.friction is not None:
        sample = replace(sample, friction=options.friction)
    if not options.tolerance > 0:
        raise InputError(
            f"--tolerance {options.tolerance:g}: must be positive; {TOLERANCE:g} is usual"
        )
    history: list[Balance] = []

    def watch(state: Balance) -> None:
        history.append(replace(state))
        if state.steps % 1000:
            return
        _say(
            f"step {state.steps}: residual {state.residual:.1e}, {state.contacts} contacts, "
            f"{state.sliding} sliding"
        )

    rested, state = relax(sample, tolerance=options.tolerance, watch=watch)
    if not state.at_rest:
        _say(
            f"tolerance not reached: residual {state.residual:.1e}, of a single sphere "
            f"{state.largest:.1e}, after {state.steps} steps, {state.tolerance:g} was asked for"
        )
    elif state.residual > state.tolerance:
        _say(
            f"residual {state.residual:.1e}: round-off of the positions allows no less than "
            f"{state.attainable:.1e}, {state.tolerance:g} was asked for"
        )
    network = rested.network()
    measured = summary(network, rested.friction)
    found = {"residual": state.residual, "unbalanced": state.residual, "mu_wave": rested.friction}
    found |= {name: getattr(state, name) for name in ("tolerance", "attainable", "at_rest")}
    found |= zip(("stress_xx", "stress_yy", "stress_zz"), measured["stress_pa"], strict=True)
    rested = replace(
        rested,
        study=sample.study | measured | found,
        provenance=_with_parent(options.made, sample.provenance),
    )
    write_sample(options.output, rested)
    if options.network:
        network.study |= rested.study
        (parent,) = packing_of(options.output)
        made = replace(options.made, sources=(parent,))
        network.provenance = made.attributes() | {
            "parent": parent.name,
            "parent_sha256": parent.sha256,
        }
        write_network(options.network, network)
    return {"residual_before": history[0].residual} | asdict(state) | measured


def _with_parent(made: Provenance, parent: dict[str, Any]) -> dict[str, Any]:
    """The attributes of a moved sample: its state is seldom kept, so what that said stays."""
    (state,) = made.sources
    kept = {f"parent_{k}": value for k, value in parent.items() if not k.startswith("parent")}
    return made.attributes() | kept | {"parent": state.name, "parent_sha256": state.sha256}


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
