"""One wave through a scene at rest: the source wall's motion, the records, the energy's books."""

import math
import time

import numpy as np
from yade import O

from modal.packing.chain import wall_to_wall_chain
from modal.packing.layers import Layers
from modal.tools.display import duration
from modal.tools.errors import InputError
from modal.tools.progress import Minute
from modal.waves.energy_balance import EnergyBalance, drift_limit
from yade_scripts.contact_watch import ContactWatch
from yade_scripts.scene import before_motion
from yade_scripts.servo import wall_stresses

LOOKS = 40
"""Looks at all contacts in a run: which have opened or formed. Few, since a look costs a step."""
TURNING_ROUND = -0.5
"""Correlation of the velocities of two steps: the cosine of what a mode turns in a step, 0.5 or
more for all modes at half the limit, and -1 for a mode that grows."""
BLOW_UP = 100.0
"""A displacement of so many amplitudes is no wave but an unstable time step."""


class WaveRun:
    """The motion of the source wall along one axis, and what comes of it.

    `network` is that of the scene, with n particles; `motion` is that of the wall, along `axis`, 0,
    1 or 2. The run takes `steps` of O.dt and records `every` so many of
    them, with `every_particle` the displacements of all particles. After `go`, as lists of rows:
    records (k, 4 + c) have time, s, the wall's displacement, m, the stresses on both walls, Pa, and
    the displacements of the `chain` (c,), m; layer_records and particle_records have those of
    `layers` and particles. `seconds` is what the run took.
    """

    def __init__(self, network, motion, axis, *, steps, every, every_particle):
        self.network, self.motion, self.axis = network, motion, axis
        self.steps, self.every, self.every_particle = steps, every, every_particle
        self.n = network.n_particles
        self.chain, self.layers = wall_to_wall_chain(network), Layers(network)
        self.records, self.layer_records, self.particle_records = [], [], []
        self.watch = ContactWatch(2 * abs(motion.amplitude))
        # The wall rests from the motion's end on: kinetic plus elastic energy is then constant.
        self.quiet = int(math.ceil(motion.corners[-1] / O.dt)) + 2
        self._look_every = max(1, steps // every // LOOKS)
        self._states = [O.bodies[k].state for k in range(self.n)]
        self._start = np.array([state.pos[axis] for state in self._states])
        (self._law,) = O.labeledEngine("contacts").lawDispatcher.functors
        self._law.calcEnergy = True
        self._step, self._stable = 0, True
        self._work = self._wall_force = 0.0
        self._books, self._dissipated = [], []
        before_motion(self._drive)

    def _drive(self):
        """Between forces and motion: record state k, then send the wall to its place k + 1."""
        if self._step in (self.quiet, self.steps):
            self._elastic_energy = self._stored_energy()
        self.watch.follow()
        now = self._step * O.dt
        here, there = self.motion.displacement(np.array([now, now + O.dt]))
        if now < self.motion.corners[-1] + O.dt:
            self._add_work(now, here)
        if self._step % self.every == 0:
            self._record(now, here)
        O.bodies[self.n].state.vel = np.eye(3)[self.axis] * (there - here) / O.dt
        self._step += 1

    def go(self, name):
        """Take all steps; InputError where the time step is unstable. `name` is for the log."""
        static, minute, started = self._stored_energy(), Minute(), time.perf_counter()
        for target in (self.quiet, self.steps):
            while self._step < target and self._stable:
                O.step()  # O.run looks only every 40 ms whether its steps are done
                if minute.passed():
                    left = (time.perf_counter() - started) * (self.steps / self._step - 1)
                    to_go = f"{self._step} of {self.steps}, {duration(left)} to go"
                    print(f"{name}: wave, step {to_go}", flush=True)
            if not self._stable:
                raise InputError(
                    "input",
                    f"the wave blew up after {self._step} steps",
                    "the time step is unstable, lower WAVE_FRACTION",
                )
            total, correlation = self._total_energy()
            self._books.append(total - static)
            self._dissipated.append(self.watch.dissipated)
        self.seconds = time.perf_counter() - started
        if not np.isfinite(self.records).all():
            raise InputError(
                "input",
                "the wave is not finite",
                remedy="the time step is unstable, lower WAVE_FRACTION",
            )
        # A step little above the limit feeds modes that turn round at every step, until friction
        # holds them; the chain hardly shows them, and no displacement gives them away.
        if not correlation > TURNING_ROUND:
            raise InputError(
                "input",
                f"the velocities turn round at every step (correlation {correlation:.2f})",
                "the time step is unstable, lower WAVE_FRACTION",
            )

    def balance(self, fraction):
        """What became of the wall's work; `fraction` is that of the time step's limit."""
        energy, end = self._books
        lost = self._dissipated[1] - self._dissipated[0]
        slid = len(self.watch.slid)
        size = self.motion.amplitude
        limit = math.nan if slid else drift_limit(self.network, fraction, size, energy)
        return EnergyBalance(
            energy=energy,
            drift=(end - energy) / energy,
            friction=lost / energy,
            contacts=len(self.watch.depth),
            opened=len(self.watch.opened),
            slid=slid,
            limit=limit,
            work=self._work,
            gap=(end + self._dissipated[1] - self._work) / self._work,
        )

    def _add_work(self, now, here):
        # The mean of the forces at both ends of a step: exact in a linear system, as the energy is.
        force = O.forces.f(self.n, sync=True)[self.axis]
        before = self.motion.displacement(np.array([now - O.dt]))[0]
        self._work -= 0.5 * (force + self._wall_force) * (here - before)
        self._wall_force = force

    def _record(self, now, here):
        moved = np.array([state.pos[self.axis] for state in self._states]) - self._start
        stresses = wall_stresses(self.n, self.axis)
        self.records.append((now, here, *stresses, *moved[self.chain]))
        self.layer_records.append(self.layers.means(moved))
        if len(self.records) % self._look_every == 0:
            self.watch.look()
        if self.every_particle:
            self.particle_records.append(moved)
        if not abs(moved[self.chain[0]]) < BLOW_UP * max(abs(self.motion.amplitude), 1e-9):
            self._stable = False

    def _stored_energy(self):
        """Energy stored in all contacts, J: 2/5 of N times overlap, and the shear forces' work.

        Fs^2 / 2 ks would change with the overlap, to first order in the wave, without any work
        done.
        """
        return self._law.normElastEnergy() + self._law.shearEnergy

    def _momenta(self):
        """Velocities (n, 6) at the half step behind, times the root of each sphere's inertia."""
        roots = ((s, math.sqrt(s.mass), math.sqrt(s.inertia[0])) for s in self._states)
        return np.array([(*s.vel * mass, *s.angVel * inertia) for s, mass, inertia in roots])

    def _total_energy(self):
        """Kinetic plus elastic energy at the present positions, J, and how velocities correlate.

        Velocities live half a step off; the product of those behind and ahead is the kinetic energy
        whose sum with the elastic one the leapfrog scheme conserves in a linear system.
        """
        behind = self._momenta()
        O.step()
        ahead = self._momenta()
        product = float((behind * ahead).sum())
        correlation = product / float(np.linalg.norm(behind) * np.linalg.norm(ahead))
        return self._elastic_energy + 0.5 * product, correlation
