"""A sample brought into the balance of its contact law, by Newton steps at a fixed cell.

What a dynamic run leaves unbalanced would move by itself while a wave of some nanometres passes.
Each step solves K q = f with the springs of the contacts and lets the law follow the motion q: a
Hertzian normal force, and a shear force that turns with the contact and grows by ks times the
shear displacement. Nothing slides on the way. Of the few contacts that end beyond the friction
limit, those of hardly loaded spheres are opened, in the others the shear force is cut, and the
balance is sought anew.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from modal.geometry import Touching, tangents
from modal.hertz_mindlin import stiffness_tangential
from modal.layers import force_bearing, strongest_force
from modal.network import Network
from modal.sample import Sample
from modal.statics import spring_motion
from modal.statistics import friction_used
from modal.storage import InputError

SHIFT = 1e-5
"""Added to K's diagonal, over its mean: spheres that nothing holds stay in the solve."""
STEP_CAP = 0.3
"""Longest displacement in one step, median overlaps; beyond, springs say little of the law."""
STIFFENING, SOFTENING, TRIALS = 30.0, 0.1, 8
"""Factors of a sphere's shift where a step fails and from step to step; trials of one step."""
TOLERANCE = 1e-9
"""Mean net force over mean contact force at which a sample counts as balanced."""
NEAR = 1e-7
"""Residual at which a sample that comes no nearer is taken as it is: a handful of loosely held
spheres keep it there."""
YIELD_BELOW = 1e-8
"""Residual below which shear forces beyond the friction limit are cut."""
YIELDS = 4
"""Most times that this is done."""
LOOSE = 1e-2
"""Largest contact force, over the mean, of a sphere that is freed rather than made to slide: with
two or three contacts steeper than friction allows, only the force zero is in balance."""
GAP = 1e-2
"""Gap at the contacts of a freed sphere, median overlaps."""
SOLVE_TOLERANCE = 1e-2
"""Relative residual of each linear solve; the law bends away from its springs by more."""


@dataclass
class Balance:
    """Residuals of a state: mean and largest net force (and torque over R) over mean N.

    friction_used: largest |shear| / (mu N), over 1 in the `sliding` contacts beyond the limit,
    which a dynamic run would let slide; steps, and products K u, so far.
    """

    residual: float
    largest: float
    friction_used: float
    sliding: int
    contacts: int
    steps: int = 0
    products: int = 0


def net_forces(network: Network) -> np.ndarray:
    """Shape (n, 6), N and N m: force and torque that the contacts exert on each sphere."""
    n, pair = network.n_particles, ~network.with_wall
    on_i = network.force_tangential - network.force_normal[:, None] * network.normal
    torque_i = np.cross(network.lever_i, on_i)
    torque_j = np.cross(network.lever_j, -on_i)[pair]
    load = np.empty((n, 6))
    i, j = network.particle_i, network.particle_j[pair]
    for axis in range(3):
        load[:, axis] = np.bincount(i, on_i[:, axis], n) - np.bincount(j, on_i[pair, axis], n)
        load[:, 3 + axis] = np.bincount(i, torque_i[:, axis], n)
        load[:, 3 + axis] += np.bincount(j, torque_j[:, axis], n)
    return load


