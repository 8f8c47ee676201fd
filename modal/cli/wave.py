"""The command `wave`: signals of a wave in the linear network, from a wall, a plane or a sphere."""

from __future__ import annotations

import argparse
import math
from functools import partial
from typing import Any

from modal.cli.options import add_output, add_skip_current, network_command, say, typed
from modal.cli.reading import add_springs, packing_of
from modal.exchange.programs.sample import is_sample
from modal.formats.hdf5 import sha256
from modal.packing.sample import read_sample
from modal.system.damping import ContactDamping
from modal.tools.errors import InputError
from modal.waves.nonlinear import ACCURACY, propagate_nonlinear
from modal.waves.propagate import propagate
from modal.waves.recording import COMPONENT
from modal.waves.signals import read_signals, write_signals
from modal.waves.source import AMPLITUDE, INPUT_FREQUENCY, Motion, Pulse, chirp, read_motion, step
from modal.waves.sources import Plane, Point, Source, Wall

NOISY = 0.01
"""Motion without a wave, over the wave's, from which on it is remarked on."""

read_product = partial(read_signals, of_any_source=True)


def add(commands: Any) -> None:
    """The options of `wave`."""
    command = network_command(
        commands,
        "wave",
        "the wave that a push of the source wall sends through the contacts' springs",
        "wave mine.network.h5 --duration 4e-4 -o mine.signals.h5",
    )
    command.add_argument(
        "--amplitude",
        type=float,
        default=AMPLITUDE,
        metavar="A",
        help=f"half the wall's stroke, m (default {AMPLITUDE:g})",
    )
    command.add_argument(
        "--input-frequency",
        type=float,
        default=INPUT_FREQUENCY,
        metavar="HZ",
        help=f"of the pulse (default {INPUT_FREQUENCY:g})",
    )
    command.add_argument(
        "--duration", type=float, default=5e-4, metavar="S", help="of the record (default 5e-4)"
    )
    given = command.add_mutually_exclusive_group()
    given.add_argument(
        "--motion", choices=("pulse", "chirp", "step"), default="pulse",
        help="of the source wall (default pulse)",
    )  # fmt: skip
    given.add_argument(
        "--motion-file", metavar="FILE", help="the source's motion as a table of two columns: s, m"
    )
    command.add_argument(
        "--cycles", type=int, default=1, metavar="N", help="of a pulse (default 1)"
    )
    command.add_argument("--last-frequency", type=float, metavar="HZ", help="at the end of a chirp")
    command.add_argument(
        "--sweep", type=float, metavar="S", help="how long a chirp lasts, or a step rises"
    )
    command.add_argument(
        "--interval", type=float, default=1e-6, metavar="S", help="between records (default 1e-6)"
    )
    command.add_argument(
        "--tolerance", type=float, metavar="T", default=1e-9, help="relative error (default 1e-9)"
    )
    add_source(command)
    command.add_argument(
        "--particles", action="store_true", help="record every sphere: to watch it, or for ParaView"
    )
    command.add_argument(
        "--damping", nargs=2, type=float, metavar=("N", "T"),
        help="of the contacts, over the critical: normal, tangential (default 0 0)",
    )  # fmt: skip
    command.add_argument(
        "--time-step", type=float, metavar="S",
        help="in steps as DEM programs, by leapfrog (default: exact in time)",
    )  # fmt: skip
    command.add_argument(
        "--nonlinear", action="store_true",
        help="contacts follow their law, slide and open; of a sample, in steps of an error of 1e-3",
    )  # fmt: skip
    command.add_argument(
        "--accuracy", type=float, metavar="T",
        help=f"of --nonlinear: error of the time step over the largest motion (default {ACCURACY})",
    )  # fmt: skip
    command.add_argument_group("advanced").add_argument(
        "--whole", action="store_true",
        help="compute all of a packing of equal parts side by side, as a crystal, not one of them",
    )  # fmt: skip
    add_springs(command)
    add_output(command, "write *.signals.h5")
    add_skip_current(command)


def add_source(command: argparse.ArgumentParser) -> None:
    """The options that say what moves, and along which direction."""
    command.add_argument(
        "--direction",
        choices=list(COMPONENT),
        default="z",
        help="of the source's motion: z (default), x or y for S-waves, or torsion about z",
    )
    source = command.add_mutually_exclusive_group()
    source.add_argument(
        "--plane", type=float, metavar="Z",
        help="in the place of the source wall the contacts across this height, m, open",
    )  # fmt: skip
    source.add_argument(
        "--point", type=int, metavar="K",
        help="in its place a force, in N, pushes sphere K (from 0 on), or a torque turns it",
    )  # fmt: skip


def source_of(options: argparse.Namespace) -> Source:
    """What the options of `add_source` say."""
    if options.plane is not None:
        return Plane(options.plane)
    return Wall() if options.point is None else Point(options.point)


