"""The command `pack`: packings, from a cloud to each stress."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from modal.cli.options import add_command, say, typed
from modal.cli.terminal import COST, Groups
from modal.formats.hdf5 import InputError
from modal.packing.sample import read_sample
from modal.preparation import compress
from modal.preparation.packings import width_of
from modal.preparation.protocol import STRESSES, Study
from modal.preparation.random_packing import ASPECT, PEAK, WALK, check_stress, cloud, walk
from modal.preparation.sizes import DENSITIES, KINDS, MIXTURE, WALLS

WITH_FRICTION = {
    "approach_rate": "strain rate of the agitated spheres, 1/s",
    "agitated_damping": "their local damping",
    "inertial_number": "of the servo's largest strain rate",
    "fraction": "time step over its limit",
    "hot_stress": "mean stress of the agitated spheres at which the compaction ends, Pa",
    "damping": "local damping after that",
    "residual": "mean residual over contact force of a settled state",
}
"""Numbers of the protocol that a study may change."""


def add(commands: Any) -> None:
    """The options of `pack`."""
    text = "make packings: a cloud of spheres, compressed to each stress, with or without friction"
    pack = add_command(commands, "pack", text, "pack --spheres 300 --stress 1e5 -o dense")
    pack.add_argument(
        "--spheres", type=int, default=35201, metavar="N", help="how many (default 35201)"
    )
    pack.add_argument(
        "--aspect",
        type=float,
        default=ASPECT,
        metavar="A",
        help=f"length over width (default {ASPECT:g})",
    )
    pack.add_argument(
        "--seed", type=int, default=1, metavar="S", help="of the random cloud (default 1)"
    )
    pack.add_argument(
        "--stress",
        type=float,
        nargs="+",
        metavar="PA",
        help="one or several; a state is written of each",
    )
    pack.add_argument(
        "--friction", type=float, default=0.0, metavar="MU", help="0 to 1 (default 0)"
    )
    pack.add_argument(
        "--tolerance", type=float, metavar="T",
        help="without friction: mean net force over mean contact force (default 1e-3)",
    )  # fmt: skip
    pack.add_argument(
        "--peak",
        type=float,
        metavar="PA",
        help=f"without friction: sets the density (default {PEAK:g})",
    )
    pack.add_argument("--sizes", nargs="+", metavar="S", help=f"of a mixture: {KINDS}")
    pack.add_argument("--densities", nargs="+", metavar="RHO", help=DENSITIES)
    pack.add_argument(
        "--walls", nargs=2, metavar=("E", "NU"), help=f"{WALLS} (default those of glass)"
    )
    with_friction = pack.add_argument_group("with friction alone")
    study = Study()
    with_friction.add_argument(
        "--width", type=float, metavar="D", help="in diameters, instead of --aspect"
    )
    for name, text in WITH_FRICTION.items():
        default = getattr(study, name)
        with_friction.add_argument(
            typed(name), type=float, metavar="X", help=f"{text} (default {default:g})"
        )
    pack.add_argument(
        "-o", "--output", required=True, metavar="DIR", help="folder; goes on where it was"
    )


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Run or continue a compression; names of the files that hold its states."""
    for stress in options.stress or ():
        check_stress(stress)
    unused = ("tolerance", "peak") if options.friction != 0 else ("width", *WITH_FRICTION)
    for name in unused:
        if getattr(options, name) is not None:
            kind = "with" if options.friction != 0 else "without"
            raise InputError(f"{typed(name)}: has no meaning {kind} friction; leave it out")
    if options.friction != 0:
        study = _study_of(options)
        folder, stresses = Path(options.output), options.stress or STRESSES
        files = compress.walk(folder, study, stresses, "python -m modal pack", say)
        settled = {str(path): bool(read_sample(path).study["settled"]) for _, path in files}
        return {"samples": {str(path): stress for stress, path in files}, "settled": settled}
    tolerance = 1e-3 if options.tolerance is None else options.tolerance
    if not 0 < tolerance < 1:
        raise InputError(f"--tolerance {tolerance:g}: outside 0 to 1; 1e-3 is usual")
    peak = PEAK if options.peak is None else options.peak
    if not max(options.stress or WALK) <= peak <= 10 * PEAK:
        raise InputError(
            f"--peak {peak:g} Pa: below a stress of the walk, or above {10 * PEAK:g} Pa; "
            f"{PEAK:g} is usual"
        )
    mixture = {name: getattr(options, name) for name in MIXTURE if getattr(options, name)}
    start = cloud(options.spheres, options.aspect, options.seed, **mixture)
    words = {name: " ".join(given) for name, given in mixture.items()}
    start = replace(
        start,
        study={"spheres": options.spheres, "aspect": options.aspect, "seed": options.seed} | words,
        provenance={"seed": options.seed},
    )
    files = walk(Path(options.output), start, options.stress or list(WALK), tolerance, say, peak)
    return {"samples": {str(path): stress for stress, path in files}}


def _study_of(options: argparse.Namespace) -> Study:
    """A compression with friction; its width follows from the aspect if none is given."""
    width = options.width
    if width is None:
        width = width_of(options.spheres, options.aspect)
    given = {name: getattr(options, name) for name in WITH_FRICTION}
    mixture: dict[str, Any] = {name: " ".join(getattr(options, name) or ()) for name in MIXTURE}
    return Study(
        mu_comp=options.friction,
        spheres=options.spheres,
        width=width,
        seed=options.seed,
        **mixture,
        **{name: value for name, value in given.items() if value is not None},
    )


def shown(result: dict[str, Any]) -> Groups:
    """The result with the stresses of its states in Pa."""
    named = {"samples_pa" if name == "samples" else name: result[name] for name in result}
    return {"": {name: value for name, value in named.items() if name not in COST}}
