"""The wave that a push of the source wall sends through the contacts' springs."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from modal.cli.options import Group, Option, Options, Result, chosen_for, flag, say, typed
from modal.cli.reading import packing_of, springs
from modal.exchange.programs.own import is_sample
from modal.packing.network import Network
from modal.packing.sample import read_sample
from modal.system.damping import ContactDamping
from modal.tools.errors import InputError
from modal.waves.bursts import WINDOWS, SineBurst, SquareWave
from modal.waves.defaults import (
    DURATION_IN_PASSAGES,
    INTERVAL_IN_D_PER_V,
    PULSE_AMPLITUDE_IN_D,
    PULSE_AMPLITUDE_IN_OVERLAPS,
    PULSE_FREQUENCY_IN_V_PER_D,
    default_amplitude,
    default_duration,
    default_frequency,
)
from modal.waves.discs import Disc
from modal.waves.motions import Motion, Pulse, chirp, read_motion, step
from modal.waves.nonlinear import NONLINEAR_TOLERANCE, NonlinearWave
from modal.waves.propagate import LINEAR_TOLERANCE, LinearWave, propagate
from modal.waves.signals import COMPONENT, read_signals, write_signals
from modal.waves.sources import Plane, Point, RoughWall, Source, default_source


class MotionKind(NamedTuple):
    """One kind of source motion: the function that makes it, and the options that it takes."""

    make: Callable[..., Motion]
    options: tuple[str, ...]


MOTIONS = {
    "pulse": MotionKind(Pulse, ("amplitude", "input_frequency", "cycles")),
    "chirp": MotionKind(chirp, ("amplitude", "input_frequency", "last_frequency", "sweep")),
    "step": MotionKind(step, ("amplitude", "sweep")),
    "sine": MotionKind(SineBurst, ("amplitude", "input_frequency", "cycles", "window")),
    "square": MotionKind(SquareWave, ("amplitude", "input_frequency", "cycles")),
    "file": MotionKind(read_motion, ("motion_file",)),
}
"""Motions of the source by the words of --motion, and that of --motion-file."""
MAX_NOISE = 0.01
"""Largest motion without a wave, divided by the wave's motion, for which no remark is made."""
EXAMPLE = "wave mine.network.h5 --duration 4e-4 -o mine.signals.h5"
AMPLITUDE_HELP = (
    f"half the wall's stroke, m (default: {PULSE_AMPLITUDE_IN_D:g} D, at most "
    f"{PULSE_AMPLITUDE_IN_OVERLAPS:g} of the mean overlap; D: mean diameter)"
)
FREQUENCY_HELP = (
    f"of the pulse (default: {PULSE_FREQUENCY_IN_V_PER_D:g} V / D; V: of a P-wave that every "
    "sphere follows)"
)
DURATION_HELP = (
    f"of the record (default: the motion of the source, then {DURATION_IN_PASSAGES:g} times the "
    "height over V, twice as long for S-waves)"
)
INTERVAL_HELP = f"between records (default: {INTERVAL_IN_D_PER_V:g} D / V)"
MOTION_OPTIONS = (
    Option("--amplitude", "A", AMPLITUDE_HELP),
    Option("--input-frequency", "HZ", FREQUENCY_HELP),
    Option("--cycles", "N", "of a pulse, a sine or a square wave", 1, int),
    Option("--window", "", "envelope of a sine", "none", WINDOWS),
    Option("--last-frequency", "HZ", "at the end of a chirp"),
    Option("--sweep", "S", "how long a chirp lasts, or a step rises"),
)
"""Options for the arguments of all motions of the source."""
DEFAULTS_FROM_PACKING = ("amplitude", "input_frequency")
"""Arguments of motions with a default that follows from the packing."""
WHICH_MOTION = (
    Option(
        "--motion",
        "",
        "of the source",
        "pulse",
        tuple(name for name in MOTIONS if name != "file"),
    ),
    Option(
        "--motion-file", "FILE", "the source's motion as a table of two columns: s, m", None, str
    ),
)
DIRECTION_HELP = "of the source's motion: along z, along x or y for S-waves, or torsion about z"
PLANE_HELP = "in the place of the source wall the contacts across this height, m, open"
ROUGH_HELP = "the held spheres at the lower end move (default if no sphere touches a flat wall)"
POINT_HELP = "in its place a force, in N, pushes sphere K (from 0 on), or a torque turns it"
DISC_HELP = "in its place a disc of spheres moves as a plate: its centre and radius, m"
RECEIVERS_HELP = "heights, m, of discs like that of --disc whose mean motion is recorded"
DAMPING_HELP = "of the contacts, over the critical: normal, tangential (default: none)"
SOURCE_OPTIONS = (
    Option("--direction", "", DIRECTION_HELP, "z", tuple(COMPONENT)),
    Group(
        "",
        [
            Option("--plane", "Z", PLANE_HELP),
            Option("--point", "K", POINT_HELP, kind=int),
            flag("--rough-wall", ROUGH_HELP),
            Option("--disc", ("X", "Y", "Z", "R"), DISC_HELP),
        ],
    ),
    Option("--receivers", "Z ...", RECEIVERS_HELP),
    Option("--damping", ("N", "T"), DAMPING_HELP),
)
"""Options for the source, its direction, and the dashpots of the contacts."""
TOLERANCE_HELP = (
    f"relative error; of --nonlinear that of the time step (default {LINEAR_TOLERANCE}, "
    f"{NONLINEAR_TOLERANCE})"
)
TIME_STEP_HELP = "in steps as DEM programs, by leapfrog (default: exact in time)"
NONLINEAR_HELP = (
    "contacts follow their law, slide and open; of a sample, in steps of an error of 1e-3"
)
FRICTION_HELP = "of --nonlinear: in place of the sample's own; 10 holds all contacts"
ROLLING_HELP = "of --nonlinear: resistance of contacts to rolling, in place of the sample's own"
TWISTING_HELP = "of --nonlinear: the same against twisting"
WHOLE_HELP = "compute all of a packing of equal parts side by side, as a crystal, not one of them"
OPTIONS = (
    *springs(".signals.h5"),
    Option("--duration", "S", DURATION_HELP),
    *MOTION_OPTIONS,
    Group("", WHICH_MOTION),
    Option("--interval", "S", INTERVAL_HELP),
    Option("--tolerance", "T", TOLERANCE_HELP),
    *SOURCE_OPTIONS,
    flag("--particles", "record every sphere: to watch it, or for ParaView"),
    Option("--time-step", "S", TIME_STEP_HELP),
    flag("--nonlinear", NONLINEAR_HELP),
    Option("--friction", "MU", FRICTION_HELP),
    Option("--rolling", "MU", ROLLING_HELP),
    Option("--twisting", "MU", TWISTING_HELP),
    Group("advanced", [flag("--whole", WHOLE_HELP)]),
)

