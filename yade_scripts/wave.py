"""Wave through a case's sample: the source wall moves by one pulse; caseNN.signals.h5.

    yade -n -x -j1 yade_scripts/wave.py                  (case 2)
    yade-batch cases/fcc.table yade_scripts/wave.py

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
import time
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, config
from yade.utils import PyRunner, readParamsFromTable

from modal.formats.hdf5 import InputError
from modal.formats.provenance import (
    Provenance,
    Source,
    is_current,
    packing_of,
    read_provenance,
    require_same_packing,
    set_aside,
    versions,
)
from modal.modes.mode_set import read_modes
from modal.packing.affine import affine_velocity
from modal.packing.layers import Layers
from modal.packing.network_file import read_network
from modal.packing.sample import sample_of_network
from modal.progress import time_left
from modal.stiffness.damping import ContactDamping
from modal.waves.chain import wall_to_wall_chain
from modal.waves.energy_balance import EnergyBalance, drift_limit
from modal.waves.signals import DIRECTIONS, Signals, read_signals, write_signals
from modal.waves.source import Pulse, read_motion
from yade_scripts.contact_watch import ContactWatch
from yade_scripts.scene import Report, finish, products_folder
from yade_scripts.state import build_scene

RECORDING_INTERVAL = 5e-7
"""Longest interval between records, s, by default: five samples a period at 400 kHz."""
LOOKS = 40
"""Looks at all contacts in a run: which have opened or formed. Few, since a look costs a step."""
TURNING_ROUND = -0.5
"""Correlation of the velocities of two steps: the cosine of what a mode turns in a step, 0.5 or
more for all modes at half the limit, and -1 for a mode that grows."""
BLOW_UP = 100.0
"""A displacement of so many amplitudes is no wave but an unstable time step."""

readParamsFromTable(
    noTableOk=True,
    case=2,
    mu_wave=0.1,
    input_frequency=1e5,
    fraction=0.05,
    passage=1.0,
    amplitude=2.5e-9,
    duration=None,
    interval=RECORDING_INTERVAL,
    particles=0,
    direction="z",
    damping="",
    motion="",
    # Columns of the tables that the sample has used.
    mu_comp=0.0,
    stress=1e5,
    width=4,
    layers=200,
    unknownOk=True,
)
from yade.params import table  # noqa: E402


def setting(name):
    """A number from the environment (WAVE_NAME), or from the table."""
    value = os.environ.get(f"WAVE_{name.upper()}", getattr(table, name))
    try:
        return None if value is None else float(value)
    except ValueError:
        raise InputError(f"{name} {value!r}: not a number") from None


def dashpots_of(ratios):
    """Damping of the contacts from two texts; InputError where they are no ratios."""
    try:
        normal, tangential = (float(ratio) for ratio in ratios)
    except ValueError:
        raise InputError(f"damping {' '.join(ratios)!r}: give two numbers") from None
    return ContactDamping(normal, tangential)


def momenta():
    """Velocities (n, 6) of all spheres at the half step behind, times the root of their inertia."""
    states = [O.bodies[k].state for k in range(n)]
    rows = [(*s.vel * math.sqrt(s.mass), *s.angVel * math.sqrt(s.inertia[0])) for s in states]
    return np.array(rows)


def elastic_energy():
    """Energy stored in all contacts, J: 2/5 of N times overlap, and the work of the shear forces.

    Fs^2 / 2 ks would change with the overlap, to first order in the wave, without any work done.
    """
    return law.normElastEnergy() + law.shearEnergy


def total_energy():
    """Kinetic plus elastic energy at the present positions, J.

    Velocities live half a step off; the product of those behind and ahead is the kinetic energy
    whose sum with the elastic one the leapfrog scheme conserves in a linear system.
    """
    global correlation
    behind = momenta()
    O.run(1, wait=True)
    ahead = momenta()
    product = float((behind * ahead).sum())
    correlation = product / float(np.linalg.norm(behind) * np.linalg.norm(ahead))
    return elastic_energy_of_step + 0.5 * product


def wall_stress(wall):
    """Stress on a wall along the direction of the wave, Pa; of a P-wave its pressure."""
    return -O.forces.f(wall, sync=True)[axis] / area * (1 if wall == n else -1)


def drive():
    """Between forces and motion: record state k, then send the wall to its place k + 1."""
    global step, stable, elastic_energy_of_step, work, wall_force
    if step in balance_steps:
        elastic_energy_of_step = elastic_energy()
    watch.follow()
    now = step * O.dt
    here, there = motion.displacement(np.array([now, now + O.dt]))
    if now < motion.corners[-1] + O.dt:
        # The mean of the forces at both ends of a step: exact in a linear system, as the energy is.
        force = O.forces.f(n, sync=True)[axis]
        before = motion.displacement(np.array([now - O.dt]))[0]
        work -= 0.5 * (force + wall_force) * (here - before)
        wall_force = force
    if step % every == 0:
        moved = np.array([state.pos[axis] for state in states]) - start
        records.append((now, here, wall_stress(n), wall_stress(n + 1), *moved[chain]))
        layer_records.append(layers.means(moved))
        if len(records) % look_every == 0:
            watch.look()
        if every_particle:
            particle_records.append(moved)
        if not abs(moved[chain[0]]) < BLOW_UP * max(abs(amplitude), 1e-9):
            O.pause()
            stable = False
    O.bodies[n].state.vel = np.eye(3)[axis] * (there - here) / O.dt
    step += 1


def highest_frequency(path, packing):
    """Frequency, Hz, of the highest mode of this very packing; InputError for other modes."""
    note = require_same_packing(path, packing)
    if note:
        print(note)
    asked = read_provenance(path).settings
    if asked is not None and not {"highest", "all"} & asked.keys():
        raise InputError(f"{path}: not the highest modes; make them with modal modes --highest 1")
    return read_modes(path).frequency[-1]


def main():
    """Load, run, write; InputError for what the user can mend."""
    global n, area, step, every, records, layer_records, particle_records
    global chain, layers, states, start, watch, look_every, law, axis, motion
    global balance_steps, stable, amplitude, input_frequency, every_particle, work, wall_force
    folder, case = products_folder(), f"case{table.case:02d}"
    network_path = folder / f"{case}.network.h5"
    modes_path = folder / f"{case}.highest.modes.h5"
    path = folder / f"{case}.signals.h5"
    names = ("fraction", "amplitude", "input_frequency", "duration", "interval", "particles")
    settings = {name: setting(name) for name in (*names, "passage")}
    direction = os.environ.get("WAVE_DIRECTION", table.direction)
    if direction not in DIRECTIONS:
        raise InputError(f"direction {direction!r}: choose x, y or z")
    axis = DIRECTIONS.index(direction)
    # Said where it is not what earlier products had, so that these stay current.
    settings |= {} if direction == "z" else {"direction": direction}
    ratios = os.environ.get("WAVE_DAMPING", str(table.damping)).split()
    damped = dashpots_of(ratios) if ratios else None
    settings |= {"damping": " ".join(ratios)} if ratios else {}
    packing = packing_of(network_path)
    sources = (*packing, Source.of("highest modes", modes_path))
    file = os.environ.get("WAVE_MOTION", table.motion)
    sources += (Source.of("motion", file),) if file else ()
    made = Provenance(
        "yade_scripts/wave.py",
        settings | {"mu_wave": float(table.mu_wave)},
        sources,
        versions(yade=config.version),
    )
    if is_current(path, made, read=read_signals):
        print(f"{path}: already there")
        return
    set_aside(path)
    fraction, amplitude, input_frequency = (settings[name] for name in names[:3])
    motion = read_motion(file) if file else Pulse(amplitude, input_frequency)
    if file:
        amplitude, input_frequency = motion.amplitude, motion.frequency
    every_particle = settings["particles"] == 1
    if not 0 < fraction <= 1:
        raise InputError(f"WAVE_FRACTION {fraction}: the time step is stable from 0 to 1 only")
    network = read_network(network_path)
    highest = highest_frequency(modes_path, packing)
    build_scene(sample_of_network(network, table.mu_wave), margin=0.01, damping=0.0)
    (law,) = O.engines[2].lawDispatcher.functors
    law.calcEnergy = True
    if damped:
        for contact in O.interactions:
            contact.phys.betan, contact.phys.betas = damped.normal, damped.tangential
    # Over a wave nobody moves by a millionth of a radius: the collider may sleep.
    O.engines[1].dead = True
    n, area = network.n_particles, network.area
    arrival = settings["passage"] * network.length / affine_velocity(network)
    duration = arrival if settings["duration"] is None else settings["duration"]
    O.dt = fraction / (math.pi * highest)
    every = max(1, int(settings["interval"] / O.dt))
    chain, layers = wall_to_wall_chain(network), Layers(network)
    states = [O.bodies[k].state for k in range(n)]
    start = np.array([state.pos[axis] for state in states])
    records, layer_records, particle_records, step, stable = [], [], [], 0, True
    work, wall_force = 0.0, 0.0
    watch = ContactWatch(2 * abs(amplitude))
    O.engines = [*O.engines[:3], PyRunner(command="drive()", iterPeriod=1), O.engines[3]]
    steps = int(math.ceil(duration / O.dt)) + 1
    look_every = max(1, steps // every // LOOKS)
    static = elastic_energy()
    started = time.perf_counter()
    books, dissipated, report = [], [], Report()
    # The wall rests from 1/f on: kinetic plus elastic energy is then constant.
    quiet = int(math.ceil(motion.corners[-1] / O.dt)) + 2
    if file and quiet > steps:
        raise InputError("the wall moves beyond the end of the record; take a longer duration")
    balance_steps = {quiet, steps}
    for target in (quiet, steps):
        while step < target and stable:
            O.run(min(200, target - step), wait=True)
            left = (time.perf_counter() - started) * (steps / max(step, 1) - 1)
            report(f"{case}: wave, step {step} of {steps}, {time_left(left)} to go")
        if not stable:
            raise InputError(
                f"the wave blew up after {step} steps: the time step is unstable, "
                "lower WAVE_FRACTION"
            )
        books.append(total_energy() - static)
        dissipated.append(watch.dissipated)
    seconds = time.perf_counter() - started
    recorded = np.array(records)
    if not np.isfinite(recorded).all():
        raise InputError("the wave is not finite; the time step is unstable, lower WAVE_FRACTION")
    # A step little above the limit feeds modes that turn round at every step, until friction holds
    # them; the chain hardly shows them, and no displacement gives them away.
    if not correlation > TURNING_ROUND:
        raise InputError(
            f"the velocities turn round at every step (correlation {correlation:.2f}): the time "
            "step is unstable, lower WAVE_FRACTION"
        )
    lost = dissipated[1] - dissipated[0]
    slid = len(watch.slid)
    limit = math.nan if slid else drift_limit(network, fraction, amplitude, books[0])
    balance = EnergyBalance(
        energy=books[0],
        drift=(books[1] - books[0]) / books[0],
        friction=lost / books[0],
        contacts=len(watch.depth),
        opened=len(watch.opened),
        slid=slid,
        limit=limit,
        work=work,
        gap=(books[1] + dissipated[1] - work) / work,
    )
    signals = Signals(
        time=recorded[:, 0],
        chain_particle=chain,
        chain_position=network.position[chain, 2],
        chain_displacement=recorded[:, 4:],
        source_displacement=recorded[:, 1],
        source_stress=recorded[:, 2] - recorded[0, 2],
        receiver_stress=recorded[:, 3] - recorded[0, 3],
        producer="yade",
        case=str(table.case),
        amplitude=amplitude,
        input_frequency=input_frequency,
        time_step=O.dt,
        run_time=seconds,
        network_sha256=packing[0].sha256,
        direction=direction,
        layer_position=layers.position,
        layer_displacement=np.array(layer_records),
        particle_displacement=np.array(particle_records) if every_particle else None,
        balance=None if damped else balance,
    )
    write_signals(path, signals, made)
    print(
        f"\r{path}: {steps} steps of {O.dt:.3e} s in {seconds:.0f} s; "
        f"energy drift {balance.drift:.1e}, limit {limit:.1e}, to friction {balance.friction:.1e}, "
        f"gap to the work of the wall {balance.gap:.1e}"
    )
    if not (damped or balance.kept):
        print(f"{path}: warning: the energy books do not close; do not trust this run")
    print(f"{path}: {watch.report()}")


finish(main)
