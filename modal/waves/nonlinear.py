"""Compute waves of finite amplitude: contacts follow their law, slide, open and close.

The spheres of a sample move in the leapfrog steps of `modal.dem`. State k is at time k dt: the
forces are those of the positions x_k and of the source at d(k dt); velocities are half a step
ahead, as in YADE and in `modal.waves.integrators`. The time step is chosen by its error: the scheme
is of second order, so that the difference of two runs whose steps differ by a factor r, divided by
r^2 - 1, is the error of the finer run. Where contacts slide or open the order may be lower; the
reported error is then only an estimate, the last difference divided by r^2 - 1.

The energy is balanced: the work of the source is kinetic energy, energy stored in contacts, or
energy dissipated by slip. With the kinetic energy from the velocities on both sides of a state, and
work by the trapezoidal rule, leapfrog conserves the sum except for the change of stiffness within a
step.
"""

import math
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modal.packing.network import Network
from modal.packing.sample import Sample, sample_of_network
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError, UnavailableError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless
from modal.waves.discs import Disc
from modal.waves.driven_dynamics import DrivenDynamics, DrivenSample
from modal.waves.energy_balance import EnergyBalance, drift_limit
from modal.waves.motions import Motion
from modal.waves.receivers import Receivers
from modal.waves.signals import Direction, Wave, record_times
from modal.waves.sources import Source

NONLINEAR_TOLERANCE = 1e-3
"""Default error of the time step, relative to the largest recorded displacement. The number of
steps grows with the inverse of its root."""
FIRST_STEP_OVER_LIMIT = 0.25
"""Time step of the first run divided by the longest stable one, 2 / omega_max; the second run takes
half of it."""
MAX_REFINEMENTS = 5
"""Largest number of runs after the first one. If five do not suffice, the error does not shrink
with the step, because spheres collide."""
MIN_REFINEMENT = 1.2
MAX_REFINEMENT = 4.0
"""Bounds of the ratio of two successive time steps. Steps must be far enough apart to be compared,
and no finer than a rough estimate of the error justifies."""
TARGET_OVER_TOLERANCE = 0.8
"""Error that the next time step aims at, divided by the tolerance: with less than 1 the tolerance
is rarely exceeded by little."""
OPENING_CHECKS = 40
"""Number of times in a run at which opened contacts are looked for; each costs some steps."""
PRODUCTS_PER_STEP = 2.0
"""Approximate cost of a step in products with K."""


@dataclass(frozen=True, repr=False)
class NonlinearWave(Wave):
    """Result of `modal.propagate` with contacts that follow their law.

    Attributes
    ----------
    signals : Signals
        The recorded signals, with the energy balance, and the slip of all contacts, including those
        that the wave has closed.
    steps : int
        Number of steps of the last run.
    error : float
        Error due to the time step, relative to the largest recorded displacement; NaN for a given
        time step.
    noise : float
        Largest displacement without any motion of the source, relative to the largest recorded
        displacement.
    energy : ndarray (nt, 4)
        Energies, J, at the times of the signals: work of the source, kinetic energy, energy stored
        in contacts beyond the state at rest, energy dissipated by slip.
    dissipated, opened : ndarray (m,) J, ndarray of bool (m,)
        For each contact of the sample's network: energy dissipated by its slip, and whether it
        opened.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 4))
    >>> wave = modal.propagate(crystal, 1e-5, nonlinear=True, friction=0.3)
    >>> wave.energy.shape[1]
    4
    """

    steps: int
    error: float
    noise: float
    energy: Floats
    dissipated: Floats
    opened: Bools

    @property
    def displacements(self) -> Floats:
        """All recorded displacements (nt, k): of the chain, layers, discs and spheres."""
        signals = self.signals
        records = [signals.chain_displacement, signals.layer_displacement]
        if signals.disc_displacement is not None:
            records.append(signals.disc_displacement)
        if signals.particle_displacement is not None:
            records.append(signals.particle_displacement)
        return np.hstack(records)


def sample_at_rest(
    sample: Sample | Network,
    friction: float | None,
    rolling: float | None = None,
    twisting: float | None = None,
) -> Sample:
    """Return the sample at rest from which a non-linear wave starts.

    `friction` and the coefficients of rolling and twisting replace those of a sample. Raises
    InputError for a network without `friction` or with an unknown contact law, for negative
    coefficients, and UnavailableError for a sample in motion.
    """
    start = _with_friction(sample, friction)
    for name, coefficient in (("rolling", rolling), ("twisting", twisting)):
        if coefficient is not None and not 0 <= coefficient < math.inf:
            raise InputError(
                "rolling_or_twisting", f"{name} {coefficient:g}", "must not be negative"
            )
    if rolling is not None:
        start = replace(start, rolling=rolling)
    if twisting is not None:
        start = replace(start, twisting=twisting)
    return start


