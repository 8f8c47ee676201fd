"""P-wave in an FCC case: the source wall moves by one pulse; writes products/caseNN.signals.h5.

    yade -n -x -j1 yade_scripts/wave.py                  (case 2)
    yade-batch cases/fcc.table yade_scripts/wave.py

Needs caseNN.network.h5 and caseNN.highest.modes.h5: the time step is `fraction` of 2 / omega_max,
the exact limit of the leapfrog scheme. Environment: WAVE_PRODUCTS, WAVE_FRACTION, WAVE_AMPLITUDE,
WAVE_DURATION (s; default until the wave front reaches the receiver wall).
"""

import math
import os
import sys
import time
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O
from yade.utils import PyRunner, readParamsFromTable

from modal.mode_set import read_modes
from modal.network import read_network
from modal.signals import Signals, read_signals, source_pulse, write_signals
from modal.storage import InputError, sha256
from yade_scripts.scene import ROOT, find_contacts, place_fcc

RECORDING_INTERVAL = 5e-7
"""Longest interval between records, s: five samples a period at 400 kHz."""
BLOW_UP = 100.0
"""A displacement of so many amplitudes is no wave but an unstable time step."""

readParamsFromTable(
    noTableOk=True,
    case=2,
    mu_comp=0.0,
    mu_wave=0.1,
    stress=1e5,
    input_frequency=1e5,
    width=4,
    layers=200,
)
from yade.params.table import case, input_frequency, layers, mu_wave, stress, width  # noqa: E402

folder = Path(os.environ.get("WAVE_PRODUCTS", ROOT / "products"))
amplitude = float(os.environ.get("WAVE_AMPLITUDE", 2.5e-9))
fraction = float(os.environ.get("WAVE_FRACTION", 0.05))


def momenta():
    """Velocities (n, 6) of all spheres at the half step behind, times the root of their inertia."""
    states = [O.bodies[k].state for k in range(sizes["n"])]
    rows = [(*s.vel * math.sqrt(s.mass), *s.angVel * math.sqrt(s.inertia[0])) for s in states]
    return np.array(rows)


def elastic_energy():
    """Elastic energy of all contacts, J: 2/5 of N times overlap, and half Fs^2 / ks."""
    total = 0.0
    for contact in O.interactions:
        if contact.isReal:
            phys = contact.phys
            total += 0.4 * phys.normalForce.norm() * contact.geom.penetrationDepth
            total += 0.5 * phys.shearForce.squaredNorm() / phys.ks
    return total


def total_energy():
    """Kinetic plus elastic energy at the present positions, J.

    Velocities live half a step off; the product of those behind and ahead is the kinetic energy
    whose sum with the elastic one the leapfrog scheme conserves in a linear system.
    """
    behind = momenta()
    O.run(1, wait=True)
    return elastic_energy_of_step + 0.5 * float((behind * momenta()).sum())


def drive():
    """Between forces and motion: record state k, then send the wall to its place k + 1."""
    global step, stable, elastic_energy_of_step
    if step in balance_steps:
        elastic_energy_of_step = elastic_energy()
    k, now = step, step * O.dt
    here, there = source_pulse(np.array([now, now + O.dt]), amplitude, input_frequency)
    source = -O.forces.f(sizes["n"], sync=True)[2] / sizes["area"]
    receiver = O.forces.f(sizes["n"] + 1, sync=True)[2] / sizes["area"]
    if k % every == 0:
        motion = [state.pos[2] for state in chain_states]
        records.append((now, here, source, receiver, *motion))
        if not abs(motion[0] - start[0]) < BLOW_UP * amplitude:
            O.pause()
            stable = False
    O.bodies[sizes["n"]].state.vel = (0, 0, (there - here) / O.dt)
    step += 1


def run():
    """Load, run, write; InputError for what the user can mend."""
    global sizes, step, every, records, chain_states, start, balance_steps, stable
    network_path = folder / f"case{case:02d}.network.h5"
    path = folder / f"case{case:02d}.signals.h5"
    if path.exists():
        try:
            if read_signals(path).network_sha256 == sha256(network_path):
                print(f"{path}: already there")
                return
        except InputError as error:
            print(f"{error}; making it again")
    network = read_network(network_path)
    highest = read_modes(folder / f"case{case:02d}.highest.modes.h5").frequency[-1]
    if not 0 < fraction <= 1:
        raise InputError(f"WAVE_FRACTION {fraction}: the time step is stable from 0 to 1 only")
    sizes = place_fcc(width, layers, stress, mu_wave)
    if sizes["n"] != network.n_particles:
        raise InputError(f"{network_path}: {network.n_particles} spheres, not {sizes['n']}")
    find_contacts(sizes)
    pair = ~network.with_wall
    C = 2 * (network.stiffness_normal[pair].mean() + network.stiffness_tangential[pair].mean())
    layer = sizes["length"] / layers
    arrival = sizes["length"] / (layer * math.sqrt(C / network.mass[0]))
    duration = float(os.environ.get("WAVE_DURATION", arrival))
    O.dt = fraction / (math.pi * highest)
    every = max(1, int(RECORDING_INTERVAL / O.dt))
    # One line of spheres: the same column of every second layer.
    chain = np.arange(layers) * width * width + (width // 2) * (width + 1)
    chain_states = [O.bodies[int(k)].state for k in chain]
    start = np.array([state.pos[2] for state in chain_states])
    records, step, stable = [], 0, True
    O.engines = [*O.engines[:3], PyRunner(command="drive()", iterPeriod=1), O.engines[3]]
    steps = int(math.ceil(duration / O.dt)) + 1
    static = elastic_energy()
    started = time.perf_counter()
    books = []
    # The wall rests from 1/f on: kinetic plus elastic energy is then constant.
    quiet = int(math.ceil(1 / (input_frequency * O.dt))) + 2
    balance_steps = {quiet, steps}
    for target in (quiet, steps):
        while step < target and stable:
            O.run(min(200, target - step), wait=True)
        if not stable:
            raise InputError(
                f"the wave blew up after {step} steps: the time step is unstable, "
                "lower WAVE_FRACTION"
            )
        books.append(total_energy() - static)
    seconds = time.perf_counter() - started
    table = np.array(records)
    if not np.isfinite(table).all():
        raise InputError("the wave is not finite; the time step is unstable, lower WAVE_FRACTION")
    drift = abs(books[1] - books[0]) / books[0]
    signals = Signals(
        time=table[:, 0],
        chain_particle=chain,
        chain_position=start,
        chain_displacement=table[:, 4:] - start,
        source_displacement=table[:, 1],
        source_stress=table[:, 2] - table[0, 2],
        receiver_stress=table[:, 3] - table[0, 3],
        producer="yade",
        case=str(case),
        amplitude=amplitude,
        input_frequency=float(input_frequency),
        time_step=O.dt,
        run_time=seconds,
        network_sha256=sha256(network_path),
    )
    write_signals(path, signals)
    print(f"{path}: {step} steps of {O.dt:.3e} s in {seconds:.0f} s; energy drift {drift:.1e}")


def main():
    """Exit status: 0, or 2 with one line for a user's mistake."""
    try:
        run()
    except (InputError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


status = main()
sys.stdout.flush()
os._exit(status)  # YADE's own exit would turn every status into 0.
