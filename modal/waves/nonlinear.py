"""The wave at finite amplitude: contacts that follow their law, slide, open and close.

The spheres of a sample move in the leapfrog steps of `modal.dem`. State k is at time k dt: forces
of the positions x_k and of the source at d(k dt), velocities half a step ahead, as in YADE and
in `modal.waves.integrators`. The step follows from the error that it makes: the scheme is of second
order, so two runs whose steps differ by a factor r tell the error of the finer one, their
difference over r^2 - 1. Where contacts slide or open the order may be lower; then the last
difference is all that is known, and it is told.

Sources are those of the linear wave: the source wall, a plane between spheres that opens, a sphere
that a force pushes or a torque turns. A wall that twists turns about z as a body, and with a plane
all that lies below it, which moves in the frame that turns.

The energy is booked: what the source has given is kinetic, or stored in contacts, or
dissipated by slip. With the kinetic energy from the velocities on both sides of a state, and works
by the trapezoidal rule, leapfrog keeps that sum but for the change of stiffness within a step.
"""

import math
import time as clock
from dataclasses import dataclass, replace

import numpy as np

from modal.packing.network import Network
from modal.packing.sample import Sample, sample_of_network
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError, UnavailableError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless
from modal.waves.energy_balance import EnergyBalance, drift_limit
from modal.waves.motions import Motion
from modal.waves.receivers import Receivers
from modal.waves.signals import COMPONENT, TORSION, Wave, record_times
from modal.waves.sources import Source

ACCURACY = 1e-3
"""Error of the time step, over the largest displacement recorded, where no other is asked for."""
FIRST = 0.25
"""Step of the first run, over the longest stable one 2 / omega_max; that of the second is half."""
MOST_RUNS = 5
"""At most, each with a step up to a quarter of the one before."""
SURE = 0.8
"""Share of the accuracy that a next step is chosen for, so that it seldom just misses it."""
LOOKS = 40
"""Looks at which contacts have opened, in a run: sorting them costs some steps."""
PRODUCTS = 2.0
"""What a step costs, in products with K, about."""


