"""The command `pack`: packings, from a cloud to each stress."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from modal.cli.options import NewFolder, add_command, say, typed
from modal.cli.terminal import COST, Groups
from modal.exchange.registry import read_remarked
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.plausibility import WIDE
from modal.packing.sample import read_sample
from modal.preparation.packings import pack as packed
from modal.preparation.protocol import Study
from modal.preparation.random_packing import ASPECT, PEAK, TOLERANCE, WALK
from modal.preparation.sizes import DENSITIES, KINDS, MIXTURE, WALLS
from modal.tools.errors import InputError

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
ADVANCED = ("approach_rate", "agitated_damping")
"""Those of them that hardly anyone needs."""
TYPED = {
    "fraction": "--time-step-fraction",
    "hot_stress": "--agitation-stress",
    "damping": "--local-damping",
}
"""Options whose names are not those of the protocol's numbers."""

SOLID = vars(GLASS) | {"radius": RADIUS}
"""Options of what the spheres are of, with the study's numbers."""


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
        metavar="A",
        help=f"length over width (default {ASPECT:g}, or less so that the width is {WIDE:g} "
        "diameters, at least 1)",
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
    for name, own in SOLID.items():
        pack.add_argument(
            f"--{name}", type=float, metavar="X", help=f"of the spheres (default {own:g}, SI units)"
        )
    pack.add_argument(
        "--periodic", action="store_true", help="a cell without walls, with a period along z too"
    )
    with_friction = pack.add_argument_group("with friction alone")
    study = Study()
    with_friction.add_argument(
        "--width", type=float, metavar="D", help="in diameters, instead of --aspect"
    )
    with_friction.add_argument(
        "--stress-ratio", type=float, metavar="K",
        help="then the lateral stresses go to K times the axial one, which stays",
    )  # fmt: skip
    with_friction.add_argument(
        "--oedometric", action="store_true",
        help="from a tenth of the first stress compressed along z alone; K0 is told",
    )  # fmt: skip
    advanced = pack.add_argument_group("with friction alone, advanced")
    for name, text in WITH_FRICTION.items():
        (advanced if name in ADVANCED else with_friction).add_argument(
            option_of(name), dest=name, type=float, metavar="X",
            help=f"{text} (default {getattr(study, name):g})",
        )  # fmt: skip
    pack.add_argument(
        "-o", "--output", type=NewFolder, required=True, metavar="DIR",
        help="folder; goes on where it was",
    )  # fmt: skip


def option_of(name: str) -> str:
    """The option that sets a number of the protocol, as it is typed.

    >>> option_of("hot_stress"), option_of("residual")
    ('--agitation-stress', '--residual')
    """
    return TYPED.get(name, typed(name))


def _solid(options: argparse.Namespace) -> list[float] | None:
    """What the spheres are of, and their radius; None where all is the study's."""
    given = [getattr(options, name) for name in SOLID]
    if all(value is None for value in given):
        return None
    return [
        own if value is None else value for value, own in zip(given, SOLID.values(), strict=True)
    ]


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Run or continue a compression; names of the files that hold its states."""
    unused = (
        ("tolerance", "peak")
        if options.friction != 0
        else ("width", "stress_ratio", *WITH_FRICTION)
    )
    for name in unused:
        if getattr(options, name) is not None:
            kind = "with" if options.friction != 0 else "without"
            raise InputError(f"{option_of(name)}: has no meaning {kind} friction; leave it out")
    tolerance = options.tolerance
    if tolerance is not None and not 0 < tolerance < 1:
        raise InputError(f"--tolerance {tolerance:g}: outside 0 to 1; {TOLERANCE:g} is usual")
    given = ("aspect", "width", "tolerance", "peak", "stress_ratio", *MIXTURE, *WITH_FRICTION)
    files = packed(
        Path(options.output),
        say,
        options.spheres,
        options.stress or (),
        options.friction,
        options.seed,
        periodic=options.periodic,
        oedometric=options.oedometric,
        solid=_solid(options),
        **{name: value for name in given if (value := getattr(options, name)) is not None},
    )
    result: dict[str, Any] = {"samples": {str(path): stress for stress, path in files}}
    for _, path in files[-len(options.stress or WALK) :]:
        read_remarked(path, options.remarks.append)
    if options.friction != 0:
        notes = {str(path): read_sample(path).study for _, path in files}
        result["settled"] = {path: bool(study["settled"]) for path, study in notes.items()}
        if options.oedometric or options.stress_ratio is not None:
            name = "k0" if options.oedometric else "stress_ratio"
            result[name] = {path: float(study["stress_ratio"]) for path, study in notes.items()}
    return result


def shown(result: dict[str, Any]) -> Groups:
    """The result with the stresses of its states in Pa."""
    named = {"samples_pa" if name == "samples" else name: result[name] for name in result}
    return {"": {name: value for name, value in named.items() if name not in COST}}
