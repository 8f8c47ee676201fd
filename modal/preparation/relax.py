"""A sample brought into the balance of its contact law, at a fixed cell.

What a dynamic run leaves unbalanced would move by itself while a wave of some nanometres passes.
Damped motion (`modal.dem.motion`) lets contacts slide, open and close until few still do. It ends
in a long elastic tail: nothing slides any more, and what is left are the longest waves along the
packing, which die slowly. The springs say at once how far each sphere still has to go: K d = F,
with the present overlaps' stiffnesses and the net forces F (a step of Newton's method without the
change of direction of the forces, which gains two or three digits at a time). Spheres that slide,
or that springs alone would send far, know no such rest: their own net force is left out and they
follow their neighbours. What has been gained is seen after some more steps of all. A packing that
rests holds by itself.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

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
"""Mean net force over mean contact force at which a sample counts as balanced. What is left moves
spheres by a share of their overlaps, the more the higher the stress; at 100 kPa and below it is
round-off of the positions that decides."""
SINGLE = 10.0
"""Largest net force of a sphere, over the mean one allowed: a single sphere with more would go by
itself as far as a wave moves it."""
RESERVE = 0.95
"""Share of the friction that may be used at rest: none stands at its limit when a wave comes."""
NEAR = 1e-7
"""Residual at which a sample that comes no nearer is still given back, as one not at rest."""
LOOK = 100
"""Steps between two looks at the balance."""
FEW = 0.05
"""Share of sliding contacts below which springs are asked: a few loose spheres may go on sliding
for long while all others have nothing left but what is elastic."""
FIRST = 500
"""Steps before the springs are asked at all: how many contacts will slide shows while they do."""
GAIN = 0.5
"""Largest residual, over the one at the turn of the springs before, with which they are asked again
after `LOOK` steps. Otherwise damped motion goes on twice as long as before, `AGAIN` at least."""
AGAIN = 500
"""Steps that take about half the time of a turn of the springs."""
MAX_STEPS = 60_000
STRIDE = 1.0
"""Median overlaps that a sphere may go at once; its neighbours go nearly as far, and the overlaps
change by much less."""
LEFT_OUT = 0.05
"""Share of spheres that springs leave out above which the packing is not yet one of springs."""
ROUNDS = 3
"""Solutions until no further sphere goes too far."""
HELD = 1e-7
"""Of the mean stiffness, added to that of every sphere: the softest elastic motion of 150 layers
has 1e-5, motions without energy none."""
ERROR = 1e-2
"""Of the motion, in the energy norm. The change of stiffness on the way is off by as much."""
LOOK_BACK, MOST_PRODUCTS = 30, 3000
"""Products with K over which the error is measured, and after which the springs know of no rest."""
AT_LIMIT = 1 - 1e-9
"""Share of friction from which a contact slides: the moving contacts are cut back to exactly 1."""


@dataclass
class Equilibrium:
    """Residuals of a state: mean and largest net force (and torque over R) over mean N.

    friction_used: largest |shear| / (mu N), over 1 in the `sliding` contacts beyond the limit,
    which a dynamic run would let slide; `steps` so far. While spheres move `sliding` are those that
    slid in the last step, and friction_used is not sought (NaN). Of the end of `relax` also the
    `tolerance` that was asked for, the one that round-off of the positions allows (`attainable`),
    and whether the larger of both holds, `SINGLE` times as much for a single sphere (`at_rest`).
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
        """Whether the residual is below `goal`, and no sphere's force above `SINGLE` times it."""
        return self.residual <= goal and self.largest <= SINGLE * goal


def equilibrium_of(sample: Sample, steps: int = 0) -> Equilibrium:
    """How far from balance the sample is, from its positions and shear forces alone."""
    network = sample.network()
    if network.n_contacts == 0:
        return Equilibrium(0.0, 0.0, 0.0, 0, 0, steps)
    size, used = residual_forces(network), friction_used(network, sample.friction)
    limits = float(used.max()), int((used > 1).sum())
    return Equilibrium(float(size.mean()), float(size.max()), *limits, network.n_contacts, steps)