def _with_friction(sample: Sample | Network, friction: float | None) -> Sample:
    """Return the sample, with `friction` instead of its own if given."""
    if friction is not None and not 0 < friction < math.inf:
        raise InputError("friction", f"friction {friction:g}", "must be positive")
    if isinstance(sample, Network):
        if friction is None:
            raise InputError(
                "no_friction",
                "a network has no friction, which says when its contacts slide",
                remedy="give friction",
            )
        return sample_of_network(sample, friction)
    if sample.body is not None and sample.fixed is not None:
        raise UnavailableError(
            "held_bodies",
            "the non-linear wave of held clumps",
            remedy="free them, or take the linear wave",
        )
    if sample.velocity is not None and sample.velocity.any():
        raise UnavailableError(
            "in_motion",
            "the sample is in motion",
            remedy="bring it to rest first (python -m modal relax)",
        )
    if friction is None:
        return sample
    return replace(sample, friction=friction)


@dataclass
class NonlinearRuns:
    """Runs of one wave through a sample at rest, in time steps of any length.

    The arguments are those of `modal.propagate`. `max_time_step`, s, is the longest stable step of
    the springs at rest; `coarsest` is the number of steps between two records in the first run.
    """

    sample: Sample
    duration: float
    interval: float
    source: Source
    motion: Motion
    direction: Direction
    particles: bool
    discs: Sequence[Disc] = ()

    def __post_init__(self) -> None:
        self.network = self.sample.network()
        self.time = record_times(self.duration, self.interval)
        self.receivers = Receivers(
            self.network, self.direction, particles=self.particles, discs=self.discs
        )
        self.start = DrivenSample(self.sample, self.network, self.source, self.direction)
        self.system = LinearSystem(self.network)
        spectral_bound = self.system.spectral_bound
        self.max_time_step = math.inf
        if spectral_bound > 0:
            self.max_time_step = 2 / math.sqrt(spectral_bound)
        self.coarsest = math.ceil(self.interval / (FIRST_STEP_OVER_LIMIT * self.max_time_step))

    def compute_wave(self, tolerance: float, time_step: float | None) -> NonlinearWave:
        """Compute the wave within the `tolerance`, or in steps of at most `time_step`, s.

        The noise of a sample that is not quite at rest is reported, not subtracted.
        """
        if time_step is None:
            wave = self.refine(tolerance)
        elif 0 < time_step < self.max_time_step:
            # Round-off of a step that divides the interval does not make one step more.
            wave = self.run(math.ceil(self.interval / time_step * (1 - 1e-9)))
        else:
            raise InputError(
                "time_step",
                f"time step {time_step:g} s",
                f"the scheme is stable up to 2 / omega_max = {self.max_time_step:.4g} s",
                "take a smaller one",
            )
        without_source = self.run(self.coarsest, driven=False)
        noise = math.inf
        largest = abs(wave.displacements).max(initial=0.0)
        if largest:
            noise = float(abs(without_source.displacements).max(initial=0.0) / largest)
        return replace(wave, noise=noise)

    def refine(self, tolerance: float) -> NonlinearWave:
        """Run in ever shorter steps until their error, relative to the largest motion, is small.

        Raises UnavailableError if the `tolerance` is not reached.
        """
        steps = self.coarsest
        finer_steps = 2 * self.coarsest
        coarse = self.run(steps)
        for _ in range(MAX_REFINEMENTS):
            fine = self.run(finer_steps)
            error = _step_error(fine, coarse, finer_steps / steps)
            if error <= tolerance:
                return replace(fine, error=error)
            ratio = math.sqrt(error / (TARGET_OVER_TOLERANCE * tolerance))
            steps = finer_steps
            coarse = fine
            finer_steps = math.ceil(steps * min(max(ratio, MIN_REFINEMENT), MAX_REFINEMENT))
        raise UnavailableError(
            "not_converged",
            f"the error of the time step is still {error:.1e} of the motion at "
            f"{self.interval / steps:.3g} s",
            "spheres fly about on paths that no other step repeats",
            "ask for a larger tolerance, a smaller amplitude or a shorter duration, or give a time "
            "step",
        )

    def run(self, steps_per_record: int, *, driven: bool = True) -> NonlinearWave:
        """Run once, with `steps_per_record` steps between records; the source may be undriven."""
        started = clock.perf_counter()
        n_records = len(self.time)
        time_step = self.interval / steps_per_record
        steps = steps_per_record * (n_records - 1)
        # The rows of the receivers read one component of the motion alone.
        reading = self.receivers.rows[:, self.start.component :: 6].tocsr()
        refuse_endless(
            f"a wave of {self.time[-1]:g} s in steps of {time_step:.3g} s",
            self.system.renumbered,
            products=PRODUCTS_PER_STEP * steps,
            bytes_needed=8 * (3 * n_records * reading.shape[0] + steps),
            remedy="take a shorter duration or a larger tolerance",
        )
        source_motion = np.zeros(steps + 1)
        if driven:
            source_motion = self.motion.displacement(time_step * np.arange(steps + 1, dtype=float))
        dynamics = DrivenDynamics(self.start, time_step, source_motion)
        motion = np.empty((n_records, reading.shape[0]))
        forces = np.empty((n_records, 2))
        energy = np.empty((n_records, 4))
        opened = np.zeros(self.network.n_contacts, bool)
        for k in progress(steps + 1, "wave" if driven else "noise"):
            if k % steps_per_record:
                dynamics.step(k)
                continue
            record = k // steps_per_record
            motion[record] = reading @ dynamics.displacement(k)
            velocity_behind = dynamics.velocity.copy()
            dynamics.step(k)
            energy[record] = dynamics.energy(velocity_behind)
            forces[record] = dynamics.wall_forces()
            if record % max(1, n_records // OPENING_CHECKS) == 0 or k == steps:
                opened |= dynamics.contacts.opened_contacts()
        if not np.isfinite(motion).all():
            raise UnavailableError(
                "not_converged", "the wave is not finite", remedy="take a smaller amplitude"
            )
        energy[:, 2] -= energy[0, 2]
        ends, slip_energy, rows = dynamics.contacts.slips()
        body = self.sample.body
        if body is not None:
            ends = np.where(ends < 0, ends, body[np.maximum(ends, 0)])
        in_network = rows >= 0
        dissipated = np.zeros(len(opened))
        dissipated[rows[in_network]] = slip_energy[in_network]
        stresses = []
        columns = []
        if self.start.source_moves:
            stresses.append("source_stress")
            columns.append(0)
        if self.receivers.walls:
            stresses.append("receiver_stress")
            columns.append(1)
        balance = None
        if driven:
            slid = int((dissipated > 0).sum())
            balance = self._balance(energy, time_step, slid, opened)
        signals = self.receivers.signals(
            self.time,
            np.hstack([(forces - forces[0])[:, columns], motion]),
            self.motion,
            self.source,
            stresses,
            producer="nonlinear",
            time_step=time_step,
            run_time=clock.perf_counter() - started,
            balance=balance,
            slip_ends=ends,
            slip_energy=slip_energy,
        )
        return NonlinearWave(signals, steps, math.nan, math.nan, energy, dissipated, opened)

    def _balance(
        self, energy: Floats, time_step: float, slid: int, opened: Bools
    ) -> EnergyBalance | None:
        """Return the energy balance from the end of the source's motion on.

        The result is None if the record ends before the motion of the source does. `slid` is the
        number of contacts that slid.
        """
        start = int(np.searchsorted(self.time, self.motion.corners[-1]))
        if start >= len(self.time) - 1:
            return None
        work, kinetic, stored, dissipated = energy.T
        elastic = kinetic + stored
        # How far a force compresses contacts is not known beforehand: any share of their overlap.
        amplitude = math.inf
        if self.start.source_moves:
            amplitude = self.motion.amplitude
        limit = math.nan
        if not slid:
            fraction = time_step / self.max_time_step
            limit = float(drift_limit(self.network, fraction, amplitude, elastic[start]))
        start_energy = elastic[start]
        end_energy = elastic[-1]
        dissipated_after = dissipated[-1] - dissipated[start]
        total_work = work[-1]
        gap = end_energy + dissipated[-1] - total_work
        return EnergyBalance(
            energy=float(start_energy),
            drift=float(end_energy / start_energy - 1),
            friction=float(dissipated_after / start_energy),
            contacts=len(opened),
            opened=int(opened.sum()),
            slid=slid,
            limit=limit,
            work=float(total_work),
            gap=float(gap / abs(total_work)),
        )


def _step_error(fine: NonlinearWave, coarse: NonlinearWave, ratio: float) -> float:
    """Return the error of the finer of two runs, relative to the largest motion.

    `ratio` is the number of steps of the finer run divided by that of the coarser.
    """
    largest = abs(fine.displacements).max(initial=0.0)
    if not largest:
        return 0.0
    difference = abs(fine.displacements - coarse.displacements).max(initial=0.0)
    return float(difference / largest / (ratio**2 - 1))