def _motion(options: argparse.Namespace) -> Motion:
    """The motion of the source wall; InputError for options that another motion has."""
    name = "file" if options.motion_file else options.motion
    has = {
        "file": (),
        "pulse": ("amplitude", "input_frequency", "cycles"),
        "chirp": ("amplitude", "input_frequency", "last_frequency", "sweep"),
        "step": ("amplitude", "sweep"),
    }
    usual = {"amplitude": AMPLITUDE, "input_frequency": INPUT_FREQUENCY, "cycles": 1}
    for option in ("amplitude", "input_frequency", "cycles", "last_frequency", "sweep"):
        given = getattr(options, option) != usual.get(option)
        if given and option not in has.get(name, ()):
            raise InputError(f"{typed(option)}: the motion is a {name}, which has none")
        if not given and option in has.get(name, ()) and option not in usual:
            raise InputError(f"--motion {name} needs {typed(option)}")
    if name == "file":
        return read_motion(options.motion_file)
    if name == "chirp":
        return chirp(
            options.amplitude, options.input_frequency, options.last_frequency, options.sweep
        )
    if name == "step":
        return step(options.amplitude, options.sweep)
    return Pulse(options.amplitude, options.input_frequency, options.cycles)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """The wave that the source sends, and how exact it is."""
    if options.nonlinear:
        return _nonlinear(options)
    if options.accuracy is not None:
        raise InputError("--accuracy is of --nonlinear; the linear wave takes --tolerance")
    network = packing_of(options, waves=True)
    wave = propagate(
        network,
        options.duration,
        source=source_of(options),
        motion=_motion(options),
        interval=options.interval,
        tolerance=options.tolerance,
        pre_stress=options.pre_stress,
        particles=options.particles,
        direction=options.direction,
        damping=ContactDamping(*options.damping) if options.damping else None,
        time_step=options.time_step,
        whole=options.whole,
        network_sha256=sha256(options.network),
    )
    signals, accuracy = wave.signals, {"truncation": wave.truncation}
    if options.time_step is not None:
        accuracy = {"time_step_s": options.time_step}
    if wave.repeats > 1:
        accuracy["computed_one_of_equal_parts"] = wave.repeats
    if options.output:
        write_signals(options.output, signals, options.made)
        if signals.from_wall_to_wall:
            say(
                "velocities, low-pass frequency, attenuation: python -m analysis measure "
                f"{options.network} {options.output}"
            )
    moved = signals.chain_displacement
    if not moved.size and signals.layer_displacement is not None:
        moved = signals.layer_displacement
    return {
        "particles_of_the_chain": len(signals.chain_particle),
        "times": len(signals.time),
        "products_with_k": wave.products,
        **accuracy,
        "largest_displacement_m": float(abs(moved).max()),
        "degrees_of_freedom": 6 * network.n_particles,
    }


def _nonlinear(options: argparse.Namespace) -> dict[str, Any]:
    """The wave of a sample whose contacts follow their law; InputError for linear options."""
    if not is_sample(options.network):
        raise InputError(
            f"{options.network}: --nonlinear takes a *.sample.h5, which has the law and the "
            "friction of its contacts"
        )
    for option, usual in (
        *(("pre_stress", "none"), ("sliding", "elastic"), ("damping", None), ("plane", None)),
        *(("point", None), ("tolerance", 1e-9), ("whole", False)),
    ):
        if getattr(options, option) != usual:
            raise InputError(f"{typed(option)} with --nonlinear: take one of them")
    sample = read_sample(options.network)
    wave = propagate_nonlinear(
        sample,
        options.duration,
        motion=_motion(options),
        interval=options.interval,
        accuracy=ACCURACY if options.accuracy is None else options.accuracy,
        time_step=options.time_step,
        particles=options.particles,
        direction=options.direction,
        network_sha256=sha256(options.network),
    )
    signals, balance = wave.signals, wave.signals.balance
    if options.output:
        write_signals(options.output, signals, options.made)
    if balance and not balance.kept:
        options.remarks.append(
            f"the energy does not add up: gap {balance.gap:.1e}, drift {balance.drift:.1e} of the "
            "wave; take a smaller --accuracy"
        )
    if wave.noise > NOISY:
        options.remarks.append(
            f"without a wave the sample moves by {wave.noise:.1g} of the wave's motion; bring it "
            "to rest (modal relax)"
        )
    return {
        "particles_of_the_chain": len(signals.chain_particle),
        "times": len(signals.time),
        "steps": wave.steps,
        "time_step_s": signals.time_step,
        "time_step_error": wave.error,
        "noise": wave.noise,
        "largest_displacement_m": float(abs(signals.chain_displacement).max()),
        "contacts_slid": int((wave.dissipated > 0).sum()),
        "contacts_opened": int(wave.opened.sum()),
        "energy_gap": balance.gap if balance else math.nan,
        "dissipated_share": float(wave.energy[-1, 3] / wave.energy[:, 0].max()),
        "degrees_of_freedom": 6 * len(sample.position),
    }
