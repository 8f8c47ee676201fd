"""The wave that a push of the source wall sends through the contacts' springs."""

import math
from functools import partial
from typing import Any

from modal.cli.options import Group, Option, Options, Result, chosen_for, flag, say, typed
from modal.cli.reading import packing_of, springs
from modal.exchange.programs.own import is_sample
from modal.packing.network import Network
from modal.packing.sample import read_sample
from modal.system.damping import ContactDamping
from modal.tools.errors import InputError
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
from modal.waves.motions import Motion, Pulse, chirp, read_motion, step
from modal.waves.nonlinear import NONLINEAR_TOLERANCE, NonlinearWave
from modal.waves.propagate import LINEAR_TOLERANCE, propagate
from modal.waves.signals import COMPONENT, read_signals, write_signals
from modal.waves.sources import Plane, Point, Source, Wall

MOTIONS: dict[str, tuple[Any, ...]] = {
    "pulse": (Pulse, "amplitude", "input_frequency", "cycles"),
    "chirp": (chirp, "amplitude", "input_frequency", "last_frequency", "sweep"),
    "step": (step, "amplitude", "sweep"),
    "file": (read_motion, "motion_file"),
}
"""What makes each motion of the source, and of which options."""
NOISY = 0.01
"""Motion without a wave, over the wave's, from which on it is remarked on."""
EXAMPLE = "wave mine.network.h5 --duration 4e-4 -o mine.signals.h5"
STROKE = (
    f"half the wall's stroke, m (default: {PULSE_AMPLITUDE_IN_D:g} D, at most "
    f"{PULSE_AMPLITUDE_IN_OVERLAPS:g} of the mean overlap; D: mean diameter)"
)
FREQUENCY = (
    f"of the pulse (default: {PULSE_FREQUENCY_IN_V_PER_D:g} V / D; V: of a P-wave that every "
    "sphere follows)"
)
LENGTH = (
    f"of the record (default: the motion of the source, then {DURATION_IN_PASSAGES:g} times the "
    "height over V, twice as long for S-waves)"
)
EVERY = f"between records (default: {INTERVAL_IN_D_PER_V:g} D / V)"
OF_MOTION = (
    Option("--amplitude", "A", STROKE),
    Option("--input-frequency", "HZ", FREQUENCY),
    Option("--cycles", "N", "of a pulse", 1, int),
    Option("--last-frequency", "HZ", "at the end of a chirp"),
    Option("--sweep", "S", "how long a chirp lasts, or a step rises"),
)
OF_PACKING = ("amplitude", "input_frequency")
"""Of these, those that follow from the packing where they are not given."""
USUAL = {name[2:].replace("-", "_"): default for name, _, _, default, *_ in OF_MOTION}
WHICH_MOTION = (
    Option("--motion", "", "of the source wall", "pulse", ("pulse", "chirp", "step")),
    Option(
        "--motion-file", "FILE", "the source's motion as a table of two columns: s, m", None, str
    ),
)
MOVES = "of the source's motion: along z, along x or y for S-waves, or torsion about z"
OPENS = "in the place of the source wall the contacts across this height, m, open"
PUSHED = "in its place a force, in N, pushes sphere K (from 0 on), or a torque turns it"
DECAYS = "of the contacts, over the critical: normal, tangential (default: none)"
OF_SOURCE = (
    Option("--direction", "", MOVES, "z", tuple(COMPONENT)),
    Group("", [Option("--plane", "Z", OPENS), Option("--point", "K", PUSHED, kind=int)]),
    Option("--damping", ("N", "T"), DECAYS),
)
"""What moves, along which direction, and how its motion decays."""
BY_LAW = "contacts follow their law, slide and open; of a sample, in steps of an error of 1e-3"
ERROR = (
    f"relative error; of --nonlinear that of the time step (default {LINEAR_TOLERANCE}, "
    f"{NONLINEAR_TOLERANCE})"
)
HOLDS = "of --nonlinear: in place of the sample's own; 10 holds all contacts"
WHOLE = "compute all of a packing of equal parts side by side, as a crystal, not one of them"
OPTIONS = (
    *springs(".signals.h5"),
    Option("--duration", "S", LENGTH),
    *OF_MOTION,
    Group("", WHICH_MOTION),
    Option("--interval", "S", EVERY),
    Option("--tolerance", "T", ERROR),
    *OF_SOURCE,
    flag("--particles", "record every sphere: to watch it, or for ParaView"),
    Option("--time-step", "S", "in steps as DEM programs, by leapfrog (default: exact in time)"),
    flag("--nonlinear", BY_LAW),
    Option("--friction", "MU", HOLDS),
    Group("advanced", [flag("--whole", WHOLE)]),
)
read_product = partial(read_signals, of_any_source=True)


