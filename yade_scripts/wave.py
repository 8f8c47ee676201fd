"""Send a pulse of the source wall through the sample of a case, and write caseNN.signals.h5.

    yade -n -x -j1 yade_scripts/wave.py                  (case 2)
    yade-batch own.table yade_scripts/wave.py

Needs caseNN.network.h5 and caseNN.highest.modes.h5: the time step is `fraction` of 2 / omega_max,
the exact limit of the leapfrog scheme. The settings are columns of the table, or environment
variables (WAVE_FRACTION and so on), which override them:

    fraction    time step divided by its limit
    amplitude   m; a negative one reverses the wall
    duration    s; by default until the wave front has reached the receiver wall `passage` times
    interval    s; longest time between two records, 0 for every step
    particles   1 records every particle, not only chain and layers
    direction   z, or x or y: the wall slides and sends an S-wave
    damping     "0.05 0.03": dashpots of the contacts, normal and tangential, as shares of the
                critical damping; such a run has no energy balance
    motion      a file of two columns, s and m: motion of the wall instead of the pulse

All settings are recorded in the product; signals that were made with other settings or from other
files are made again. WAVE_PRODUCTS names the folder.
"""

import math
import os
import sys
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, config
from yade.utils import readParamsFromTable

from modal.formats.provenance import (
    Provenance,
    Source,
    packing_of,
    read_provenance,
    require_same_packing,
    versions,
)
from modal.modes.mode_set import read_modes
from modal.packing.network import read_network
from modal.packing.sample import sample_of_network
from modal.packing.state import affine_velocity
from modal.system.damping import ContactDamping
from modal.tools.errors import InputError
from modal.waves import motions
from modal.waves.motions import Pulse, read_motion
from modal.waves.signals import DIRECTIONS, Signals, read_signals, write_signals
from yade_scripts.scene import finish, is_product_current, products_folder
from yade_scripts.state import build_scene
from yade_scripts.wave_run import WaveRun

readParamsFromTable(
    noTableOk=True,
    case=2,
    mu_wave=0.1,
    input_frequency=motions.INPUT_FREQUENCY,
    fraction=motions.TIME_STEP_FRACTION,
    passage=1.0,
    amplitude=motions.AMPLITUDE,
    duration=None,
    interval=motions.RECORDING_INTERVAL,
    particles=0,
    direction="z",
    damping="",
    motion="",
    unknownOk=True,  # columns that the sample has used
)
from yade.params import table  # noqa: E402

OPTIONAL_SETTINGS = ("duration", "damping")
"""Settings that may be absent."""
COLLIDER_MARGIN = 0.01
"""Distance around each sphere in which YADE's collider looks for contacts, in radii."""


def read_text(name):
    """Return a setting from the environment (WAVE_NAME) or the table; empty if it is absent."""
    value = os.environ.get(f"WAVE_{name.upper()}", getattr(table, name))
    if value is None:
        return ""
    return str(value)


def read_numbers(name, count):
    """Return the numbers of a setting; empty if an optional one is absent.

    Raises InputError if there are not `count` numbers.
    """
    text = read_text(name)
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = [math.nan]
    if not numbers and name in OPTIONAL_SETTINGS:
        return numbers
    if len(numbers) != count or any(math.isnan(number) for number in numbers):
        noun = "number" if count == 1 else "numbers"
        raise InputError(name, f"{name} {text!r}", remedy=f"give {count} {noun}")
    return numbers


def read_number(name):
    """Return the number of a setting, or None if an optional one is absent."""
    numbers = read_numbers(name, 1)
    return numbers[0] if numbers else None


def read_settings():
    """Return the numbers of the run, by name; raise InputError for impossible ones."""
    settings = {
        "fraction": read_number("fraction"),
        "amplitude": read_number("amplitude"),
        "input_frequency": read_number("input_frequency"),
        "duration": read_number("duration"),
        "interval": read_number("interval"),
        "particles": read_number("particles"),
        "passage": read_number("passage"),
    }
    fraction = settings["fraction"]
    if not 0 < fraction <= 1:
        raise InputError(
            "fraction", f"WAVE_FRACTION {fraction}", "the time step is stable from 0 to 1 only"
        )
    for name in ("duration", "passage"):
        if settings[name] is not None and not 0 < settings[name] < math.inf:
            raise InputError(name, f"{name} {settings[name]:g}", remedy="give a number above 0")
    if not 0 <= settings["interval"] < math.inf:
        raise InputError(
            "interval",
            f"interval {settings['interval']:g}",
            remedy="give seconds, or 0 for every step",
        )
    if settings["particles"] not in (0, 1):
        raise InputError(
            "particles",
            f"particles {settings['particles']:g}",
            remedy="give 1 for a record of every particle, or 0",
        )
    return settings


def read_direction():
    """Return the direction of the wall's motion; raise InputError for an unknown one."""
    direction = read_text("direction")
    if direction not in DIRECTIONS:
        raise InputError("direction", f"direction {direction!r}", remedy="choose x, y or z")
    return direction


