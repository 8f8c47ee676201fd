"""The command `wave`: signals of a wave in the linear network, from a wall, a plane or a sphere."""

from __future__ import annotations

import argparse
import math
from functools import partial
from typing import Any

from modal.cli.options import (
    add_choice,
    add_flag,
    add_value,
    chosen,
    refuse_given,
    say,
    typed,
)
from modal.cli.reading import network_command, packing_of
from modal.exchange.programs.own import is_sample
from modal.formats.hdf5 import sha256
from modal.packing.network import Network
from modal.packing.sample import Sample, read_sample
from modal.system.contacts import TANGENTS
from modal.system.damping import ContactDamping
from modal.tools.errors import InputError
from modal.waves.nonlinear import ACCURACY, NonlinearWave
from modal.waves.propagate import TOLERANCE, LinearWave, propagate
from modal.waves.signals import COMPONENT, Signals, read_signals, write_signals
from modal.waves.source import AMPLITUDE, INPUT_FREQUENCY, Motion, Pulse, chirp, read_motion, step
from modal.waves.sources import Plane, Point, Source, Wall

MOTIONS: dict[str, tuple[Any, ...]] = {
    "pulse": (Pulse, "amplitude", "input_frequency", "cycles"),
    "chirp": (chirp, "amplitude", "input_frequency", "last_frequency", "sweep"),
    "step": (step, "amplitude", "sweep"),
    "file": (read_motion, "motion_file"),
}
"""What makes each motion of the source, and of which options."""
USUAL = {
    **{"amplitude": AMPLITUDE, "input_frequency": INPUT_FREQUENCY, "cycles": 1},
    **{"last_frequency": None, "sweep": None, "motion_file": None},
}
"""Those options where nothing is said; without a usual value they must be given."""
NOISY = 0.01
"""Motion without a wave, over the wave's, from which on it is remarked on."""

read_product = partial(read_signals, of_any_source=True)


def add(commands: Any) -> None:
    """The options of `wave`."""
    text = "the wave that a push of the source wall sends through the contacts' springs"
    example = "wave mine.network.h5 --duration 4e-4 -o mine.signals.h5"
    command = network_command(commands, "wave", text, example, "*.signals.h5", TANGENTS)
    add_value(command, "--amplitude", "A", "half the wall's stroke, m", AMPLITUDE)
    add_value(command, "--input-frequency", "HZ", "of the pulse", INPUT_FREQUENCY)
    add_value(command, "--duration", "S", "of the record", 5e-4)
    given = command.add_mutually_exclusive_group()
    add_choice(given, "--motion", list(MOTIONS)[:-1], "of the source wall", "pulse")
    text = "the source's motion as a table of two columns: s, m"
    add_value(given, "--motion-file", "FILE", text, kind=str)
    add_value(command, "--cycles", "N", "of a pulse", 1, int)
    add_value(command, "--last-frequency", "HZ", "at the end of a chirp")
    add_value(command, "--sweep", "S", "how long a chirp lasts, or a step rises")
    add_value(command, "--interval", "S", "between records", 1e-6)
    text = "relative error; of --nonlinear that of the time step"
    add_value(command, "--tolerance", "T", f"{text} (default {TOLERANCE}, {ACCURACY})")
    add_source(command)
    add_flag(command, "--particles", "record every sphere: to watch it, or for ParaView")
    text = "in steps as DEM programs, by leapfrog (default: exact in time)"
    add_value(command, "--time-step", "S", text)
    text = "contacts follow their law, slide and open; of a sample, in steps of an error of 1e-3"
    add_flag(command, "--nonlinear", text)
    text = "of --nonlinear: in place of the sample's own; 10 holds all contacts"
    add_value(command, "--friction", "MU", text)
    text = "compute all of a packing of equal parts side by side, as a crystal, not one of them"
    add_flag(command.add_argument_group("advanced"), "--whole", text)


def add_source(command: argparse.ArgumentParser) -> None:
    """The options that say what moves, along which direction, and how its motion decays."""
    text = "of the source's motion: along z, along x or y for S-waves, or torsion about z"
    add_choice(command, "--direction", COMPONENT, text, "z")
    source = command.add_mutually_exclusive_group()
    text = "in the place of the source wall the contacts across this height, m, open"
    add_value(source, "--plane", "Z", text)
    text = "in its place a force, in N, pushes sphere K (from 0 on), or a torque turns it"
    add_value(source, "--point", "K", text, kind=int)
    text = "of the contacts, over the critical: normal, tangential (default: none)"
    add_value(command, "--damping", ("N", "T"), text)