def in_force(options: Options) -> None:
    """The tolerance of the wave that is asked for, where none is given."""
    if options.tolerance is None:
        options.tolerance = NONLINEAR_TOLERANCE if options.nonlinear else LINEAR_TOLERANCE


def source_of(options: Options) -> dict[str, Any]:
    """What moves, and the dashpots of the contacts."""
    source: Source = Wall() if options.point is None else Point(options.point)
    if options.plane is not None:
        source = Plane(options.plane)
    damping = ContactDamping(*options.damping) if options.damping else None
    return {"source": source, "damping": damping}


def check_motion(options: Options) -> None:
    """Refuse options that another motion has, and a motion that lacks one of its own."""
    name = "file" if options.motion_file else options.motion
    _, *has = MOTIONS[name]
    for option in (*USUAL, *has):
        given = getattr(options, option)
        if option not in has and given != USUAL[option]:
            raise InputError(
                "foreign_option", f"{typed(option)}: the motion is a {name}, which has none"
            )
        if option in has and given is None and option not in OF_PACKING:
            raise InputError("missing_option", f"--motion {name} needs {typed(option)}")


def motion_in(network: Network, options: Options, source: Source) -> Motion:
    """Make the motion of the source; what is not given follows from the packing."""
    make, *has = MOTIONS["file" if options.motion_file else options.motion]
    defaults = {
        "amplitude": lambda: default_amplitude(network, source, options.direction),
        "input_frequency": lambda: default_frequency(network),
    }
    numbers = []
    for option in has:
        given = getattr(options, option)
        numbers.append(defaults[option]() if given is None else given)
    motion: Motion = make(*numbers)
    return motion


def run(options: Options) -> Result:
    """The wave that the source sends, and how exact it is."""
    path = options.network
    if options.nonlinear and not is_sample(path):
        raise InputError(
            "input",
            f"{path}: --nonlinear takes a *.sample.h5, which has the law and the friction of its "
            "contacts",
        )
    check_motion(options)
    packing: Any = read_sample(path) if options.nonlinear else packing_of(options, waves=True)
    source = source_of(options)
    network = packing.network() if options.nonlinear else packing
    motion = motion_in(network, options, source["source"])
    given = chosen_for(propagate, options) | source | {"motion": motion}
    duration = options.duration
    if duration is None:
        duration = default_duration(network, motion, options.direction)
    wave: Any = propagate(packing, duration, **given)
    signals = wave.signals
    if options.output:
        write_signals(options.output, signals, options.made)
        if signals.from_wall_to_wall and not options.nonlinear:
            say(
                "velocities, low-pass frequency, attenuation: python -m analysis measure "
                f"{path} {options.output}"
            )
    moved = signals.chain_displacement
    if not moved.size and signals.layer_displacement is not None:
        moved = signals.layer_displacement
    recorded = {
        "particles_of_the_chain": len(signals.chain_particle),
        "times": len(signals.time),
        "largest_displacement_m": float(abs(moved).max()),
        "degrees_of_freedom": 6 * len(packing.position),
    }
    if options.nonlinear:
        return recorded | _by_law(wave, options.remarks)
    accuracy = {"truncation": wave.truncation}
    if options.time_step is not None:
        accuracy = {"time_step_s": options.time_step}
    if wave.repeats > 1:
        accuracy["computed_one_of_equal_parts"] = wave.repeats
    return recorded | {"products_with_k": wave.products} | accuracy


def _by_law(wave: NonlinearWave, remarks: list[str]) -> dict[str, Any]:
    """What contacts that follow their law did, and how exact that is; remarks where it is not."""
    balance = wave.signals.balance
    if balance and not balance.closes:
        remarks.append(
            f"the energy does not add up: gap {balance.gap:.1e}, drift {balance.drift:.1e} of the "
            "wave; take a smaller --tolerance"
        )
    if wave.noise > NOISY:
        remarks.append(
            f"without a wave the sample moves by {wave.noise:.1g} of the wave's motion; bring it "
            "to rest (python -m modal relax)"
        )
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
