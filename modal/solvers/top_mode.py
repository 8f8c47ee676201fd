"""The highest mode alone, in the memory of a few vectors: Lanczos, twice.

The largest Ritz value of plain Lanczos needs no basis that is kept orthogonal: what round-off
brings back are copies of values that have converged (C. C. Paige, Linear Algebra Appl. 34, 235,
1980). A first pass finds how the mode is made of the Lanczos vectors. A second one makes the same
vectors once more, to the bit, and adds them up. So a mode of millions of spheres fits beside their
contacts, and nothing but products takes time.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh_tridiagonal

from modal.solvers.lanczos import TOLERANCE, Nearest, start_block
from modal.solvers.spectrum import ScaledOperator, lanczos_steps, norm
from modal.tools.arrays import Floats
from modal.tools.progress import progress

LOOK = 5
"""Steps between two looks at the largest Ritz value."""


def top_mode(operator: ScaledOperator, most: int) -> Nearest:
    """The largest eigenpair of A, if it converges within `most` steps; without its vector if not.

    A residual of `TOLERANCE` relative to its eigenvalue counts as converged, as in
    `modal.solvers.lanczos`. A converged mode has taken two products a step.
    """
    start = start_block(operator.shape[0], 1)[:, 0]
    vector: Floats = np.zeros((len(start), 1))
    steps = zip(progress(most, "Lanczos"), lanczos_steps(operator, start), strict=False)
    for k, (diagonal, off, _) in steps:
        ended = k == most - 1 or off[-1] == 0
        if k % LOOK < LOOK - 1 and not ended:
            continue
        square, share = eigh_tridiagonal(
            np.array(diagonal), np.array(off[:-1]), select="i", select_range=(k, k)
        )
        converged = off[-1] * abs(share[-1, 0]) <= TOLERANCE * abs(square[0])
        if converged or ended:
            break
    if not converged:
        return Nearest(square, vector, np.array([False]), k + 1)
    again = zip(progress(k + 1, "mode"), lanczos_steps(operator, start), strict=False)
    for j, (_, _, now) in again:
        vector[:, 0] += share[j, 0] * now
    vector /= norm(vector[:, 0])
    return Nearest(square, vector, np.array([True]), 2 * (k + 1))
