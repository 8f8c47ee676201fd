"""Run a wave through a YADE scene at rest: drive the wall, record, balance the energy."""

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
from yade_scripts.scene import call_before_motion
from yade_scripts.servo import wall_stresses

CONTACT_CHECKS = 40
"""Number of times in a run that all contacts are checked: few, since a check costs as much as a
step."""
MIN_CORRELATION = -0.5
"""Least correlation of the velocities of two successive steps in a stable run. The correlation of a
mode is the cosine of its change of phase in one step: 0.5 or more for all modes at half the limit
of the time step, and -1 for a mode that grows."""
MAX_AMPLITUDES = 100.0
"""Largest displacement, divided by the amplitude of the wall, in a stable run."""
MIN_AMPLITUDE = 1e-9
"""Least amplitude, m, that `MAX_AMPLITUDES` multiplies: a wall may not move at all."""
UNSTABLE = "the time step is unstable"
"""Text of the reason with which a run is refused."""
LOWER_FRACTION = "lower WAVE_FRACTION"
"""Text of the remedy with which a run is refused."""


class WaveRun:
    """A run of the wave that a motion of the source wall sends along one axis.

    Parameters
    ----------
    network : Network
        Network of the scene, with n particles.
    motion : motion of the wall
        Displacement of the source wall over time.
    axis : int
        0, 1 or 2.
    steps : int
        Number of time steps `O.dt`.
    every : int
        Steps between two records.
    every_particle : bool
        Whether the displacements of all particles are recorded.

    Attributes
    ----------
    chain : ndarray (c,)
        Particles of the chain from wall to wall.
    layers : Layers
        Layers whose mean displacements are recorded.
    records : list
        Rows (4 + c,): time, s, displacement of the wall, m, stresses on source and receiver wall,
        Pa, displacements of the chain, m.
    layer_records, particle_records : list
        Rows of displacements of layers and particles, m.
    quiet_step : int
        First step after the motion of the wall.
    seconds : float
        Computing time of the run.
    """

    def __init__(self, network, motion, axis, *, steps, every, every_particle):
        self.network = network
        self.motion = motion
        self.axis = axis
        self.steps = steps
        self.every = every
        self.every_particle = every_particle
        self.n = network.n_particles
        self.chain = wall_to_wall_chain(network)
        self.layers = Layers(network)
        self.records = []
        self.layer_records = []
        self.particle_records = []
        self.watch = ContactWatch(2 * abs(motion.amplitude))
        # The wall rests from the motion's end on: kinetic plus elastic energy is then constant.
        self.quiet_step = int(math.ceil(motion.corners[-1] / O.dt)) + 2
        self._records_per_check = max(1, steps // every // CONTACT_CHECKS)
        self._states = [O.bodies[k].state for k in range(self.n)]
        self._start = np.array([state.pos[axis] for state in self._states])
        (self._law,) = O.labeledEngine("contacts").lawDispatcher.functors
        self._law.calcEnergy = True
        self._step = 0
        self._is_stable = True
        self._work = 0.0
        self._wall_force = 0.0
        self._energies = []
        self._dissipated = []
        call_before_motion(self._drive)

    def _drive(self):
        """Record the present state, and set the wall's velocity for the next step.

        YADE calls this at each step between computing forces and moving spheres.
        """
        if self._step in (self.quiet_step, self.steps):
            self._elastic_energy = self._compute_stored_energy()
        self.watch.follow()
        now = self._step * O.dt
        displacement, next_displacement = self.motion.displacement(np.array([now, now + O.dt]))
        if now < self.motion.corners[-1] + O.dt:
            self._add_work(now, displacement)
        if self._step % self.every == 0:
            self._record(now, displacement)
        velocity = np.eye(3)[self.axis] * (next_displacement - displacement) / O.dt
        O.bodies[self.n].state.vel = velocity
        self._step += 1

    def run(self, name):
        """Take all steps, with lines of progress under a name.

        Raises InputError if the time step is unstable.
        """
        static_energy = self._compute_stored_energy()
        minute = Minute()
        started = time.perf_counter()
        for target in (self.quiet_step, self.steps):
            while self._step < target and self._is_stable:
                O.step()  # O.run checks only every 40 ms whether its steps are done
                if minute.passed():
                    self._print_progress(name, time.perf_counter() - started)
            if not self._is_stable:
                raise InputError(
                    "unstable_step",
                    f"the wave blew up after {self._step} steps",
                    UNSTABLE,
                    LOWER_FRACTION,
                )
            energy, correlation = self._compute_total_energy()
            self._energies.append(energy - static_energy)
            self._dissipated.append(self.watch.dissipated)
        self.seconds = time.perf_counter() - started
        if not np.isfinite(self.records).all():
            raise InputError("unstable_step", "the wave is not finite", UNSTABLE, LOWER_FRACTION)
        # A step little above the limit feeds modes whose velocities change sign at every step,
        # until friction holds them; neither the chain nor any displacement shows them.
        if not correlation > MIN_CORRELATION:
            raise InputError(
                "unstable_step",
                f"the velocities turn round at every step (correlation {correlation:.2f})",
                UNSTABLE,
                LOWER_FRACTION,
            )

    def _print_progress(self, name, seconds):
        """Print, after some `seconds`, how far the run is and how long it may still take."""
        seconds_left = seconds * (self.steps / self._step - 1)
        print(
            f"{name}: wave, step {self._step} of {self.steps}, {duration(seconds_left)} to go",
            flush=True,
        )

    def balance(self, fraction):
        """Return the run's energy balance; `fraction` is the time step divided by its limit."""
        energy, end_energy = self._energies
        dissipated_before, dissipated = self._dissipated
        slid = len(self.watch.slid)
        limit = math.nan
        if not slid:
            limit = drift_limit(self.network, fraction, self.motion.amplitude, energy)
        return EnergyBalance(
            energy=energy,
            drift=(end_energy - energy) / energy,
            friction=(dissipated - dissipated_before) / energy,
            contacts=len(self.watch.depth),
            opened=len(self.watch.opened),
            slid=slid,
            limit=limit,
            work=self._work,
            gap=(end_energy + dissipated - self._work) / self._work,
        )

    def _add_work(self, now, displacement):
        """Add the work of the wall in the last step.

        The work is computed with the mean of the forces at both ends of the step. In a linear
        system the sum of this work equals the energy of the leapfrog scheme exactly.
        """
        force = O.forces.f(self.n, sync=True)[self.axis]
        displacement_before = self.motion.displacement(np.array([now - O.dt]))[0]
        self._work -= 0.5 * (force + self._wall_force) * (displacement - displacement_before)
        self._wall_force = force

    def _record(self, now, wall_displacement):
        """Add a record at a time, s, and note whether the motion is stable."""
        displacement = np.array([state.pos[self.axis] for state in self._states]) - self._start
        source_stress, receiver_stress = wall_stresses(self.n, self.axis)
        chain_displacement = displacement[self.chain]
        self.records.append(
            (now, wall_displacement, source_stress, receiver_stress, *chain_displacement)
        )
        self.layer_records.append(self.layers.means(displacement))
        if len(self.records) % self._records_per_check == 0:
            self.watch.check_all()
        if self.every_particle:
            self.particle_records.append(displacement)
        limit = MAX_AMPLITUDES * max(abs(self.motion.amplitude), MIN_AMPLITUDE)
        if not abs(chain_displacement[0]) < limit:
            self._is_stable = False

    def _compute_stored_energy(self):
        """Return the energy stored in all contacts, J: 2/5 of N times overlap, and shear energy.

        The shear energy is the sum of the shear forces' work. The expression Fs^2 / (2 ks) is not
        used, because it changes with the overlap, to first order in the wave, without any work.
        """
        return self._law.normElastEnergy() + self._law.shearEnergy

    def _read_scaled_velocities(self):
        """Return velocities (n, 6) half a step ago times the root of mass or inertia, sqrt(J)."""
        rows = []
        for state in self._states:
            sqrt_mass = math.sqrt(state.mass)
            sqrt_inertia = math.sqrt(state.inertia[0])
            rows.append((*state.vel * sqrt_mass, *state.angVel * sqrt_inertia))
        return np.array(rows)

    def _compute_total_energy(self):
        """Return kinetic plus elastic energy, J, and the correlation of successive velocities.

        Velocities are known half a step before and after the positions. Their product is the
        kinetic energy whose sum with the elastic one the leapfrog scheme conserves in a linear
        system.
        """
        before = self._read_scaled_velocities()
        O.step()
        after = self._read_scaled_velocities()
        product = float((before * after).sum())
        correlation = product / float(np.linalg.norm(before) * np.linalg.norm(after))
        return self._elastic_energy + 0.5 * product, correlation