def asked_of(options: argparse.Namespace) -> dict[str, Any]:
    """What the options of `add_source` say, and the pre-stress."""
    source: Source = Wall() if options.point is None else Point(options.point)
    if options.plane is not None:
        source = Plane(options.plane)
    damping = ContactDamping(*options.damping) if options.damping else None
    more = chosen(options, "direction", "pre_stress")
    return {"source": source, "damping": damping, **more}


def _motion(options: argparse.Namespace) -> Motion:
    """The motion of the source wall; InputError for options that another motion has."""
    name = "file" if options.motion_file else options.motion
    make, *has = MOTIONS[name]
    others = {option: usual for option, usual in USUAL.items() if option not in has}
    refuse_given(options, others, f": the motion is a {name}, which has none")
    for option in has:
        if getattr(options, option) is None:
            raise InputError(f"--motion {name} needs {typed(option)}")
    motion: Motion = make(*chosen(options, *has).values())
    return motion


def run(options: argparse.Namespace) -> dict[str, Any]:
    """The wave that the source sends, and how exact it is."""
    if options.nonlinear and not is_sample(options.network):
        raise InputError(
            f"{options.network}: --nonlinear takes a *.sample.h5, which has the law and the "
            "friction of its contacts"
        )
    if options.nonlinear:
        packing: Sample | Network = read_sample(options.network)
    else:
        packing = packing_of(options, waves=True)
    wave: LinearWave | NonlinearWave = propagate(
        packing,
        motion=_motion(options),
        network_sha256=sha256(options.network),
        **asked_of(options),
        **chosen(options, "duration", "interval", "particles", "time_step", "tolerance", "whole"),
        **chosen(options, "nonlinear", "friction", "sliding"),
    )
    if options.output:
        write_signals(options.output, wave.signals, options.made)
        if isinstance(wave, LinearWave) and wave.signals.from_wall_to_wall:
            say(
                "velocities, low-pass frequency, attenuation: python -m analysis measure "
                f"{options.network} {options.output}"
            )
    freedom = 6 * len(packing.position)
    if isinstance(wave, NonlinearWave):
        return _recorded(wave.signals, freedom) | _of_nonlinear(wave, options)
    exact = {"truncation": wave.truncation}
    if options.time_step is not None:
        exact = {"time_step_s": options.time_step}
    if wave.repeats > 1:
        exact["computed_one_of_equal_parts"] = wave.repeats
    return _recorded(wave.signals, freedom) | {"products_with_k": wave.products, **exact}


def _recorded(signals: Signals, freedom: int) -> dict[str, Any]:
    """What any wave tells of its record."""
    moved = signals.chain_displacement
    if not moved.size and signals.layer_displacement is not None:
        moved = signals.layer_displacement
    return {
        "particles_of_the_chain": len(signals.chain_particle),
        "times": len(signals.time),
        "largest_displacement_m": float(abs(moved).max()),
        "degrees_of_freedom": freedom,
    }


def _of_nonlinear(wave: NonlinearWave, options: argparse.Namespace) -> dict[str, Any]:
    """What the wave of contacts that follow their law tells of its steps and its energy."""
    signals, balance = wave.signals, wave.signals.balance
    if balance and not balance.kept:
        options.remarks.append(
            f"the energy does not add up: gap {balance.gap:.1e}, drift {balance.drift:.1e} of the "
            "wave; take a smaller --tolerance"
        )
    if wave.noise > NOISY:
        options.remarks.append(
            f"without a wave the sample moves by {wave.noise:.1g} of the wave's motion; bring it "
            "to rest (modal relax)"
        )
    return {
        "steps": wave.steps,
        "time_step_s": signals.time_step,
        "time_step_error": wave.error,
        "noise": wave.noise,
        "contacts_slid": int((wave.dissipated > 0).sum()),
        "contacts_opened": int(wave.opened.sum()),
        "energy_gap": balance.gap if balance else math.nan,
        "dissipated_share": float(wave.energy[-1, 3] / abs(wave.energy[-1, 0])),
    }