def read_damping():
    """Return the damping of the contacts, or None."""
    ratios = read_numbers("damping", 2)
    return ContactDamping(*ratios) if ratios else None


def read_highest_frequency(path, packing):
    """Return the frequency, Hz, of the highest mode of this packing.

    Raises InputError if the modes are not the highest ones of the packing.
    """
    note = require_same_packing(path, packing)
    if note:
        print(note)
    mode_settings = read_provenance(path).settings
    if mode_settings is not None and not {"highest", "all"} & mode_settings.keys():
        raise InputError(
            "other_modes",
            f"{path}",
            "not the highest modes",
            "make them with python -m modal modes --highest 1",
        )
    return read_modes(path).frequency[-1]


def build_wave_scene(network, damping):
    """Build the scene of a network at rest, with dashpots at its contacts if there is damping."""
    build_scene(sample_of_network(network, table.mu_wave), margin=COLLIDER_MARGIN, damping=0.0)
    if damping:
        for contact in O.interactions:
            contact.phys.betan = damping.normal
            contact.phys.betas = damping.tangential
    # During a wave no sphere moves by a millionth of a radius: the collider is not needed.
    O.labeledEngine("collider").dead = True


def make_signals(run, settings, direction, has_damping):
    """Return the records of a finished run as signals, with its energy balance."""
    network = run.network
    records = np.array(run.records)
    particle_displacement = None
    if run.every_particle:
        particle_displacement = np.array(run.particle_records)
    return Signals(
        time=records[:, 0],
        chain_particle=run.chain,
        chain_position=network.position[run.chain, 2],
        chain_displacement=records[:, 4:],
        source_displacement=records[:, 1],
        source_stress=records[:, 2] - records[0, 2],
        receiver_stress=records[:, 3] - records[0, 3],
        producer="yade",
        case=str(table.case),
        amplitude=run.motion.amplitude,
        input_frequency=run.motion.frequency,
        time_step=O.dt,
        run_time=run.seconds,
        direction=direction,
        layer_position=run.layers.position,
        layer_displacement=np.array(run.layer_records),
        particle_displacement=particle_displacement,
        balance=None if has_damping else run.balance(settings["fraction"]),
    )


def print_report(path, run, fraction, has_damping):
    """Print the computing time of the run, and its energy balance."""
    balance = run.balance(fraction)
    print(
        f"{path}: {run.steps} steps of {O.dt:.3e} s in {run.seconds:.0f} s; "
        f"energy drift {balance.drift:.1e}, limit {balance.limit:.1e}, "
        f"to friction {balance.friction:.1e}, gap to the work of the wall {balance.gap:.1e}"
    )
    if not (has_damping or balance.closes):
        print(f"{path}: warning: the energy balance does not close; do not trust this run")
    print(f"{path}: {run.watch.report()}")


def main():
    """Send the wave and write its signals; raise InputError for a user's mistake."""
    folder = products_folder()
    case = f"case{table.case:02d}"
    network_path = folder / f"{case}.network.h5"
    modes_path = folder / f"{case}.highest.modes.h5"
    path = folder / f"{case}.signals.h5"
    settings = read_settings()
    direction = read_direction()
    damping = read_damping()
    motion_path = read_text("motion")
    packing = packing_of(network_path)
    sources = (*packing, Source.of("highest modes", modes_path))
    if motion_path:
        sources += (Source.of("motion", motion_path),)
    # Direction and damping are recorded only if they are not those of earlier products, so that
    # these stay current.
    recorded_settings = settings | {"mu_wave": float(table.mu_wave)}
    if direction != "z":
        recorded_settings["direction"] = direction
    if damping:
        recorded_settings["damping"] = " ".join(read_text("damping").split())
    made = Provenance(
        "yade_scripts/wave.py", recorded_settings, sources, versions(yade=config.version)
    )
    if is_product_current(path, made, read_signals):
        return
    motion = Pulse(settings["amplitude"], settings["input_frequency"])
    if motion_path:
        motion = read_motion(motion_path)
    network = read_network(network_path)
    highest_frequency = read_highest_frequency(modes_path, packing)
    build_wave_scene(network, damping)
    duration = settings["duration"]
    if duration is None:
        duration = settings["passage"] * network.length / affine_velocity(network)
    O.dt = settings["fraction"] / (math.pi * highest_frequency)
    run = WaveRun(
        network,
        motion,
        DIRECTIONS.index(direction),
        steps=int(math.ceil(duration / O.dt)) + 1,
        every=max(1, int(settings["interval"] / O.dt)),
        every_particle=settings["particles"] == 1,
    )
    if motion_path and run.quiet_step > run.steps:
        raise InputError(
            "duration",
            "the wall moves beyond the end of the record",
            remedy="take a longer duration",
        )
    run.run(case)
    write_signals(path, make_signals(run, settings, direction, damping is not None), made)
    print_report(path, run, settings["fraction"], damping is not None)


finish(main)
