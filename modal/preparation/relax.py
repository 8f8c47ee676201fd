"""Relax a sample to the balance of its contact law, at a fixed cell.

Net forces that a dynamic run leaves would move spheres while a wave of some nanometres passes. In a
damped motion (`modal.dem.motion`) contacts slide, open and close, and gradually stop doing so. In
the end only the longest waves along the packing remain, which decay slowly. An elastic step then
computes the remaining displacement d of all spheres at once: K d = F, with the stiffness K of the
present overlaps and the net forces F. This is a step of Newton's method that neglects the change of
direction of the forces; it gains two or three digits. Spheres that slide, or that the springs alone
would move far, are excluded: their own net force is left out, and they follow their neighbours. The
gain is checked after some more damped steps. A packing that is already at rest is not changed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modal.dem.clump_relaxation import DampedClumps
from modal.dem.contacts import MovingContacts
from modal.dem.motion import DampedMotion
from modal.formats.attributes import number_noted
from modal.packing.sample import Sample
from modal.packing.state import friction_used, residual_forces, sizes_of_loads
from modal.solvers.conjugate_gradients import conjugate_gradients
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

TOLERANCE = 1e-10
"""Mean net force divided by mean contact force at which a sample counts as balanced. What is left
moves spheres by a share of their overlaps, the more the higher the stress; at 100 kPa and below,
round-off of the positions decides."""
MAX_SINGLE_RATIO = 10.0
"""Largest net force of a single sphere divided by the mean net force: a sphere with more would move
by itself as far as a wave moves it."""
FRICTION_SHARE = 0.95
"""Largest share of the friction limit that contacts use at rest, so that no contact is at its limit
when a wave comes."""
ACCEPTED_RESIDUAL = 1e-7
"""Residual at which a sample that comes no nearer to balance is still returned, as not at rest."""
CREEP_RESIDUAL = 1e-5
"""Residual down to which a sample may creep under its stress before its cell is fixed: the stress
then falls by less than the 0.3 % to which a state's stress is exact (13 % at 10 kPa, friction 0.4,
from the residual of 1e-3 at which a compression goes on)."""
LEAST_TOUCHING_SHARE = 0.5
"""Share of the first contacts at which a sample has come apart: rigid packings have 4 to 7 contacts
a sphere, and with less than 4 none is rigid."""
CHECK_STEPS = 100
"""Steps between two checks of the balance."""
MAX_SLIDING_SHARE = 0.05
"""Share of sliding contacts below which elastic steps are tried: a few loose spheres may go on
sliding for long while the rest of the packing only vibrates."""
FIRST_ELASTIC_STEP = 500
"""Number of damped steps before the first elastic step: damped motion shows how many contacts
slide."""
MIN_GAIN = 0.5
"""Largest ratio of the residuals at two successive elastic steps with which the next one follows
after `CHECK_STEPS`. Otherwise damped motion lasts twice as long as before, and at least
`MIN_WAIT_STEPS`."""
MIN_WAIT_STEPS = 500
"""Least number of damped steps between two elastic steps; they take about half the time of an
elastic step."""
MAX_STEPS = 60_000
MAX_DISPLACEMENT_OVERLAPS = 1.0
"""Largest displacement of a sphere in an elastic step, in median overlaps; its neighbours go nearly
as far, and the overlaps change by much less."""
MAX_EXCLUDED_SHARE = 0.05
"""Share of spheres excluded from the elastic balance above which the packing is not yet elastic."""
MAX_ROUNDS = 3
"""Largest number of solutions of the elastic balance; each excludes the spheres that moved too far
in the one before."""
HOLDING_RATIO = 1e-7
"""Stiffness that holds every sphere in its place, divided by the mean stiffness: the softest
elastic motion of 150 layers has a stiffness of 1e-5 of the mean, motions without energy have
none."""
SOLVER_ERROR = 1e-2
"""Relative error of the elastic motion in the energy norm; the stiffness changes along the motion
by as much."""
ERROR_PRODUCTS = 30
"""Products with K over which the error of the solver is estimated."""
MAX_PRODUCTS = 3000
"""Number of products with K after which the solution of the elastic balance is abandoned."""
SLIDING_SHARE = 1 - 1e-9
"""Least share of the friction limit at which a contact counts as sliding: moving contacts are cut
back to exactly 1."""
ROUND_OFF_FACTOR = 10
"""Smallest residual that can be reached, divided by the ratio of the round-off of a position to the
median overlap."""


@dataclass
class Equilibrium:
    """Balance of a state, as ratios to the mean normal force.

    Attributes
    ----------
    residual, largest : float
        Mean and largest net force on a sphere (or torque divided by its radius) divided by the mean
        normal force.
    friction_used : float
        Largest |shear| / (mu N); above 1 in `sliding` contacts. NaN while spheres move.
    sliding : int
        Number of contacts beyond the limit of friction, which would slide in a dynamic run; while
        spheres move, number of contacts that slid in the last step.
    contacts : int
        Number of contacts.
    steps : int
        Steps so far.
    tolerance, attainable : float
        Residual that was requested, and the smallest residual that round-off of the positions
        allows; set at the end of `relax`.
    at_rest : bool
        Whether the residual is below the larger of these two limits, and the residual of each
        sphere is below `MAX_SINGLE_RATIO` times this limit.
    """

    residual: float
    largest: float
    friction_used: float
    sliding: int
    contacts: int
    steps: int = 0
    tolerance: float = np.nan
    attainable: float = np.nan
    at_rest: bool = False

    def within(self, goal: float) -> bool:
        """Return whether the mean residual is at most `goal`, and the largest not far above it."""
        return self.residual <= goal and self.largest <= MAX_SINGLE_RATIO * goal


def measure_equilibrium(sample: Sample, steps: int = 0) -> Equilibrium:
    """Return how far a sample is from balance, from its positions and shear forces alone."""
    network = sample.network()
    if network.n_contacts == 0:
        return Equilibrium(0.0, 0.0, 0.0, 0, 0, steps)
    net_force = residual_forces(network)
    used = friction_used(network, sample.friction)
    return Equilibrium(
        residual=float(net_force.mean()),
        largest=float(net_force.max()),
        friction_used=float(used.max()),
        sliding=int((used > 1).sum()),
        contacts=network.n_contacts,
        steps=steps,
    )


def relax(
    sample: Sample,
    *,
    tolerance: float = TOLERANCE,
    max_steps: int = MAX_STEPS,
    watch: Callable[[Equilibrium], None] | None = None,
    mobilised: bool = False,
) -> tuple[Sample, Equilibrium]:
    """Bring a sample to static equilibrium under its contact law, by damped motion.

    The sample must have friction: frictionless packings have motions that nothing resists. Contacts
    slide at `FRICTION_SHARE` of the friction or, if this is less, at the friction of the
    compression (`mu_comp` among the attributes of the sample), because no contact force exceeded
    the latter.

    Parameters
    ----------
    sample : Sample
        The sample, with friction and contacts.
    tolerance : float
        Residual at which the motion ends; raised to the smallest residual that round-off of the
        positions allows.
    max_steps : int
        Largest number of steps of damped motion.
    watch : callable, optional
        Called with the balance every `CHECK_STEPS` steps.
    mobilised : bool, default False
        Whether contacts slide at the whole friction, so that those that have slid stay at their
        limit. A wave moves them from its first step on.

    Returns
    -------
    Sample
        The sample after its motion.
    Equilibrium
        The balance of the sample; not `at_rest` if only `ACCEPTED_RESIDUAL` was reached.

    Raises
    ------
    InputError
        If there is no friction or no contact, if the sample loses its contacts, or if it does not
        come to rest.
    """
    limit = friction_at_rest(sample, mobilised=mobilised)
    contacts = MovingContacts(sample, limit)
    if contacts.touching == 0:
        raise InputError(
            "no_contacts",
            "the sample has no contacts",
            remedy="compress it before it is brought to rest",
        )
    overlap = float(np.median(abs(sample.contacts().overlap)))
    round_off = ROUND_OFF_FACTOR * np.finfo(float).eps
    attainable = float(round_off * contacts.lengths[2] / overlap)
    goal = max(tolerance, attainable)
    motion = _damped_motion(contacts)
    schedule = _ElasticSchedule()
    first_touching = contacts.touching
    for step in range(max_steps + 1):
        if contacts.touching <= LEAST_TOUCHING_SHARE * first_touching:
            raise InputError(
                "comes_apart",
                f"the spheres come apart at a friction of {limit:.3g}",
                remedy="give them more of it, or compress the sample further first",
            )
        if step % CHECK_STEPS == 0:
            state = _measure_moving(contacts, step)
            if watch:
                watch(state)
            # The sample is what counts: its overlaps follow from the positions once more.
            if state.within(goal):
                if measure_equilibrium(contacts.sample()).within(goal):
                    break
                # A sample holds no part of the shear forces along the contacts' normals.
                contacts.level_shear()
            elif schedule.is_due(state):
                moved_contacts = _take_elastic_step(contacts, state)
                schedule.record(state, accepted=moved_contacts is not None)
                if moved_contacts is not None:
                    contacts = moved_contacts
                    motion = _damped_motion(contacts)
        motion.step()
    relaxed = contacts.sample()
    state = measure_equilibrium(relaxed, step)
    if not state.within(max(ACCEPTED_RESIDUAL, goal)):
        raise InputError(
            "not_at_rest",
            f"the sample does not come to rest (residual {state.residual:.1e}, of a single sphere "
            f"{state.largest:.1e}, after {step} steps)",
            remedy="let its dynamics settle further first",
        )
    state.tolerance = tolerance
    state.attainable = attainable
    state.at_rest = state.within(goal)
    return relaxed, state


def _damped_motion(contacts: MovingContacts) -> DampedMotion | DampedClumps:
    """Return the dynamic relaxation of the grains: spheres, or clumps."""
    if contacts.body is None:
        return DampedMotion(contacts)
    return DampedClumps(contacts)


def friction_at_rest(sample: Sample, *, mobilised: bool = False) -> float:
    """Return the friction at which contacts slide while a sample comes to rest.

    It is a share of the sample's, all of it for `mobilised` contacts, and no more than the friction
    of the compression. Raises InputError if there is none.
    """
    share = 1.0 if mobilised else FRICTION_SHARE
    if not 0 < sample.friction < np.inf:
        raise InputError(
            "friction",
            f"friction {sample.friction:g}",
            "a balance of contacts needs friction",
            "give a positive one",
        )
    limit = share * sample.friction
    compression_friction = number_noted(sample.study, "mu_comp")
    if compression_friction is not None and compression_friction > 0:
        limit = min(limit, compression_friction)
    return limit


class _ElasticSchedule:
    """Schedule of elastic steps: soon after a successful one, later and later after failures.

    An elastic step is also due as soon as no contact slides any more.
    """

    def __init__(self) -> None:
        self._next_step = FIRST_ELASTIC_STEP
        self._wait_steps = CHECK_STEPS
        self._residual_before = np.inf
        self._was_sliding = True

    def is_due(self, state: Equilibrium) -> bool:
        """Return whether to try an elastic step at this check."""
        if state.sliding > MAX_SLIDING_SHARE * state.contacts:
            return False
        stopped_sliding = self._was_sliding and state.sliding == 0
        if stopped_sliding and state.steps >= FIRST_ELASTIC_STEP:
            return True
        return state.steps >= self._next_step

    def record(self, state: Equilibrium, accepted: bool) -> None:
        """Plan the next elastic step, after one from this state was `accepted` or rejected."""
        if accepted and state.residual <= MIN_GAIN * self._residual_before:
            self._wait_steps = CHECK_STEPS
        else:
            self._wait_steps = max(MIN_WAIT_STEPS, 2 * self._wait_steps)
        self._next_step = state.steps + self._wait_steps
        self._residual_before = state.residual
        self._was_sliding = state.sliding > 0


def _take_elastic_step(contacts: MovingContacts, state: Equilibrium) -> MovingContacts | None:
    """Return the contacts after an elastic step; None if this does not reduce the residual."""
    sample = contacts.sample()
    motion = elastic_motion(contacts, sample)
    if motion is None:
        return None
    moved_contacts = MovingContacts(sample, contacts.friction)
    if moved_contacts.body is None:
        moved_contacts.move(motion)
    else:
        DampedClumps(moved_contacts).move(motion)
    if not moved_contacts.touching:
        return None
    if _measure_moving(moved_contacts, state.steps).residual < state.residual:
        return moved_contacts
    return None


def _measure_moving(contacts: MovingContacts, step: int) -> Equilibrium:
    """Return the balance of moving contacts, without `friction_used`."""
    loads = sizes_of_loads(contacts.grain_load, contacts.grain_radius)
    net_force = loads / contacts.mean_force
    return Equilibrium(
        residual=float(net_force.mean()),
        largest=float(net_force.max()),
        friction_used=np.nan,
        sliding=contacts.sliding,
        contacts=contacts.touching,
        steps=step,
    )


def elastic_motion(contacts: MovingContacts, sample: Sample) -> Floats | None:
    """Return the motion (k, 6), m and rad, of grains that balances the contacts' springs.

    `sample` is the present state of `contacts`. No grain moves further than
    `MAX_DISPLACEMENT_OVERLAPS` median overlaps; rotations count as arcs. Returns None if too many
    grains are excluded, or if the solver does not converge. The caller checks whether the forces
    of the contact law are nearer to balance after the motion.
    """
    network = sample.network()
    system = LinearSystem(network)
    load = contacts.grain_load
    median_overlap = float(np.median(abs(network.require("overlap", "rest"))))
    max_displacement = MAX_DISPLACEMENT_OVERLAPS * median_overlap
    is_sliding = friction_used(network, contacts.friction) > SLIDING_SHARE
    excluded = np.zeros(network.n_particles, bool)
    excluded[network.particle_i[is_sliding]] = True
    excluded[network.particle_j[is_sliding & ~network.with_wall]] = True
    for _ in range(MAX_ROUNDS):
        if excluded.mean() > MAX_EXCLUDED_SHARE:
            return None
        try:
            motion = _solve_balance(system, np.where(excluded[:, None], 0.0, load))
        except InputError:
            return None  # stiffnesses that differ too much for the solver: damped motion goes on
        arc = motion[:, 3:] * network.radius[:, None]
        displacement = np.sqrt((motion[:, :3] ** 2).sum(axis=1) + (arc**2).sum(axis=1))
        is_far = displacement > max_displacement
        if not (is_far & ~excluded).any():
            break
        excluded |= is_far
    factor = np.minimum(1, max_displacement / np.maximum(displacement, max_displacement))
    return motion * factor[:, None]


def _solve_balance(system: LinearSystem, load: Floats) -> Floats:
    """Return the motion (n, 6), m and rad, at which springs balance `load` (n, 6), N and N m.

    A weak spring also holds each sphere at its place. At the error asked for, the inverses of the
    spheres' own blocks suffice as preconditioner: a load of one wavelength takes 66 to 234 products
    and 0.2 to 3.4 s with 8,000 to 125,000 spheres, and the set-up of multigrid twice to five times
    as long.
    """
    sqrt_mass = system.sqrt_mass
    blocks = system.diagonal_blocks
    operator = system.renumbered
    holding_stiffness = HOLDING_RATIO * float(np.einsum("nii->ni", blocks).mean())
    inverse = np.linalg.inv(blocks + holding_stiffness * np.eye(6))
    if operator.order is not None:
        inverse = inverse[operator.order]

    def multiply(motion: Floats) -> Floats:
        return operator.combine(motion, np.empty_like(motion), 1.0, holding_stiffness)

    def precondition(residual: Floats) -> Floats:
        product: Floats = (inverse @ residual.reshape(-1, 6, 1)).reshape(residual.shape)
        return product

    def allowed_error(energy: Floats) -> Floats:
        return SOLVER_ERROR**2 * energy

    solution = conjugate_gradients(
        multiply,
        precondition,
        operator.inward(sqrt_mass.over(load.ravel()))[:, None],
        allowed_error,
        np.zeros(1),
        look_back=ERROR_PRODUCTS,
        most_products=MAX_PRODUCTS,
    )
    return sqrt_mass.over(operator.outward(solution.motion[:, 0])).reshape(load.shape)