@dataclass(frozen=True, repr=False)
class NonlinearWave(Wave):
    """Result of `modal.propagate` where contacts follow their law.

    Attributes
    ----------
    signals : Signals
        As of the linear wave, with the energy balance, and the slip of all contacts, those that the
        wave has closed among them.
    steps : int
        Of the last run.
    error : float
        That of its time step, over the largest displacement recorded; NaN where it was given.
    noise : float
        Largest displacement without any motion of the wall, over the same.
    energy : ndarray (nt, 4)
        J, at the times of the signals: work of the source, kinetic energy, what the contacts have
        stored beyond the state at rest, what slip has dissipated.
    dissipated, opened : ndarray (m,) J, ndarray of bool (m,)
        Of each contact of the sample's network: by its slip, and whether it was seen open.

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
    def moved(self) -> Floats:
        """Shape (nt, k): all displacements that are recorded, of chain, layers and spheres."""
        signals, nt = self.signals, len(self.energy)
        records = (signals.chain_displacement, signals.layer_displacement)
        every = signals.particle_displacement
        return np.hstack([*records, np.empty((nt, 0)) if every is None else every])


def at_rest(sample: Sample | Network, friction: float | None) -> Sample:
    """The sample to start from; InputError for one in motion, or of a law that is not known."""
    if friction is not None and not 0 < friction < math.inf:
        raise InputError("input", f"friction {friction:g}", "must be positive")
    if isinstance(sample, Network):
        if friction is None:
            raise InputError(
                "input",
                "a network has no friction, which says when its contacts slide",
                remedy="give friction",
            )
        return sample_of_network(sample, friction)
    if sample.velocity is not None and sample.velocity.any():
        raise UnavailableError(
            "in_motion",
            "the sample is on its way",
            remedy="bring it to rest first (python -m modal relax)",
        )
    return sample if friction is None else replace(sample, friction=friction)


@dataclass
class NonlinearRuns:
    """A sample at rest, its source and the motion of that, and the runs in steps of any length.

    Fields, and what is recorded, as of `modal.propagate`. `limit`, s, is the longest stable step of
    the springs at rest; `first` the steps from record to record of a first run.
    """

    sample: Sample
    duration: float
    interval: float
    source: Source
    motion: Motion
    direction: str
    particles: bool

    def __post_init__(self) -> None:
        self.network, direction = self.sample.network(), self.direction
        self.time = record_times(self.duration, self.interval)
        self.receivers = Receivers(self.network, direction, particles=self.particles)
        self.moves = self.source.imposed(self.network, direction) is not None
        if self.moves and direction == TORSION and self.sample.periodic_z:
            raise InputError(
                "input",
                "a period along z does not turn",
                remedy=("take a cell between walls, a sphere as the source, or the linear wave"),
            )
        self.load = self.source.load(self.network, direction).reshape(-1, 6)
        self.system = LinearSystem(self.network)
        top = self.system.spectral_bound
        self.limit = 2 / math.sqrt(top) if top > 0 else math.inf
        self.first = math.ceil(self.interval / (FIRST * self.limit))

    def wave(self, accuracy: float, time_step: float | None) -> NonlinearWave:
        """The wave within the `accuracy`, or in steps of at most `time_step`, s.

        The noise of a sample that is not quite at rest is told, not taken off.
        """
        if time_step is None:
            wave = self.run_to(accuracy)
        elif 0 < time_step < self.limit:
            wave = self.run(math.ceil(self.interval / time_step * (1 - 1e-9)))
        else:
            raise InputError(
                "input",
                f"time step {time_step:g} s",
                f"the scheme is stable up to 2 / omega_max = {self.limit:.4g} s",
                "take a smaller one",
            )
        quiet = abs(self.run(self.first, driven=False).moved).max(initial=0.0)
        largest = abs(wave.moved).max(initial=0.0)
        return replace(wave, noise=float(quiet / largest) if largest else math.inf)

    def run_to(self, accuracy: float) -> NonlinearWave:
        """The run in steps so short that their error, over the largest motion, is the `accuracy`.

        InputError where that is not reached.
        """
        every, finer, coarse = self.first, 2 * self.first, self.run(self.first)
        for _ in range(MOST_RUNS):
            fine = self.run(finer)
            largest = abs(fine.moved).max(initial=0.0)
            apart = abs(fine.moved - coarse.moved).max(initial=0.0)
            error = float(apart / largest / ((finer / every) ** 2 - 1)) if largest else 0.0
            if error <= accuracy:
                return replace(fine, error=error)
            growth = math.sqrt(error / (SURE * accuracy))
            every, coarse = finer, fine
            finer = math.ceil(every * min(max(growth, 1.2), 4.0))
        raise UnavailableError(
            "not_converged",
            f"the error of the time step is still {error:.1e} of the motion at "
            f"{self.interval / every:.3g} s",
            "spheres fly about, whose ways no step repeats",
            "ask "
            "for a larger tolerance, a smaller amplitude or a shorter duration, or give a time "
            "step",
        )

    def run(self, every: int, *, driven: bool = True) -> NonlinearWave:
        """One run of `every` steps from record to record; at rest the source where not `driven`."""
        started, nt, along = clock.perf_counter(), len(self.time), COMPONENT[self.direction]
        dt, steps = self.interval / every, every * (nt - 1)
        # Of what moves along the direction alone.
        reading = self.receivers.rows[:, along::6].tocsr()
        refuse_endless(
            f"a wave of {self.time[-1]:g} s in steps of {dt:.3g} s",
            self.system.renumbered,
            products=PRODUCTS * steps,
            bytes_needed=8 * (3 * nt * reading.shape[0] + steps),
            remedy="take a shorter duration or a larger tolerance",
        )
        from modal.dem.motion import Dynamics  # not at import: linear waves need none of its loops

        moving = Dynamics(self.sample, books=True)
        moving.axis = self.network.cell_size[:2] / 2
        contacts, inertia = moving.contacts, np.repeat(moving.masses, 3, axis=1)
        moving.carried = self.source.carried(self.sample.position)
        given = driven * self.motion.displacement(dt * np.arange(steps + 1, dtype=float))
        moved, on_walls, energy = (np.empty((nt, count)) for count in (reading.shape[0], 2, 4))
        turned, opened = np.zeros(len(inertia)), np.zeros(self.network.n_contacts, bool)
        work = force = rest = 0.0
        for k in progress(steps + 1, "wave" if driven else "noise"):
            row, recorded = k // every, k % every == 0
            if recorded:
                moved[row] = reading @ (turned if along > 2 else moving.displacement()[:, along])
                before = moving.velocity.copy()
            # Works are those of the mean force of both ends of a step, as between spheres.
            if self.moves:
                moving.place_source(given[k] * np.eye(6)[along])
                moving.step(dt)
                now = float(moving.held()[along])
                work += 0.5 * (force + now) * (given[k] - given[k - 1]) if k else 0.0
                force = now
            else:
                way = dt * float((self.load * moving.velocity).sum())
                work += 0.5 * (given[k - 1] + given[k]) * way if k else 0.0
                moving.push = given[k] * self.load
                moving.step(dt)
            if along > 2:
                turned += dt * moving.velocity[:, along]
            if recorded:
                stored = contacts.elastic_energy + float(contacts.work[:, 0].sum())
                rest = rest if k else stored
                kinetic = 0.5 * float((inertia * before * moving.velocity).sum())
                energy[row] = work, kinetic, stored - rest, contacts.slipped
                on_walls[row] = force, contacts.on_walls[1, along]
                if row % max(1, nt // LOOKS) == 0 or k == steps:
                    opened |= contacts.opened()
        if not np.isfinite(moved).all():
            raise UnavailableError(
                "not_converged", "the wave is not finite", remedy="take a smaller amplitude"
            )
        ends, lost, rows = contacts.slips()
        dissipated = np.zeros(len(opened))
        dissipated[rows[rows >= 0]] = lost[rows >= 0]
        kinds = {"source_stress": self.moves, "receiver_stress": self.receivers.walls}
        there = [name for name, known in kinds.items() if known]
        signals = self.receivers.signals(
            self.time,
            np.hstack([(on_walls - on_walls[0])[:, list(kinds.values())], moved]),
            self.motion,
            self.source,
            there,
            producer="nonlinear",
            time_step=dt,
            run_time=clock.perf_counter() - started,
            balance=self._balance(energy, dt, int((dissipated > 0).sum()), opened)
            if driven
            else None,
            slip_ends=ends,
            slip_energy=lost,
        )
        return NonlinearWave(signals, steps, math.nan, math.nan, energy, dissipated, opened)

    def _balance(self, energy: Floats, dt: float, slid: int, opened: Bools) -> EnergyBalance | None:
        """The books from the end of the wall's motion on; None where the record ends before it."""
        quiet = int(np.searchsorted(self.time, self.motion.corners[-1]))
        if quiet >= len(self.time) - 1:
            return None
        work, kinetic, stored, lost = energy.T
        held = kinetic + stored
        # A force bends contacts by what nobody knows beforehand: any share of them.
        size = self.motion.amplitude if self.moves else math.inf
        bound = drift_limit(self.network, dt / self.limit, size, held[quiet])
        return EnergyBalance(
            energy=float(held[quiet]),
            drift=float(held[-1] / held[quiet] - 1),
            friction=float((lost[-1] - lost[quiet]) / held[quiet]),
            contacts=len(opened),
            opened=int(opened.sum()),
            slid=slid,
            limit=math.nan if slid else float(bound),
            work=float(work[-1]),
            gap=float((held[-1] + lost[-1] - work[-1]) / abs(work[-1])),
        )
