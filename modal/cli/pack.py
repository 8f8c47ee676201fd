"""Make packings: a cloud of spheres, compressed to each stress, with or without friction."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from modal.cli.options import (
    FALLS_SHORT_STATUS,
    Group,
    Option,
    Options,
    Result,
    chosen,
    flag,
    output_folder,
    say,
    typed,
)
from modal.exchange.registry import read_remarked
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS
from modal.packing.contact_models import MODELS
from modal.packing.plausibility import MIN_WIDTH_IN_DIAMETERS
from modal.packing.sample import ELASTIC, read_sample
from modal.preparation.protocol import OF_FRICTION, PEAK, Study, unused
from modal.preparation.random_packing import ASPECT
from modal.preparation.random_packing import pack as packed
from modal.preparation.sizes import DENSITIES, KINDS, MIXTURE, WALLS
from modal.tools.errors import InputError

WITH_FRICTION = {
    "approach_rate": ("--approach-rate", "strain rate of the agitated spheres, 1/s"),
    "agitated_damping": ("--agitated-damping", "their local damping"),
    "inertial_number": ("--inertial-number", "of the servo's largest strain rate"),
    "fraction": ("--time-step-fraction", "time step over its limit"),
    "hot_stress": ("--agitation-stress", "mean stress at which the agitated compaction ends, Pa"),
    "damping": ("--local-damping", "local damping after that"),
}
"""Numbers of the protocol that a study may change: the option of each, and what it is."""
SOLID = {name: getattr(GLASS, name) for name in (*ELASTIC, "density")} | {"radius": RADIUS}
"""Options of what the spheres are of, with the study's numbers."""
SLENDER = (
    f"length over width (default {ASPECT:g}, or less so that the width is "
    f"{MIN_WIDTH_IN_DIAMETERS:g} diameters, at least 1)"
)
AT_REST = f"mean net force over mean contact force of a settled state (default {Study.residual:g})"
DENSE = f"without friction: sets the density (default {PEAK:g})"
DILATE = (
    "from spheres packed without friction, all lengths then 1 + X times as long, stirred and "
    "compressed again: dense with few contacts"
)
MODEL = f"{', '.join(MODELS)}; rough with its roughness, m, as rough 1e-6 (default {HERTZ_MINDLIN})"
LATERAL = "then the lateral stresses go to K times the axial one, which stays"
ALONG_Z = "from a tenth of the first stress compressed along z alone; K0 is told"
OF_COMPRESSION = (
    Option("--stress-ratio", "K", LATERAL),
    flag("--oedometric", ALONG_Z),
    Option("--dilate", "X", DILATE),
    *(
        Option(option, "X", f"{text} (default {getattr(Study, name):g})", more={"dest": name})
        for name, (option, text) in WITH_FRICTION.items()
    ),
)
EPILOG = (
    f"Exit status {FALLS_SHORT_STATUS}: a state did not come to its stresses or to rest; it is "
    "kept, and a line says how far it came."
)
EXAMPLE = "pack --spheres 300 --stress 1e5 -o dense"
OPTIONS = (
    Option("--spheres", "N", "how many", 35201, int),
    Group("", [Option("--aspect", "A", SLENDER), Option("--width", "D", "the same, in diameters")]),
    Option("--seed", "S", "of the random cloud", 1, int),
    Option("--stress", "PA ...", "one or several; a state is written of each"),
    Option("--friction", "MU", "0 to 1", 0.0),
    Option("--residual", "R", AT_REST),
    Option("--peak", "PA", DENSE),
    Option("--sizes", "S ...", f"of a mixture: {KINDS}", kind=str),
    Option("--densities", "RHO ...", DENSITIES, kind=str),
    Option("--walls", ("E", "NU"), f"{WALLS} (default those of glass)", kind=str),
    *(
        Option(f"--{name}", "X", f"of the spheres (default {own:g}, SI units)")
        for name, own in SOLID.items()
    ),
    Option("--contact-model", "M ...", MODEL, kind=str),
    flag("--periodic", "a cell without walls, with a period along z too"),
    Group("with friction alone", OF_COMPRESSION),
    output_folder("folder; goes on where it was"),
)


def option_of(name: str) -> str:
    """The option that sets a number of the protocol, as it is typed.

    >>> option_of("hot_stress"), option_of("residual")
    ('--agitation-stress', '--residual')
    """
    return WITH_FRICTION.get(name, (typed(name),))[0]


def shortfall(study: Mapping[str, Any], stress_ratio: float | None) -> str:
    """Say how near to its stresses and to balance a state came that was not reached."""
    came = f"stresses off by {study['stress_error']:.1e}, net forces {study['unbalanced']:.1e}"
    if stress_ratio is not None:
        ratio = study["stress_ratio"]
        came = f"lateral over axial stress {ratio:.3f}, {stress_ratio:g} was asked for; {came}"
    return (
        f"kept, but not reached: {came} of contact forces; take more spheres or a larger "
        "--residual, in another folder"
    )


def run(options: Options) -> Result:
    """Run or continue a compression; names of the files that hold its states."""
    names = "aspect", "width", "residual", "peak", "dilate", "stress_ratio", *MIXTURE, *OF_FRICTION
    given, solid = chosen(options, *names), chosen(options, *SOLID)
    kind = "without friction" if options.friction == 0 else "with friction"
    kind = "with --dilate" if options.friction and options.dilate else kind
    none = unused(options.friction, options.dilate or 0.0)
    for name in given.keys() & {*none, *(("stress_ratio",) if options.friction == 0 else ())}:
        raise InputError(
            "input", f"{option_of(name)}: has no meaning {kind}", remedy="leave it out"
        )
    model = options.contact_model or []
    model = [] if model == [HERTZ_MINDLIN] else model
    files = packed(
        Path(options.output),
        say,
        options.spheres,
        options.stress or (),
        options.friction,
        options.seed,
        periodic=options.periodic,
        oedometric=options.oedometric,
        solid=[*(SOLID | solid).values(), *model] if solid or model else None,
        **given,
    )
    result: Result = {"samples": {str(path): stress for stress, path in files}}
    notes = {str(path): read_sample(path).study for _, path in files}
    for path in notes:
        read_remarked(path, options.remarks.append)
    result["settled"] = {path: bool(study["settled"]) for path, study in notes.items()}
    result["reached"] = all(result["settled"].values())
    options.remarks += [
        f"{path}: {shortfall(study, options.stress_ratio)}"
        for path, study in notes.items()
        if not study["settled"]
    ]
    if options.oedometric or options.stress_ratio is not None:
        name = "k0" if options.oedometric else "stress_ratio"
        result[name] = {path: float(study["stress_ratio"]) for path, study in notes.items()}
    # Their stresses in Pa.
    options.groups = {"": {("samples_pa" if k == "samples" else k): result[k] for k in result}}
    return result
