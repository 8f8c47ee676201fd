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
from modal.modes.mode_set import read_modes, write_modes
from modal.modes.observables import PLANAR
from modal.modes.zero_modes import by_structure
from modal.solvers.factor import SOLVERS
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError

EXAMPLE = "modes mine.network.h5 --lowest 20 -o mine.modes.h5"
EPILOG = f"Exit status {FALLS_SHORT_STATUS}: the list lacks modes; it says how many."
WHICH = (
    Option("--lowest", "K", "the K lowest modes", kind=int),
    Option("--highest", "K", "the K highest modes", kind=int),
    Option("--below", "HZ", "all modes below HZ"),
    Option("--between", ("HZ", "HZ"), "all modes between two frequencies"),
    flag("--all", "all modes; for small packings"),
)
ADVANCED = (
    flag("--no-shapes", "a small file, sooner: all but the shapes"),
    flag("--uncertified", "--highest without its inertia count: faster"),
    Option("--solver", "", "factorisation (default: the fastest)", kind=SOLVERS),
)
OPTIONS = (
    *springs(".modes.h5"),
    Group("", WHICH),
    Option("--hours", "H", "refuse what is estimated to take longer", 1.0),
    flag("--translations-only", "hold rotations at zero"),
    Group("advanced", ADVANCED),
)

read_product = read_modes


def kept(options: Options) -> Result:
    """What a list that is kept fell short of when it was made: its exit status stays."""
    return {"missing": read_modes(options.output).missing}


def run(options: Options) -> Result:
    """The modes that are asked for, and whether their list is complete."""
    network, output = packing_of(options), options.output
    if options.uncertified and options.highest is None:
        raise InputError(
            "input", "--uncertified is for --highest", remedy="other lists cost hardly less without"
        )
    asked = chosen_for(eigenmodes, options)
    shapes = bool(output) and not options.no_shapes
    modes = eigenmodes(network, **asked, shapes=shapes, certify=not options.uncertified)
    if output:
        write_modes(output, modes, options.made)
    reason = modes.attributes.get("uncertified_because", "")
    if reason:
        say(f"not certified: {reason}")
    if modes.unstable_modes:
        say(f"K has a negative direction: {modes.unstable_modes} unstable modes are left out")
    if output and (left_out := modes.attributes.get("shapes_left_out")):
        say(f"{output} has no mode shapes: {left_out}")
    how = chosen(options, "pre_stress", "sliding", "translations_only")
    system = LinearSystem.of(network, **how)
    zero = by_structure(system)
    found = {
        "frequency_hz": modes.frequency.tolist(),
        "chi_z": modes.chi_z.tolist(),
        "residual": modes.residual.tolist(),
        "floppy_modes": modes.floppy_modes,
        "floppy_modes_by_kind": zero.kinds | {"collective": modes.floppy_modes - zero.total},
        "unstable_modes": modes.unstable_modes,
        "degrees_of_freedom": system.size,
        "certified": modes.certified,
        "missing": modes.missing,
        "uncertified_because": reason,
        "solver": modes.attributes["solver"],
        f"modes_with_chi_z_above_{PLANAR}": int((modes.chi_z > PLANAR).sum()),
    }
    shift = shift_by_law(system.network, modes) if options.pre_stress == "none" else None
    return found if shift is None else found | {"shift_by_the_law_hz": shift.tolist()}