def moved(sample: Sample, network: Network, motion: np.ndarray) -> Sample:
    """The sample after a small `motion` (n, 6), m and rad, its shear forces as the law has them.

    `network` is that of the sample. A contact that opens forgets its shear force, a new one starts
    without. Formulas: the law of `modal.tangent`, with finite increments.
    """
    position = sample.position + motion[:, :3]
    # Spheres that leave the cell come back on the other side; their contacts' periods follow.
    turns = np.floor(position[:, :2] / sample.side).astype(int)
    position[:, :2] -= turns * sample.side
    result = replace(sample, position=position)
    new = result.contacts()
    shift = network.cell_shift[:, :2].copy()
    i, j = network.particle_i, network.particle_j
    pair = j >= 0
    shift[pair] += turns[j[pair]] - turns[i[pair]]
    before, after = _matching(Touching(i, j, shift, network.normal, network.overlap), new)
    normal, was = new.normal[after], network.normal[before]
    i, j, pair = i[before], j[before], pair[before]
    motion_j = np.where(pair[:, None], motion[j], 0.0)
    turning = motion[i, 3:] + motion_j[:, 3:]
    lever = sample.radius - new.overlap[after] / 2
    slip = motion_j[:, :3] - motion[i, :3] + lever[:, None] * np.cross(normal, turning)
    slip -= (slip * normal).sum(axis=1)[:, None] * normal
    effective = np.where(pair, sample.radius / 2, sample.radius)
    ks = stiffness_tangential(new.overlap[after], effective, sample.material)
    force = network.force_tangential[before]
    rotation = np.cross(was, normal) + (0.5 * (turning * normal).sum(axis=1))[:, None] * normal
    force = force + np.cross(rotation, force) + ks[:, None] * slip
    first, second = tangents(normal)
    shear = np.zeros((len(new.particle_i), 2))
    shear[after, 0] = (force * first).sum(axis=1)
    shear[after, 1] = (force * second).sum(axis=1)
    return replace(result, shear=shear)


def _matching(old: Touching, new: Touching) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the contacts that are in both, in `old` and in `new`."""
    numbers = []
    for contact in (old, new):
        column = contact.particle_i.astype(np.int64)
        # Walls are -1 and -2; periods are small, a sphere reaches few images of another.
        column = (column << 24) + contact.particle_j + 2
        for axis in range(2):
            column = (column << 6) + contact.cell_shift[:, axis] + 32
        numbers.append(column)
    _, before, after = np.intersect1d(*numbers, assume_unique=True, return_indices=True)
    return before, after


def balance_of(sample: Sample, network: Network) -> tuple[np.ndarray, Balance]:
    """Net forces (n, 6) and how far from balance the sample is."""
    load = net_forces(network)
    if network.n_contacts == 0:
        return load, Balance(0.0, 0.0, 0.0, 0, 0)
    mean = network.force_normal.mean()
    size = _size(load, 1 / sample.radius)
    used = friction_used(network, sample.friction)
    return load, Balance(
        residual=float(size.mean() / mean),
        largest=float(size.max() / mean),
        friction_used=float(used.max()),
        sliding=int((used > 1).sum()),
        contacts=network.n_contacts,
    )


def relax(
    sample: Sample,
    *,
    tolerance: float = TOLERANCE,
    max_steps: int = 60,
    watch: Callable[[Balance], None] | None = None,
) -> tuple[Sample, Balance]:
    """The sample in balance under its law; raises InputError if it does not come to rest.

    It needs friction: frictionless packings have motions that no spring resists. The tolerance is
    raised to what round-off of the positions allows; a sample that stalls below `NEAR` is taken
    as it is, with its residual. Contacts beyond the friction limit are few
    and weak; where `YIELDS` rounds do not clear them, `Balance.sliding` says how many are left.
    `watch` sees the balance after every step.
    """
    if not 0 < sample.friction < np.inf:
        raise InputError(
            f"friction {sample.friction:g}: a balance of springs needs friction; "
            "give a positive one"
        )
    sample = _at_rest(sample)
    network = sample.network()
    if network.n_contacts == 0:
        raise InputError("the sample has no contacts; compress it before it is brought to rest")
    load, state = balance_of(sample, network)
    length = float(sample.walls[1] - sample.walls[0])
    floor = 10 * np.finfo(float).eps * length / float(np.median(network.overlap))
    share, products, yields = 0.0, 0, 0
    shift = np.full(network.n_particles, SHIFT)
    for step in range(max_steps + 1):
        state.steps, state.products = step, products
        if watch:
            watch(state)
        balanced = state.residual <= max(tolerance, floor)
        if state.sliding and yields < YIELDS and (balanced or state.residual < YIELD_BELOW):
            yields, share = yields + 1, 0.0
            sample = _yielded(_freed(sample, network))
            network = sample.network()
            load, state = balance_of(sample, network)
        elif balanced:
            return sample, state
        if share > 1 - 1e-3 and step > 5 and state.residual > 1e3 * tolerance:
            break
        sample, network, load, new, spent = _step(sample, network, load, shift)
        products += spent
        share, state = new.residual / state.residual, new
    if state.residual < NEAR:
        return sample, state
    raise InputError(
        f"the sample does not come to rest (residual {state.residual:.1e} after {state.steps} "
        "steps); let its dynamics settle further first"
    )


def _freed(sample: Sample, network: Network) -> Sample:
    """The sample with hardly loaded spheres that slide moved out of their contacts.

    The shortest way on which every contact opens; a sphere that would have to move by more than a
    median overlap stays.
    """
    sliding = np.flatnonzero(friction_used(network, sample.friction) > 1)
    i, j, force = network.particle_i, network.particle_j, network.force_normal
    pair = j >= 0
    strongest = strongest_force(network)
    ends = np.concatenate([i[sliding], j[sliding][pair[sliding]]])
    overlap = float(np.median(network.overlap))
    motion = np.zeros((network.n_particles, 6))
    for sphere in np.unique(ends[strongest[ends] < LOOSE * force.mean()]):
        own = np.flatnonzero((i == sphere) | (j == sphere))
        outward = np.where((i[own] == sphere)[:, None], -1, 1) * network.normal[own]
        way, *_ = np.linalg.lstsq(outward, network.overlap[own] + GAP * overlap, rcond=1e-3)
        if (outward @ way > network.overlap[own]).all() and np.linalg.norm(way) < overlap:
            motion[sphere, :3] = way
    return moved(sample, network, motion)


def _yielded(sample: Sample) -> Sample:
    """The sample with shear forces beyond the friction limit cut to half of it.

    A dynamic run would let these contacts slide.
    """
    limit = sample.friction * sample.network().force_normal
    size = np.linalg.norm(sample.shear, axis=1)
    kept = np.where(size > limit, limit / 2 / np.maximum(size, 1e-300), 1.0)
    return replace(sample, shear=sample.shear * kept[:, None])


def _at_rest(sample: Sample) -> Sample:
    still = replace(sample, velocity=None, angular_velocity=None, strain_rate=None)
    if still.shear is None:
        return replace(still, shear=np.zeros((len(still.contacts().particle_i), 2)))
    return still


def _size(vector: np.ndarray, arm: float) -> np.ndarray:
    """Shape (n,): length of each sphere's row (n, 6), its rotational part times `arm`."""
    return np.sqrt((vector[:, :3] ** 2).sum(axis=1) + (vector[:, 3:] ** 2).sum(axis=1) * arm**2)


