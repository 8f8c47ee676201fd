"""Factorisation of a complex symmetric W + i T, of packings whose contacts are viscous.

PARDISO, as it is had here, knows real matrices alone: it takes [[W, -T], [-T, -W]], symmetric and
of twice the size, whose solution holds the real and the imaginary part. Without it SuperLU takes
the complex matrix as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from modal.solvers.factor import SUPERLU_FILL, available, factorise
from modal.tools.arrays import Complex
from modal.tools.errors import InputError
from modal.tools.workload import refuse_above_memory

PARDISO_FILL = 1.1e3
"""Bytes of PARDISO's factor of the real form for each nonzero of W."""


@dataclass
class ComplexFactor:
    """`solve` gives (W + i T)^-1 b for complex b (size,); `release` frees its memory."""

    solve: Callable[[Complex], Complex]
    release: Callable[[], None] = lambda: None


def factorise_complex(W: sp.csr_matrix, T: sp.csr_matrix, remedy: str) -> ComplexFactor:
    """Factorise W + i T, both symmetric (size, size).

    InputError, which ends with the `remedy`, where that would take more than the free memory, and
    for a singular matrix.
    """
    pardiso, size = available("pardiso"), W.shape[0]
    fill = PARDISO_FILL if pardiso else 2 * SUPERLU_FILL
    refuse_above_memory(fill * W.nnz, "a complex factorisation", remedy)
    if pardiso:
        factor = factorise(sp.bmat([[W, -T], [-T, -W]], format="csr"), definite=False)

        def solve(rhs: Complex) -> Complex:
            both = factor.solve(np.concatenate([rhs.real, -rhs.imag]))
            return both[:size] + 1j * both[size:]

        return ComplexFactor(solve, factor.release)
    try:
        return ComplexFactor(splu((W + 1j * T).tocsc()).solve)
    except RuntimeError as error:
        raise InputError(f"a complex matrix is exactly singular here; {remedy}") from error