read_product = partial(read_signals, of_any_source=True)


def set_defaults(options: Options) -> None:
    """Set the tolerance to that of the linear or non-linear wave if none is given."""
    if options.tolerance is None:
        options.tolerance = NONLINEAR_TOLERANCE if options.nonlinear else LINEAR_TOLERANCE


def source_arguments(options: Options, network: Network) -> dict[str, Any]:
    """Return the arguments of `propagate` for source, receivers, and dashpots of the contacts.

    Raises InputError for receivers without a source disc, whose size and place they take.
    """
    source = default_source(network)
    if options.point is not None:
        source = Point(options.point)
    if options.plane is not None:
        source = Plane(options.plane)
    if options.rough_wall:
        source = RoughWall()
    receivers = []
    if options.disc is not None:
        x, y, z, radius = options.disc
        source = Disc((x, y, z), radius, options.direction)
        for height in options.receivers or ():
            receivers.append(Disc((x, y, height), radius, options.direction))
    elif options.receivers:
        raise InputError("missing_option", f"--receivers needs {typed('disc')}")
    damping = None
    if options.damping:
        damping = ContactDamping(*options.damping)
    return {"source": source, "damping": damping, "receivers": receivers}


def motion_name(options: Options) -> str:
    """Return the name in `MOTIONS` of the source's motion."""
    if options.motion_file:
        return "file"
    name: str = options.motion
    return name


def check_motion(options: Options) -> None:
    """Raise InputError for options that belong to another motion than the chosen one.

    Also raise InputError if an option that the chosen motion needs is missing.
    """
    name = motion_name(options)
    names = MOTIONS[name].options
    for option in MOTION_OPTIONS:
        argument = option.name.removeprefix("--").replace("-", "_")
        if argument not in names and getattr(options, argument) != option.default:
            raise InputError(
                "foreign_option", f"{option.name}: the motion is a {name}, which has none"
            )
    for argument in names:
        is_missing = getattr(options, argument) is None
        if is_missing and argument not in DEFAULTS_FROM_PACKING:
            raise InputError("missing_option", f"--motion {name} needs {typed(argument)}")


