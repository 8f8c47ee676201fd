"""The command `pack`: packings, from a cloud to each stress."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from modal.cli.options import NewFolder, add_command, add_flag, add_value, say, typed
from modal.cli.terminal import COST, Groups
from modal.exchange.registry import read_remarked
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS
from modal.packing.contact_models import MODELS
from modal.packing.plausibility import WIDE
from modal.packing.sample import ELASTIC, read_sample
from modal.preparation.packings import pack as packed
from modal.preparation.protocol import Study
from modal.preparation.random_packing import ASPECT, PEAK, PRESSURES, TOLERANCE
from modal.preparation.sizes import DENSITIES, KINDS, MIXTURE, WALLS
from modal.tools.errors import InputError

WITH_FRICTION = {
    "approach_rate": ("--approach-rate", "strain rate of the agitated spheres, 1/s"),
    "agitated_damping": ("--agitated-damping", "their local damping"),
    "inertial_number": ("--inertial-number", "of the servo's largest strain rate"),
    "fraction": ("--time-step-fraction", "time step over its limit"),
    "hot_stress": ("--agitation-stress", "mean stress at which the agitated compaction ends, Pa"),
    "damping": ("--local-damping", "local damping after that"),
    "residual": ("--residual", "mean residual over contact force of a settled state"),
}
"""Numbers of the protocol that a study may change: the option of each, and what it is."""
SOLID = {name: getattr(GLASS, name) for name in (*ELASTIC, "density")} | {"radius": RADIUS}
"""Options of what the spheres are of, with the study's numbers."""


def add(commands: Any) -> None:
    """The options of `pack`."""
    text = "make packings: a cloud of spheres, compressed to each stress, with or without friction"
    pack = add_command(commands, "pack", text, "pack --spheres 300 --stress 1e5 -o dense")
    add_value(pack, "--spheres", "N", "how many", 35201, int)
    text = f"length over width (default {ASPECT:g}, or less so that the width is {WIDE:g} "
    add_value(pack, "--aspect", "A", f"{text}diameters, at least 1)")
    add_value(pack, "--seed", "S", "of the random cloud", 1, int)
    text = "one or several; a state is written of each"
    add_value(pack, "--stress", "PA", text, nargs="+")
    add_value(pack, "--friction", "MU", "0 to 1", 0.0)
    text = "without friction: mean net force over mean contact force"
    add_value(pack, "--tolerance", "T", f"{text} (default {TOLERANCE:g})")
    add_value(pack, "--peak", "PA", f"without friction: sets the density (default {PEAK:g})")
    add_value(pack, "--sizes", "S", f"of a mixture: {KINDS}", kind=str, nargs="+")
    add_value(pack, "--densities", "RHO", DENSITIES, kind=str, nargs="+")
    add_value(pack, "--walls", ("E", "NU"), f"{WALLS} (default those of glass)", kind=str)
    for name, own in SOLID.items():
        add_value(pack, f"--{name}", "X", f"of the spheres (default {own:g}, SI units)")
    model = (
        f"{', '.join(MODELS)}; rough with its roughness, m, as rough 1e-6 (default {HERTZ_MINDLIN})"
    )
    add_value(pack, "--contact-model", "M", model, kind=str, nargs="+")
    add_flag(pack, "--periodic", "a cell without walls, with a period along z too")
    study, with_friction = Study(), pack.add_argument_group("with friction alone")
    add_value(with_friction, "--width", "D", "in diameters, instead of --aspect")
    text = "then the lateral stresses go to K times the axial one, which stays"
    add_value(with_friction, "--stress-ratio", "K", text)
    text = "from a tenth of the first stress compressed along z alone; K0 is told"
    add_flag(with_friction, "--oedometric", text)
    for name, (option, text) in WITH_FRICTION.items():
        text += f" (default {getattr(study, name):g})"
        add_value(with_friction, option, "X", text, dest=name)
    pack.add_argument(
        "-o", "--output", type=NewFolder, required=True, metavar="DIR",
        help="folder; goes on where it was",
    )  # fmt: skip


def option_of(name: str) -> str:
    """The option that sets a number of the protocol, as it is typed.

    >>> option_of("hot_stress"), option_of("residual")
    ('--agitation-stress', '--residual')
    """
    return WITH_FRICTION.get(name, (typed(name),))[0]


def _solid(options: argparse.Namespace) -> list[str | float] | None:
    """What the spheres are of, their radius and contact model; None where all is the study's."""
    model = options.contact_model or []
    model = [] if model == [HERTZ_MINDLIN] else model
    given = {name: x for name in SOLID if (x := getattr(options, name)) is not None}
    return [*(SOLID | given).values(), *model] if given or model else None


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Run or continue a compression; names of the files that hold its states."""
    kind, unused = "without", ["width", "stress_ratio", *WITH_FRICTION]
    if options.friction != 0:
        kind, unused = "with", ["tolerance", "peak"]
    for name in unused:
        if getattr(options, name) is not None:
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
    for _, path in files[-len(options.stress or PRESSURES) :]:
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
