"""The lowest modes, or those of an interval: block Lanczos on a factorised A - sigma, certified.

Floppy modes are held out, so that the list is that of the elastic ones, and the exact counts of
`modal.inertia` say whether it is complete.
"""

from __future__ import annotations

import numpy as np

from modal.eigenproblem import (
    SMALL,
    Eigenproblem,
    check_count,
    found_modes,
    frequency_of,
    subset,
)
from modal.factor import Factor, available, factorise
from modal.inertia import count_below
from modal.krylov import Held, modes_nearest
from modal.mode_set import ModeSet
from modal.modes import DENSE_LIMIT, all_modes
from modal.storage import InputError

SHIFT = 1e-7
"""Shift below zero, relative to the largest diagonal entry, that keeps the factor definite."""
SLICE = 300
"""Modes that one factorisation is asked for; wider intervals are cut by exact counts."""
EDGE = 1e-6
"""Relative distance within which two frequencies may be one, degenerate or unresolved."""


def lowest_modes(problem: Eigenproblem, count: int) -> ModeSet:
    """The `count` lowest elastic modes; floppy modes are counted, not listed.

    Certified: the exact count below the highest of them is that of the modes found. Modes that
    did not converge are left out and the certificate fails.
    """
    elastic = problem.size - problem.floppy.total
    check_count(problem, count, elastic)
    if problem.size <= SMALL or count > problem.size // 4:
        modes = all_modes(problem)
        floor = problem.size - elastic
        return subset(modes, slice(floor, floor + count), f"lowest {count}")
    if count > SLICE:
        return _lowest_by_slices(problem, count)
    sigma = -SHIFT * problem.diagonal.max()
    search = Search(problem, sigma, definite=True)
    search.ask(count)
    while len(search.square) >= count:
        # The list is complete if nothing below its top is missing; the top itself may be one of
        # several equal frequencies, of which only some were asked for.
        edge = frequency_of(np.sort(search.square)[count - 1 : count])[0] * (1 - EDGE)
        found = int((frequency_of(search.square) < edge).sum()) + problem.floppy.total
        search.release()
        missing = count_below(problem, edge) - found
        if missing == 0 or not search.ask(missing):
            break
    modes = search.modes(0.0, np.inf, f"lowest {count}")
    modes = subset(modes, slice(0, count), f"lowest {count}")
    modes.attributes["certified"] = len(search.square) >= count and missing == 0
    return modes


class Search:
    """Modes nearest a shift, found in rounds: each round holds out what the rounds before found.

    A block of start vectors sees as many modes of one frequency as it is wide. Where an exact
    count says that some are missing, another round finds them.
    """

    def __init__(self, problem: Eigenproblem, sigma: float, *, definite: bool) -> None:
        self.problem, self.sigma, self.definite = problem, sigma, definite
        self.factor: Factor | None = None
        self.solver = ""
        self.square = np.empty(0)
        self.vector = np.empty((problem.size, 0))
        self.solves = 0

    def ask(self, count: int) -> bool:
        """Search `count` more; whether any converged. The factor is kept until `release`."""
        if self.factor is None:
            shifted = self.problem.shifted(self.sigma)
            self.factor = factorise(shifted, definite=self.definite, solver=self.problem.solver)
            self.solver = self.factor.solver
        held = Held(self.problem.floppy.basis, self.vector)
        near = modes_nearest(self.factor.solve, self.problem.size, count, self.sigma, held)
        self.solves += near.solves
        self.square = np.concatenate([self.square, near.square[near.converged]])
        self.vector = np.concatenate([self.vector, near.vector[:, near.converged]], axis=1)
        return bool(near.converged.any())

    def release(self) -> None:
        """Give back the factor's memory, which a count needs."""
        if self.factor is not None:
            self.factor.release()
            self.factor = None

    def modes(self, low: float, high: float, interval: str) -> ModeSet:
        """What was found with low <= f < high, Hz, ascending."""
        self.release()
        if len(self.square) == 0:
            raise InputError(
                "no mode converged: the contrast of stiffnesses or masses leaves the lowest modes "
                "below round-off; ask for --highest, or --between further up"
            )
        order = np.argsort(self.square)
        frequency = frequency_of(self.square[order])
        order = order[(frequency >= low) & (frequency < high)]
        solver = f"lanczos {self.solver}, {self.solves} solves"
        return found_modes(
            self.problem, self.square[order], self.vector[:, order], interval, solver
        )