def relax(
    sample: Sample,
    *,
    tolerance: float = TOLERANCE,
    max_steps: int = MAX_STEPS,
    watch: Callable[[Equilibrium], None] | None = None,
) -> tuple[Sample, Equilibrium]:
    """The sample in balance under its law; raises InputError if it does not come to rest.

    It needs friction: frictionless packings have motions that nothing resists. The tolerance is
    raised to what round-off of the positions allows; a sample that stalls below `NEAR` is given
    back with a balance that is not `at_rest`. Contacts slide at `RESERVE` of the friction, and at
    that of the compression (`mu_comp` among the notes) where this is less: no state at rest bears
    what its compression did not allow. `watch` sees the balance every `LOOK` steps.
    """
    if not 0 < sample.friction < np.inf:
        raise InputError(
            "input",
            f"friction {sample.friction:g}",
            "a balance of contacts needs friction",
            "give a positive one",
        )
    limit = RESERVE * sample.friction
    of_compression = number_noted(sample.study, "mu_comp")
    if of_compression is not None and of_compression > 0:
        limit = min(limit, of_compression)
    contacts = MovingContacts(sample, limit)
    if contacts.touching == 0:
        raise InputError(
            "input", "the sample has no contacts", remedy="compress it before it is brought to rest"
        )
    overlap = float(np.median(sample.contacts().overlap))
    attainable = float(10 * np.finfo(float).eps * contacts.lengths[2] / overlap)
    goal = max(tolerance, attainable)
    motion, turns = DampedMotion(contacts), _Turns()
    for step in range(max_steps + 1):
        if contacts.touching == 0:
            raise InputError(
                "input",
                f"the spheres come apart at a friction of {limit:.3g}",
                remedy=("give them more of it, or compress the sample further first"),
            )
        if step % LOOK == 0:
            state = _look(contacts, step)
            if watch:
                watch(state)
            # The sample is what counts: its overlaps follow from the positions once more.
            if state.within(goal):
                if equilibrium_of(contacts.sample()).within(goal):
                    break
                # It holds no part of the shear forces along the contacts.
                contacts.level_shear()
            elif turns.of_springs(state):
                there = _by_springs(contacts, state)
                turns.note(state, taken=there is not contacts)
                if there is not contacts:
                    contacts = there
                    motion = DampedMotion(contacts)
        motion.step()
    rested = contacts.sample()
    state = equilibrium_of(rested, step)
    if not state.within(max(NEAR, goal)):
        raise InputError(
            "input",
            f"the sample does not come to rest (residual {state.residual:.1e}, of a single sphere "
            f"{state.largest:.1e}, after {step} steps)",
            remedy="let its dynamics settle further first",
        )
    state.tolerance, state.attainable, state.at_rest = tolerance, attainable, state.within(goal)
    return rested, state


class _Turns:
    """When the springs are asked: soon again after a gain, ever later without one.

    And out of turn as soon as no contact slides any more.
    """

    def __init__(self) -> None:
        self._next, self._wait, self._before, self._slid = FIRST, LOOK, np.inf, True

    def of_springs(self, state: Equilibrium) -> bool:
        """Whether it is their turn at this look."""
        held = self._slid and state.sliding == 0 and state.steps >= FIRST
        return state.sliding <= FEW * state.contacts and (held or state.steps >= self._next)

    def note(self, state: Equilibrium, taken: bool) -> None:
        """They were asked in this state; `taken` if the sample now is where they put it."""
        gained = taken and state.residual <= GAIN * self._before
        self._wait = LOOK if gained else max(AGAIN, 2 * self._wait)
        self._next, self._before = state.steps + self._wait, state.residual
        self._slid = state.sliding > 0


def _by_springs(contacts: MovingContacts, state: Equilibrium) -> MovingContacts:
    """The contacts where the springs put them; the same ones if that is no nearer to balance."""
    here = contacts.sample()
    motion = elastic_motion(contacts, here)
    if motion is None:
        return contacts
    there = MovingContacts(here, contacts.friction)
    there.move(motion)
    if there.touching and _look(there, state.steps).residual < state.residual:
        return there
    return contacts


def _look(contacts: MovingContacts, step: int) -> Equilibrium:
    size = sizes_of_loads(contacts.load, contacts.radius) / contacts.mean_force
    mean, largest = float(size.mean()), float(size.max())
    return Equilibrium(mean, largest, np.nan, contacts.sliding, contacts.touching, step)


def elastic_motion(contacts: MovingContacts, sample: Sample) -> Floats | None:
    """Shape (n, 6), m and rad: the motion to balance of the springs; None if they know of none.

    `sample` is what the contacts are now. None of the spheres goes further than `STRIDE` median
    overlaps, a turn counted as the arc that it makes. It is for the caller to see whether the
    forces of the law are nearer to balance there.
    """
    network = sample.network()
    system = LinearSystem(network)
    stride = STRIDE * float(np.median(network.require("overlap", "rest")))
    at_limit = friction_used(network, contacts.friction) > AT_LIMIT
    out = np.zeros(network.n_particles, bool)
    out[network.particle_i[at_limit]] = True
    out[network.particle_j[at_limit & ~network.with_wall]] = True
    for _ in range(ROUNDS):
        if out.mean() > LEFT_OUT:
            return None
        try:
            motion = _balance(system, np.where(out[:, None], 0.0, contacts.load))
        except InputError:
            return None  # stiffnesses that differ too much for the solver: damped motion goes on
        turn = motion[:, 3:] * network.radius[:, None]
        size = np.sqrt((motion[:, :3] ** 2).sum(axis=1) + (turn**2).sum(axis=1))
        far = size > stride
        if not (far & ~out).any():
            break
        out |= far
    return motion * np.minimum(1, stride / np.maximum(size, stride))[:, None]


def _balance(system: LinearSystem, load: Floats) -> Floats:
    """Shape (n, 6), m and rad: where the springs, all spheres held a little, balance `load`."""
    root, blocks, operator = system.sqrt_mass, system.own_blocks, system.renumbered
    held = HELD * float(np.einsum("nii->ni", blocks).mean())
    inverse = np.linalg.inv(blocks + held * np.eye(6))
    if operator.order is not None:
        inverse = inverse[operator.order]
    found = conjugate_gradients(
        lambda motion: operator.combine(motion, np.empty_like(motion), 1.0, held),
        lambda rest: (inverse @ rest.reshape(-1, 6, 1)).reshape(rest.shape),
        operator.inward(root.over(load.ravel()))[:, None],
        lambda energy: ERROR**2 * energy,
        np.zeros(1),
        look_back=LOOK_BACK,
        most_products=MOST_PRODUCTS,
    )
    return root.over(operator.outward(found.motion[:, 0])).reshape(load.shape)
