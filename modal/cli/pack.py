"""The command `pack`: packings, from a cloud to each stress."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from modal.cli.options import say, typed
from modal.formats.hdf5 import InputError
from modal.packing.sample import read_sample
from modal.preparation import compress
from modal.preparation.packings import width_of
from modal.preparation.protocol import STRESSES, Study
from modal.preparation.random_packing import ASPECT, WALK, check_stress, cloud, walk

WITH_FRICTION = {
    "approach_rate": "strain rate of the agitated spheres, 1/s",
    "agitated_damping": "their local damping",
    "inertial_number": "of the servo's largest strain rate",
    "fraction": "time step over its limit",
}
"""Numbers of the protocol that a study may change."""


def add(commands: Any) -> None:
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
        with_friction.add_argument(typed(name), type=float, help=f"{text}; {default:g}")
    pack.add_argument("--json", action="store_true", help="print one JSON object")
    pack.add_argument("-o", "--output", required=True, metavar="DIR", help="goes on where it was")


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Run or continue a compression; names of the files that hold its states."""
    for stress in options.stress or ():
        check_stress(stress)
    unused = ("tolerance",) if options.friction != 0 else ("width", *WITH_FRICTION)
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
    start = cloud(options.spheres, options.aspect, options.seed)
    start = replace(
        start,
        study={"spheres": options.spheres, "aspect": options.aspect, "seed": options.seed},
        provenance={"seed": options.seed},
    )
    files = walk(Path(options.output), start, options.stress or list(WALK), tolerance, say)
    return {"samples": {str(path): stress for stress, path in files}}


def _study_of(options: argparse.Namespace) -> Study:
    """A compression with friction; its width follows from the aspect if none is given."""
    width = options.width
    if width is None:
        width = width_of(options.spheres, options.aspect)
    given = {name: getattr(options, name) for name in WITH_FRICTION}
    return Study(
        mu_comp=options.friction,
        spheres=options.spheres,
        width=width,
        seed=options.seed,
        **{name: value for name, value in given.items() if value is not None},
    )