def modes_between(problem: Eigenproblem, low: float, high: float) -> ModeSet:
    """Every elastic mode with low <= f < high, Hz, certified by the counts at both ends.

    Intervals with more than `SLICE` modes are cut into slices, each with its own factorisation
    and its own certificate.
    """
    if not (np.isfinite(low) and np.isfinite(high)) or high <= low or high <= 0:
        raise InputError(f"the interval {low:g} to {high:g} Hz is empty; give the lower end first")
    low = max(low, 0.0)
    if problem.size <= DENSE_LIMIT:
        modes = all_modes(problem)
        first = max(int((modes.frequency < low).sum()), problem.floppy.total)
        last = max(first, int((modes.frequency < high).sum()))
        return subset(modes, slice(first, last), f"{low:g} {high:g}")
    below = {low: problem.floppy.total if low == 0 else count_below(problem, low)}
    below[high] = count_below(problem, high)
    slices = _cut(problem, low, high, below)
    parts = [_slice(problem, a, b, below[b] - below[a]) for a, b in slices]
    return _joined(parts, f"{low:g} {high:g}")


def _cut(
    problem: Eigenproblem, low: float, high: float, below: dict[float, int]
) -> list[tuple[float, float]]:
    """Cut [low, high) where exact counts leave `SLICE` modes or fewer in each slice.

    A cut in the middle of the volume f^3, as the number of waves grows; a cluster of equal
    frequencies that cannot be cut stays whole.
    """
    wanted = below[high] - below[low]
    if wanted <= SLICE or high - low < EDGE * high:
        return [(low, high)] if wanted else []
    middle = float(np.cbrt((low**3 + high**3) / 2))
    below[middle] = count_below(problem, middle)
    return [
        *_cut(problem, low, middle, below),
        *_cut(problem, middle, high, below),
    ]


def _slice(problem: Eigenproblem, low: float, high: float, wanted: int) -> ModeSet:
    """The `wanted` modes of one slice; certified if exactly so many were found in it."""
    # Both ends are equally far in omega^2: the nearest modes are those of the slice. A shift at its
    # lower end, where A - sigma is definite, needs twice as many solves.
    fast = problem.solver in (None, "pardiso") and available("pardiso")
    interior = low > 0 or fast
    sigma = (2 * np.pi) ** 2 * (low**2 + high**2) / 2
    if not interior:
        sigma = -SHIFT * problem.diagonal.max()
    search = Search(problem, sigma, definite=not interior)
    elastic = problem.size - problem.floppy.total
    missing, going = wanted, True
    while missing > 0 and going:
        ask = min(missing, elastic - len(search.square))
        going = ask > 0 and search.ask(ask)
        frequency = frequency_of(search.square)
        missing = wanted - int(((frequency >= low) & (frequency < high)).sum())
    modes = search.modes(low, high, f"{low:g} {high:g}")
    modes.attributes |= {"certified": missing == 0, "missing": missing}
    return modes


def _lowest_by_slices(problem: Eigenproblem, count: int) -> ModeSet:
    """Many lowest modes: slices up to a frequency below which there are enough."""
    top = frequency_of(np.array([problem.bound]))[0]
    high, total = top / 64, problem.floppy.total
    while high < top and count_below(problem, high) - total < count:
        high *= 2 ** (1 / 3)
    modes = modes_between(problem, 0.0, high)
    return subset(modes, slice(0, count), f"lowest {count}")


def _joined(parts: list[ModeSet], interval: str) -> ModeSet:
    """Slices in ascending order as one set."""
    if not parts:
        empty = np.empty(0)
        attributes = {"interval": interval, "certified": True, "solver": "count"}
        return ModeSet(empty, empty, empty, empty, empty, attributes=attributes)
    whole = parts[0]
    if len(parts) > 1:
        arrays = {}
        for name in vars(whole):
            columns = [getattr(part, name) for part in parts]
            if name != "attributes" and all(column is not None for column in columns):
                arrays[name] = np.concatenate(columns)
        whole = ModeSet(**arrays)
    whole.attributes = {
        "interval": interval,
        "certified": all(part.attributes["certified"] for part in parts),
        "solver": parts[0].attributes["solver"] + f"; {len(parts)} slices",
        "missing": sum(part.attributes.get("missing", 0) for part in parts),
    }
    return whole
