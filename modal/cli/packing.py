"""The commands that make samples: pack (chains from a cloud) and relax (balance of the law)."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from modal.formats.hdf5 import InputError
from modal.formats.provenance import Provenance, packing_of
from modal.packing.network import write_network
from modal.packing.sample import read_sample, write_sample
from modal.packing.state import summary
from modal.preparation import compress
from modal.preparation.protocol import NOMINAL_FRACTION, STRESSES, Study
from modal.preparation.random_packing import ASPECT, WALK, check_stress, cloud, walk
from modal.preparation.relax import TOLERANCE, Balance, relax

WITH_FRICTION = {
    "approach_rate": "strain rate of the agitated spheres, 1/s",
    "agitated_damping": "their local damping",
    "inertial_number": "of the servo's largest strain rate",
    "fraction": "time step over its limit",
}
"""Numbers of the protocol that a study may change."""


def add_pack(commands: Any) -> None:
    """The options of `pack`."""
    text = "pack spheres from a cloud to each stress: without friction over 200 MPa, or with it"
    pack = commands.add_parser("pack", help=text, description=text)
    pack.add_argument("--spheres", type=int, default=35201, metavar="N")
    pack.add_argument("--aspect", type=float, default=ASPECT, metavar="A", help="length over width")
    pack.add_argument("--seed", type=int, default=1, metavar="S")
    pack.add_argument("--stress", type=float, nargs="+", metavar="PA")
    pack.add_argument("--friction", type=float, default=0.0, metavar="MU", help="0 to 1; 0")
    pack.add_argument("--tolerance", type=float, help="mean net force over contact force; 1e-3")
    with_friction = pack.add_argument_group("with friction alone")
    study = Study()
    with_friction.add_argument("--width", type=float, metavar="D", help="diameters, for --aspect")
    for name, text in WITH_FRICTION.items():
        default = getattr(study, name)
        with_friction.add_argument(_typed(name), type=float, help=f"{text}; {default:g}")
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
    """Run or continue a chain; names of the files that hold its states."""
    for stress in options.stress or ():
        check_stress(stress)
    unused = ("tolerance",) if options.friction != 0 else ("width", *WITH_FRICTION)
    for name in unused:
        if getattr(options, name) is not None:
            kind = "with" if options.friction != 0 else "without"
            raise InputError(f"{_typed(name)}: has no meaning {kind} friction; leave it out")
    if options.friction != 0:
        study = _study_of(options)
        folder, stresses = Path(options.output), options.stress or STRESSES
        files = compress.walk(folder, study, stresses, "python -m modal pack", _say)
        settled = {str(path): bool(read_sample(path).study["settled"]) for _, path in files}
        return {"samples": {str(path): stress for stress, path in files}, "settled": settled}
    tolerance = 1e-3 if options.tolerance is None else options.tolerance
    if not 0 < tolerance < 1:
        raise InputError(f"--tolerance {tolerance:g}: outside 0 to 1; 1e-3 is usual")
    start = cloud(options.spheres, options.aspect, options.seed)
    start = replace(
        start,
        study={"spheres": options.spheres, "aspect": options.aspect, "seed": options.seed},
        provenance={"seed": options.seed},
    )
    files = walk(Path(options.output), start, options.stress or list(WALK), tolerance, _say)
    return {"samples": {str(path): stress for stress, path in files}}


def _study_of(options: argparse.Namespace) -> Study:
    """The study of a chain with friction; its width follows from the aspect if none is given."""
    width = options.width
    if width is None and options.aspect > 0 and options.spheres > 0:
        width = (options.spheres * math.pi / 6 / NOMINAL_FRACTION / options.aspect) ** (1 / 3)
    given = {name: getattr(options, name) for name in WITH_FRICTION}
    return Study(
        mu_comp=options.friction,
        spheres=options.spheres,
        width=0.0 if width is None else width,
        seed=options.seed,
        **{name: value for name, value in given.items() if value is not None},
    )


def _typed(name: str) -> str:
    return "--" + name.replace("_", "-")


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
