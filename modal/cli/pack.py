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
from modal.packing.clumps import read_template
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS
from modal.packing.contact_models import MODELS
from modal.packing.noted_laws import ELASTIC
from modal.packing.sample import read_sample
from modal.packing.shape_remarks import MIN_WIDTH_IN_DIAMETERS
from modal.packing.sphere_sample import TURNING
from modal.preparation.mixture import MIXTURE, MixtureWords
from modal.preparation.random_packing import ASPECT, sound_aspect, width_of
from modal.preparation.random_packing import pack as pack_samples
from modal.preparation.sizes import DENSITIES, KINDS, WALLS
from modal.preparation.stress_path import StressPath
from modal.preparation.study import FRICTION_PARAMETERS, PEAK, Study, unused_parameters
from modal.tools.errors import InputError

FRICTION_OPTIONS = {
    "approach_rate": ("--approach-rate", "strain rate of the agitated spheres, 1/s"),
    "agitated_damping": ("--agitated-damping", "their local damping"),
    "inertial_number": ("--inertial-number", "of the servo's largest strain rate"),
    "fraction": ("--time-step-fraction", "time step over its limit"),
    "hot_stress": ("--agitation-stress", "mean stress at which the agitated compaction ends, Pa"),
    "damping": ("--local-damping", "local damping after that"),
}
"""Option and help of each number of the protocol that a study may change."""
SOLID = {name: getattr(GLASS, name) for name in (*ELASTIC, "density")} | {"radius": RADIUS}
"""Default numbers of the spheres; for each there is an option of the same name."""
ASPECT_HELP = (
    f"length over width (default {ASPECT:g}, or less so that the width is "
    f"{MIN_WIDTH_IN_DIAMETERS:g} diameters, at least 1)"
)
RESIDUAL_HELP = (
    f"mean net force over mean contact force of a settled state (default {Study.residual:g})"
)
PEAK_HELP = f"without friction: sets the density (default {PEAK:g})"
DILATE_HELP = (
    "from spheres packed without friction, all lengths then 1 + X times as long, stirred and "
    "compressed again: dense with few contacts"
)
MODEL_HELP = (
    f"{', '.join(MODELS)}; rough with its roughness, m, as rough 1e-6; dmt and jkr with the work "
    "of adhesion, J/m^2, as jkr 0.1; liquid-bridge with surface tension, N/m, volume of a bridge, "
    f"m^3, and contact angle, degrees; cement-bond with modulus, Pa, radius over that of the "
    f"spheres, and strength, Pa (default {HERTZ_MINDLIN})"
)
STRESS_RATIO_HELP = "then the lateral stresses go to K times the axial one, which stays"
OEDOMETRIC_HELP = "from a tenth of the first stress compressed along z alone; K0 is told"
ROLLING_HELP = (
    "resistance of contacts to rolling, 0 to 1: moments up to this share of the normal force times "
    "R1 R2 / (R1 + R2)"
)
CLUMP_HELP = (
    "clumps in place of spheres: a template, *.csv, of x, y, z and radius of their spheres in any "
    "unit; each has the volume of a sphere of --radius, of which --spheres is the number"
)
TWISTING_HELP = "the same against twisting about the contact's normal"
COMPRESSION_OPTIONS = (
    Option("--clump", "CSV", CLUMP_HELP, kind=str),
    Option("--rolling", "MU", ROLLING_HELP),
    Option("--twisting", "MU", TWISTING_HELP),
    Option("--stress-ratio", "K", STRESS_RATIO_HELP),
    flag("--oedometric", OEDOMETRIC_HELP),
    Option("--dilate", "X", DILATE_HELP),
    *(
        Option(option, "X", f"{text} (default {getattr(Study, name):g})", more={"dest": name})
        for name, (option, text) in FRICTION_OPTIONS.items()
    ),
)
EPILOG = (
    f"Exit status {FALLS_SHORT_STATUS}: a state did not come to its stresses or to rest; it is "
    "kept, and a line says how far it came."
)
EXAMPLE = "pack --spheres 300 --stress 1e5 -o dense"
OPTIONS = (
    Option("--spheres", "N", "how many", 35201, int),
    Group(
        "",
        [
            Option("--aspect", "A", ASPECT_HELP),
            Option("--width", "D", "the same, in diameters"),
        ],
    ),
    Option("--seed", "S", "of the random cloud", 1, int),
    Option("--stress", "PA ...", "one or several; a state is written of each"),
    Option("--friction", "MU", "0 to 1", 0.0),
    Option("--residual", "R", RESIDUAL_HELP),
    Option("--peak", "PA", PEAK_HELP),
    Option("--sizes", "S ...", f"of a mixture: {KINDS}", kind=str),
    Option("--densities", "RHO ...", DENSITIES, kind=str),
    Option("--walls", ("E", "NU"), f"{WALLS} (default those of glass)", kind=str),
    *(
        Option(f"--{name}", "X", f"of the spheres (default {number:g}, SI units)")
        for name, number in SOLID.items()
    ),
    Option("--contact-model", "M ...", MODEL_HELP, kind=str),
    flag("--periodic", "a cell without walls, with a period along z too"),
    Group("with friction alone", COMPRESSION_OPTIONS),
    output_folder("folder; goes on where it was"),
)
STUDY_NAMES = (*TURNING, "residual", "dilate", *FRICTION_PARAMETERS)
"""Names of options that are fields of a `Study` of the same names."""
CONDITIONAL_NAMES = (*STUDY_NAMES, "clump", "peak", "stress_ratio")
"""Names of options that have a meaning with some coefficients of friction only."""


