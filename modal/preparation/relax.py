"""A sample brought into the balance of its contact law, by damped motion at a fixed cell.

What a dynamic run leaves unbalanced would move by itself while a wave of some nanometres passes.
Only the end matters here, not the way: each sphere is given a mass in proportion to the stiffness
of its contacts, so that all of them move as fast as the time step allows (dynamic relaxation,
Otter, Proc. Inst. Civ. Eng. 35, 633, 1966), with the local damping of Cundall (1987) for what is
fast and a drag for what is slow. Contacts slide on the way; a packing that rests holds by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modal.formats.hdf5 import InputError
from modal.packing.network import Network
from modal.packing.sample import Sample
from modal.packing.state import friction_used, net_forces
from modal.preparation.moving_contacts import MovingContacts

PACE = 0.3
"""Squared time step over mass per sum of kn. For each contact kn (n.d)^2 + kt |d_t|^2 is at most
2 kn (u_i^2 + u_j^2) + 4 kt (u_t^2 + (R theta)^2) summed over both ends; with kt <= 0.9 kn and
inertia 2/5 m R^2 the largest omega^2 is below 9 PACE, the leapfrog limit is 4."""
LIGHTEST = 0.02
"""Least mass, over the mean: free spheres must not be light when they meet others."""
LOCAL_DAMPING = 0.3
DRAG = 0.3
"""Share of the velocity lost at each step, times the length in diameters: half of what is critical
for the longest wave along the packing, whose frequency falls as its length grows."""
OWN_DRAG = 0.3
"""What a sphere's own velocity feels of it; the rest acts on the mean velocity of each layer, so
that waves die and a loose sphere that has some micrometres to go is not held up."""
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
MAX_STEPS = 60_000


@dataclass
class Balance:
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


def balance_of(sample: Sample, network: Network) -> tuple[np.ndarray, Balance]:
    """Net forces (n, 6) and how far from balance the sample is."""
    load = net_forces(network)
    if network.n_contacts == 0:
        return load, Balance(0.0, 0.0, 0.0, 0, 0)
    mean = network.known("force_normal", "balance").mean()
    size = _size(load, 1 / _each(sample))
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
    max_steps: int = MAX_STEPS,
    watch: Callable[[Balance], None] | None = None,
) -> tuple[Sample, Balance]:
    """The sample in balance under its law; raises InputError if it does not come to rest.

    It needs friction: frictionless packings have motions that nothing resists. The tolerance is
    raised to what round-off of the positions allows; a sample that stalls below `NEAR` is given
    back with a balance that is not `at_rest`. Contacts slide at `RESERVE` of the friction. `watch`
    sees the balance every `LOOK` steps.
    """
    if not 0 < sample.friction < np.inf:
        raise InputError(
            f"friction {sample.friction:g}: a balance of contacts needs friction; "
            "give a positive one"
        )
    contacts = MovingContacts(sample, RESERVE * sample.friction)
    length, radius = float(sample.walls[1] - sample.walls[0]), _each(sample)
    diameter = 2 * sample.radius
    if contacts.touching == 0:
        raise InputError("the sample has no contacts; compress it before it is brought to rest")
    overlap = float(np.median(sample.contacts().overlap))
    attainable = float(10 * np.finfo(float).eps * length / overlap)
    goal = max(tolerance, attainable)
    drag = DRAG * diameter / length
    # Rotations as arcs, so that one mass serves all six: m R^2 for an inertia of 2/5 m R^2.
    arm = np.repeat(np.column_stack([np.ones_like(radius), radius]), 3, axis=1)
    lightness = np.array([1.0] * 3 + [2.5] * 3)
    velocity = np.zeros((len(sample.position), 6))
    height = sample.position[:, 2] - sample.position[:, 2].min()
    layer = (height / diameter).astype(int)
    in_layer = np.maximum(np.bincount(layer), 1)
    for step in range(max_steps + 1):
        if contacts.touching == 0:
            raise InputError(
                f"the spheres come apart at {RESERVE:g} of their friction; give them more of it, "
                "or compress the sample further first"
            )
        push = contacts.load / arm
        if step % LOOK == 0:
            size = _size(contacts.load, 1 / radius) / contacts.mean_force
            state = Balance(
                float(size.mean()),
                float(size.max()),
                np.nan,
                contacts.sliding,
                contacts.touching,
                step,
            )
            if watch:
                watch(state)
            # The sample is what counts: its overlaps follow from the positions once more.
            if state.within(goal):
                if _end(contacts, step)[1].within(goal):
                    break
                # It holds no part of the shear forces along the contacts.
                contacts.level_shear()
        mass = np.maximum(contacts.stiffness, LIGHTEST * contacts.stiffness.mean()) / PACE
        push -= LOCAL_DAMPING * np.copysign(push, velocity)
        velocity += push * (lightness / mass[:, None])
        velocity *= 1 - OWN_DRAG * drag
        for axis in range(3):
            mean = np.bincount(layer, velocity[:, axis]) / in_layer
            velocity[:, axis] -= drag * mean[layer]
        contacts.move(velocity / arm)
    rested, state = _end(contacts, step)
    if not state.within(max(NEAR, goal)):
        raise InputError(
            f"the sample does not come to rest (residual {state.residual:.1e}, of a single sphere "
            f"{state.largest:.1e}, after {step} steps); let its dynamics settle further first"
        )
    state.tolerance, state.attainable, state.at_rest = tolerance, attainable, state.within(goal)
    return rested, state


def _end(contacts: MovingContacts, step: int) -> tuple[Sample, Balance]:
    rested = contacts.sample()
    _, state = balance_of(rested, rested.network())
    state.steps = step
    return rested, state


def _each(sample: Sample) -> np.ndarray:
    """Shape (n,), m: the radius of each sphere."""
    return np.full(len(sample.position), sample.sizes)


def _size(vector: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Shape (n,): length of each sphere's row (n, 6), its rotational part times `arm` (n,)."""
    return np.sqrt((vector[:, :3] ** 2).sum(axis=1) + (vector[:, 3:] ** 2).sum(axis=1) * arm**2)