def motion_in(network: Network, options: Options, source: Source) -> Motion:
    """Make the motion of the source; missing arguments are chosen to suit the packing."""
    kind = MOTIONS[motion_name(options)]
    arguments = []
    for name in kind.options:
        value = getattr(options, name)
        if value is None and name == "amplitude":
            value = default_amplitude(network, source, options.direction)
        elif value is None and name == "input_frequency":
            value = default_frequency(network)
        arguments.append(value)
    return kind.make(*arguments)


def run(options: Options) -> Result:
    """Propagate the wave of a source; the result says how exact it is."""
    path = options.network
    if options.nonlinear and not is_sample(path):
        raise InputError(
            "not_a_sample",
            f"{path}: --nonlinear takes a *.sample.h5, which has the law and the friction of its "
            "contacts",
        )
    check_motion(options)
    if options.nonlinear and options.fluid:
        raise InputError(
            "fluid_of_nonlinear_wave",
            "--fluid: --nonlinear takes a sample, whose spheres are dry",
            remedy="leave one out",
        )
    if options.nonlinear:
        packing: Any = read_sample(path)
        network = packing.network()
    else:
        packing = packing_of(options, waves=True)
        network = packing
    arguments = chosen_for(propagate, options) | source_arguments(options, network)
    motion = motion_in(network, options, arguments["source"])
    duration = options.duration
    if duration is None:
        duration = default_duration(network, motion, options.direction)
    wave: Any = propagate(packing, duration, **arguments | {"motion": motion})
    signals = wave.signals
    if options.output:
        write_signals(options.output, signals, options.made)
        if signals.from_wall_to_wall and not options.nonlinear:
            say(
                "velocities, low-pass frequency, attenuation: python -m analysis measure "
                f"{path} {options.output}"
            )
    displacement = signals.chain_displacement
    if not displacement.size and signals.layer_displacement is not None:
        displacement = signals.layer_displacement
    result: Result = {
        "particles_of_the_chain": len(signals.chain_particle),
        "times": len(signals.time),
        "largest_displacement_m": float(abs(displacement).max()),
        "degrees_of_freedom": network.degrees_of_freedom,
    }
    if options.nonlinear:
        options.remarks += _nonlinear_remarks(wave)
        return result | _nonlinear_result(wave)
    return result | _linear_result(wave, options.time_step)


def _linear_result(wave: LinearWave, time_step: float | None) -> Result:
    """Return the cost and the numerical error of a linear wave."""
    result: Result = {"products_with_k": wave.products}
    if time_step is None:
        result["truncation"] = wave.truncation
    else:
        result["time_step_s"] = time_step
    if wave.repeats > 1:
        result["computed_one_of_equal_parts"] = wave.repeats
    return result


def _nonlinear_result(wave: NonlinearWave) -> Result:
    """Return the steps, the error, the slip and the energy balance of a non-linear wave."""
    balance = wave.signals.balance
    return {
        "steps": wave.steps,
        "time_step_s": wave.signals.time_step,
        "time_step_error": wave.error,
        "noise": wave.noise,
        "contacts_slid": int((wave.dissipated > 0).sum()),
        "contacts_opened": int(wave.opened.sum()),
        "energy_gap": balance.gap if balance else math.nan,
        "dissipated_share": float(wave.energy[-1, 3] / abs(wave.energy[-1, 0])),
    }


def _nonlinear_remarks(wave: NonlinearWave) -> list[str]:
    """Return remarks on a non-linear wave whose energy does not balance, or with much noise."""
    remarks = []
    balance = wave.signals.balance
    if balance and not balance.closes:
        remarks.append(
            f"the energy does not add up: gap {balance.gap:.1e}, drift {balance.drift:.1e} of the "
            "wave; take a smaller --tolerance"
        )
    if wave.noise > MAX_NOISE:
        remarks.append(
            f"without a wave the sample moves by {wave.noise:.1g} of the wave's motion; bring it "
            "to rest (python -m modal relax)"
        )
    return remarks