def _step(
    sample: Sample, network: Network, load: np.ndarray, shift: np.ndarray
) -> tuple[Sample, Network, np.ndarray, Balance, int]:
    """One step that should leave no sphere worse off than twice the worst before; products K u.

    A few groups of spheres hang on ways so soft that the springs alone do not tell where they lead.
    Where the motion goes beyond the cap, or leaves a sphere with far more force than any had, the
    shift (n,) of these spheres is raised in place (Levenberg and Marquardt, sphere by sphere) and
    the step tried again, `TRIALS` times at most.
    """
    np.maximum(SHIFT, SOFTENING * shift, out=shift)
    cap = STEP_CAP * float(np.median(network.overlap))
    worst, loose = _size(load, 1 / sample.radius).max(), ~force_bearing(network)
    products = 0
    for _ in range(TRIALS):
        motion, spent = spring_motion(network, load, SOLVE_TOLERANCE, shift)
        products += spent
        size = _size(motion, sample.radius)
        motion *= np.minimum(1.0, cap / np.maximum(size, 1e-300))[:, None]
        # N grows as overlap^1.5, so a step takes 2/3 of the overlap of a sphere that one contact
        # pushes away; half as much again frees it, and a little more keeps it free.
        motion[loose] *= 1.6
        tried = moved(sample, network, motion)
        found = tried.network()
        left, new = balance_of(tried, found)
        failed = (size > cap) | (_size(left, 1 / sample.radius) > 2 * worst)
        if not failed[~loose].any():
            break
        shift[failed] *= STIFFENING
    return tried, found, left, new, products
