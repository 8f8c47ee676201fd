"""A search for modes near a shift, in rounds, until an exact count is satisfied."""

from __future__ import annotations

import numpy as np

from modal.eigenproblem import Eigenproblem, found_modes, frequency_of
from modal.factor import Factor, factorise
from modal.krylov import Held, modes_nearest
from modal.mode_set import ModeSet


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

    def modes(self, low: float, high: float, interval: str, of: int = 0) -> ModeSet:
        """What was found with low <= f < high, Hz, ascending; `of` as in `found_modes`."""
        self.release()
        order = np.argsort(self.square)
        frequency = frequency_of(self.square[order])
        order = order[(frequency >= low) & (frequency < high)]
        solver = f"lanczos {self.solver}, {self.solves} solves"
        return found_modes(
            self.problem, self.square[order], self.vector[:, order], interval, solver, of
        )
