"""Wave through a case's sample: the source wall moves by one pulse; caseNN.signals.h5.

    yade -n -x -j1 yade_scripts/wave.py                  (case 2)
    yade-batch own.table yade_scripts/wave.py

Needs caseNN.network.h5 and caseNN.highest.modes.h5: the time step is `fraction` of 2 / omega_max,
the exact limit of the leapfrog scheme. Columns of the table, or environment variables WAVE_FRACTION
and so on, which override them: fraction, amplitude (m; negative reverses the wall), duration (s;
default until the wave front has made `passage` passages to the receiver wall), interval (s; longest
between two records), particles (1 records every particle, not only chain and layers), direction (x
or y: the wall slides and sends an S-wave), damping ("0.05 0.03": dashpots of the contacts, normal
and tangential, in parts of the critical; such a run has no energy book), motion (a file of two
columns, s and m: how the wall moves in the place of the pulse). All are recorded in the product;
signals that were made with others, or of other files, are stale and made again. WAVE_PRODUCTS names
the folder.
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
from yade_scripts.scene import already_there, finish, products_folder
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


def text(name):
    """A setting from the environment (WAVE_NAME), or from the table; empty where it is absent."""
    value = os.environ.get(f"WAVE_{name.upper()}", getattr(table, name))
    return "" if value is None else str(value)


def numbers(name, count=1):
    """What a setting says, some of which may be absent; InputError unless it is so many numbers."""
    try:
        found = [float(word) for word in text(name).split()]
    except ValueError:
        found = [math.nan]
    absent = not found and name in ("duration", "damping")
    if not absent and (len(found) != count or math.isnan(sum(found))):
        raise InputError(
            "input", f"{name} {text(name)!r}", remedy=f"give {count} number{'s' * (count > 1)}"
        )
    return found


def refuse_senseless(settings):
    """Raise InputError for numbers that no wave can be run with."""
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


def highest_frequency(path, packing):
    """Frequency, Hz, of the highest mode of this very packing; InputError for other modes."""
    note = require_same_packing(path, packing)
    if note:
        print(note)
    asked = read_provenance(path).settings
    if asked is not None and not {"highest", "all"} & asked.keys():
        raise InputError(
            "input",
            f"{path}: not the highest modes",
            remedy="make them with python -m modal modes --highest 1",
        )
    return read_modes(path).frequency[-1]


def main():
    """Load, run, write; InputError for what the user can mend."""
    folder, case = products_folder(), f"case{table.case:02d}"
    kinds = "network", "highest.modes", "signals"
    network_path, modes_path, path = (folder / f"{case}.{kind}.h5" for kind in kinds)
    names = "fraction", "amplitude", "input_frequency", "duration", "interval", "particles"
    settings = {name: next(iter(numbers(name)), None) for name in (*names, "passage")}
    refuse_senseless(settings)
    direction = text("direction")
    if direction not in DIRECTIONS:
        raise InputError("input", f"direction {direction!r}", remedy="choose x, y or z")
    # Said where it is not what earlier products had, so that these stay current.
    settings |= {} if direction == "z" else {"direction": direction}
    ratios = numbers("damping", 2)
    damped = ContactDamping(*ratios) if ratios else None
    settings |= {"damping": " ".join(text("damping").split())} if ratios else {}
    packing = packing_of(network_path)
    sources = (*packing, Source.of("highest modes", modes_path))
    file = text("motion")
    sources += (Source.of("motion", file),) if file else ()
    made = Provenance(
        "yade_scripts/wave.py",
        settings | {"mu_wave": float(table.mu_wave)},
        sources,
        versions(yade=config.version),
    )
    if already_there(path, made, read_signals):
        return
    fraction, amplitude, input_frequency = (settings[name] for name in names[:3])
    motion = read_motion(file) if file else Pulse(amplitude, input_frequency)
    network = read_network(network_path)
    highest = highest_frequency(modes_path, packing)
    build_scene(sample_of_network(network, table.mu_wave), margin=0.01, damping=0.0)
    if damped:
        for contact in O.interactions:
            contact.phys.betan, contact.phys.betas = damped.normal, damped.tangential
    # Over a wave nobody moves by a millionth of a radius: the collider may sleep.
    O.labeledEngine("collider").dead = True
    arrival = settings["passage"] * network.length / affine_velocity(network)
    duration = arrival if settings["duration"] is None else settings["duration"]
    O.dt = fraction / (math.pi * highest)
    every_particle = settings["particles"] == 1
    run = WaveRun(
        network,
        motion,
        DIRECTIONS.index(direction),
        steps=int(math.ceil(duration / O.dt)) + 1,
        every=max(1, int(settings["interval"] / O.dt)),
        every_particle=every_particle,
    )
    if file and run.quiet > run.steps:
        raise InputError(
            "input", "the wall moves beyond the end of the record", remedy="take a longer duration"
        )
    run.go(case)
    balance, recorded = run.balance(fraction), np.array(run.records)
    signals = Signals(
        time=recorded[:, 0],
        chain_particle=run.chain,
        chain_position=network.position[run.chain, 2],
        chain_displacement=recorded[:, 4:],
        source_displacement=recorded[:, 1],
        source_stress=recorded[:, 2] - recorded[0, 2],
        receiver_stress=recorded[:, 3] - recorded[0, 3],
        producer="yade",
        case=str(table.case),
        amplitude=motion.amplitude,
        input_frequency=motion.frequency,
        time_step=O.dt,
        run_time=run.seconds,
        direction=direction,
        layer_position=run.layers.position,
        layer_displacement=np.array(run.layer_records),
        particle_displacement=np.array(run.particle_records) if every_particle else None,
        balance=None if damped else balance,
    )
    write_signals(path, signals, made)
    print(
        f"{path}: {run.steps} steps of {O.dt:.3e} s in {run.seconds:.0f} s; "
        f"energy drift {balance.drift:.1e}, limit {balance.limit:.1e}, "
        f"to friction {balance.friction:.1e}, gap to the work of the wall {balance.gap:.1e}"
    )
    if not (damped or balance.closes):
        print(f"{path}: warning: the energy books do not close; do not trust this run")
    print(f"{path}: {run.watch.report()}")


finish(main)
