"""The command `wave`: signals of a wave in the linear network."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import add_if_stale, network_command
from modal.formats.hdf5 import InputError, sha256
from modal.packing.plausibility import read_remarked
from modal.stiffness.pre_stress import PRE_STRESS
from modal.waves.leapfrog import leapfrog, steps_between_records
from modal.waves.propagate import propagate
from modal.waves.signals import read_signals, write_signals
from modal.waves.source import AMPLITUDE, INPUT_FREQUENCY, Motion, Pulse, read_motion

read_product = read_signals


def add(commands: Any) -> None:
    """The options of `wave`."""
    command = network_command(commands, "wave", "signals of a wave in the linear network")
    command.add_argument("--amplitude", type=float, default=AMPLITUDE, metavar="A", help="m")
    command.add_argument("--input-frequency", type=float, default=INPUT_FREQUENCY, metavar="HZ")
    command.add_argument("--duration", type=float, default=5e-4, metavar="S")
    command.add_argument("--source", metavar="FILE", help="wall motion, two columns: s, m")
    command.add_argument("--interval", type=float, metavar="S", help="between records; 1e-6")
    command.add_argument("--tolerance", type=float, default=1e-9, help="relative; 1e-9")
    command.add_argument("--pre-stress", choices=PRE_STRESS, default="none")
    command.add_argument("--particles", action="store_true", help="record every particle")
    command.add_argument("--method", choices=("chebyshev", "leapfrog"), default="chebyshev")
    command.add_argument("--time-step", type=float, metavar="S", help="of the leapfrog")
    command.add_argument("-o", "--output", metavar="FILE", help="write *.signals.h5")
    add_if_stale(command)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """The wave that the source wall sends, and how exact it is."""
    network = read_remarked(options.network, options.remarks.append)
    motion: Motion = Pulse(options.amplitude, options.input_frequency)
    if options.source:
        motion = read_motion(options.source)
    settings = {
        "motion": motion,
        "pre_stress": options.pre_stress,
        "particles": options.particles,
        "network_sha256": sha256(options.network),
    }
    interval = 1e-6 if options.interval is None else options.interval
    step = options.time_step
    if options.method == "leapfrog":
        if step is None:
            raise InputError("--method leapfrog needs --time-step; give it in s")
        every = steps_between_records(interval, step)
        signals = leapfrog(network, options.duration, step, every=every, **settings)
        accuracy = {"time_step_s": step}
    else:
        if step is not None:
            raise InputError("--time-step is for --method leapfrog; chebyshev takes --tolerance")
        wave = propagate(
            network, options.duration, interval=interval, tolerance=options.tolerance, **settings
        )
        signals = wave.signals
        accuracy = {"products_with_k": wave.products, "truncation": wave.truncation}
    if options.output:
        write_signals(options.output, signals, options.made)
    return {
        "particles_of_the_chain": len(signals.chain_particle),
        "times": len(signals.time),
        **accuracy,
        "largest_displacement_m": float(abs(signals.chain_displacement).max()),
        "degrees_of_freedom": 6 * network.n_particles,
    }
