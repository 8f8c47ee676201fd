"""Natural frequencies and mode shapes, their list proved complete by inertia counts."""

from modal.cli.options import (
    FALLS_SHORT_STATUS,
    Group,
    Option,
    Options,
    Result,
    chosen,
    chosen_for,
    flag,
    say,
)
from modal.cli.reading import packing_of, springs
from modal.modes.eigenmodes import eigenmodes
from modal.modes.first_order import shift_by_law
from modal.modes.mode_set import ModeSet, read_modes, write_modes
from modal.modes.observables import PLANAR
from modal.modes.zero_modes import by_structure
from modal.solvers.factor import SOLVERS
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError

EXAMPLE = "modes mine.network.h5 --lowest 20 -o mine.modes.h5"
EPILOG = f"Exit status {FALLS_SHORT_STATUS}: the list lacks modes; it says how many."
WHICH_MODES = (
    Option("--lowest", "K", "the K lowest modes", kind=int),
    Option("--highest", "K", "the K highest modes", kind=int),
    Option("--below", "HZ", "all modes below HZ"),
    Option("--between", ("HZ", "HZ"), "all modes between two frequencies"),
    flag("--all", "all modes; for small packings"),
)
ADVANCED = (
    flag("--no-shapes", "a small file, sooner: all but the shapes"),
    flag("--uncertified", "--lowest or --highest without an inertia count: faster"),
    Option("--solver", "", "factorisation, or multigrid (default: the fastest)", kind=SOLVERS),
)
OPTIONS = (
    *springs(".modes.h5"),
    Group("", WHICH_MODES),
    Option("--hours", "H", "refuse what is estimated to take longer", 1.0),
    flag("--translations-only", "hold rotations at zero"),
    Group("advanced", ADVANCED),
)

UNCOUNTED = ("expected_modes", "expected_modes_error", "found_by_second_search")
"""What speaks for a list without a count (`modal.modes.uncounted`)."""

read_product = read_modes


def current_result(options: Options) -> Result:
    """Return how many modes a kept list lacks; the exit status depends on this number."""
    return {"missing": read_modes(options.output).missing}


def run(options: Options) -> Result:
    """Compute the requested modes, and tell whether their list is complete."""
    network = packing_of(options)
    if options.uncertified and options.highest is None and options.lowest is None:
        raise InputError(
            "uncertified",
            "--uncertified is for --lowest and --highest",
            remedy="other lists need their count",
        )
    modes = eigenmodes(
        network,
        **chosen_for(eigenmodes, options),
        shapes=bool(options.output) and not options.no_shapes,
        certify=not options.uncertified,
    )
    if options.output:
        write_modes(options.output, modes, options.made)
    _say_what_is_left_out(modes, options.output)
    system_options = chosen(options, "pre_stress", "sliding", "translations_only")
    system = LinearSystem.of(network, **system_options)
    structural = by_structure(system)
    collective = modes.floppy_modes - structural.total
    result = {
        "frequency_hz": modes.frequency.tolist(),
        "chi_z": modes.chi_z.tolist(),
        "residual": modes.residual.tolist(),
        "floppy_modes": modes.floppy_modes,
        "floppy_modes_by_kind": structural.kinds | {"collective": collective},
        "unstable_modes": modes.unstable_modes,
        "degrees_of_freedom": system.degrees_of_freedom,
        "certified": modes.certified,
        "missing": modes.missing,
        "uncertified_because": modes.attributes.get("uncertified_because", ""),
        "solver": modes.attributes["solver"],
        f"modes_with_chi_z_above_{PLANAR}": int((modes.chi_z > PLANAR).sum()),
    }
    for name in UNCOUNTED:
        if name in modes.attributes:
            result[name] = modes.attributes[name]
    if options.pre_stress == "none":
        shift = shift_by_law(system.network, modes)
        if shift is not None:
            result["shift_by_the_law_hz"] = shift.tolist()
    return result


def _say_what_is_left_out(modes: ModeSet, path: str | None) -> None:
    """Print why a list is not certified, and what the list and its file do not contain."""
    reason = modes.attributes.get("uncertified_because", "")
    if reason:
        say(f"not certified: {reason}")
    if modes.unstable_modes:
        say(f"K has a negative direction: {modes.unstable_modes} unstable modes are left out")
    shapes_left_out = modes.attributes.get("shapes_left_out")
    if path and shapes_left_out:
        say(f"{path} has no mode shapes: {shapes_left_out}")