def option_of(name: str) -> str:
    """Return the option that sets a number of the protocol, as the user types it.

    >>> option_of("hot_stress"), option_of("residual")
    ('--agitation-stress', '--residual')
    """
    if name in FRICTION_OPTIONS:
        return FRICTION_OPTIONS[name][0]
    return typed(name)


def shortfall(study: Mapping[str, Any], stress_ratio: float | None) -> str:
    """Return a sentence on how far a state is from its target stresses and from balance."""
    reached = f"stresses off by {study['stress_error']:.1e}, net forces {study['unbalanced']:.1e}"
    if stress_ratio is not None:
        ratio = study["stress_ratio"]
        reached = (
            f"lateral over axial stress {ratio:.3f}, {stress_ratio:g} was asked for; {reached}"
        )
    return (
        f"kept, but not reached: {reached} of contact forces; take more spheres or a larger "
        "--residual, in another folder"
    )


def run(options: Options) -> Result:
    """Run or continue a compression; the result has the names of the files of its states."""
    _refuse_unused(options)
    study = _read_study(options)
    if options.aspect is None and options.width is None:
        aspect = sound_aspect(options.spheres)
        say(f"{options.spheres} spheres: length over width {aspect:.3g}")
    stress_path = StressPath(
        tuple(options.stress or ()), options.peak, options.stress_ratio, options.oedometric
    )
    files = pack_samples(Path(options.output), study, stress_path, say)
    notes = {str(path): read_sample(path).study for _, path in files}
    for path in notes:
        read_remarked(path, options.remarks.append)
    settled = {path: bool(noted["settled"]) for path, noted in notes.items()}
    result: Result = {
        "samples": {str(path): stress for stress, path in files},
        "settled": settled,
        "reached": all(settled.values()),
    }
    for path, noted in notes.items():
        if not noted["settled"]:
            options.remarks.append(f"{path}: {shortfall(noted, options.stress_ratio)}")
    if options.oedometric or options.stress_ratio is not None:
        name = "k0" if options.oedometric else "stress_ratio"
        result[name] = {path: float(noted["stress_ratio"]) for path, noted in notes.items()}
    # People see the stresses of the samples with their unit.
    shown = {"samples_pa": result["samples"]}
    shown |= {name: value for name, value in result.items() if name != "samples"}
    options.groups = {"": shown}
    return result


def _read_study(options: Options) -> Study:
    """Return the study that the options describe."""
    width = options.width
    if width is None:
        aspect = options.aspect
        if aspect is None:
            aspect = sound_aspect(options.spheres)
        width = width_of(options.spheres, aspect)
    words = MixtureWords(
        solid=_solid(options), periodic=options.periodic, **chosen(options, *MIXTURE)
    )
    numbers = chosen(options, *STUDY_NAMES)
    if options.clump is not None:
        numbers["clump"] = " ".join(read_template(options.clump))
    return Study(options.friction, options.spheres, width, options.seed, **words.texts(), **numbers)


def _refuse_unused(options: Options) -> None:
    """Raise InputError for an option that has no meaning with this friction."""
    unused_names = list(unused_parameters(options.friction, options.dilate or 0.0))
    kind = "with friction"
    if options.friction == 0:
        kind = "without friction"
        unused_names += ["stress_ratio", "clump", *TURNING]
    elif options.dilate:
        kind = "with --dilate"
    for name in chosen(options, *CONDITIONAL_NAMES).keys() & {*unused_names}:
        raise InputError(
            "unused_option",
            f"{option_of(name)}: has no meaning {kind}",
            remedy="leave it out",
        )


def _solid(options: Options) -> list[Any] | None:
    """Return the numbers of the spheres and their contact model; None for the default glass."""
    numbers = chosen(options, *SOLID)
    model = options.contact_model or []
    if model == [HERTZ_MINDLIN]:
        model = []
    if not numbers and not model:
        return None
    return [*(SOLID | numbers).values(), *model]
