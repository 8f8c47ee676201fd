"""Eigenpairs of an operator that is not symmetric, by ARPACK's method of Arnoldi.

The modes nearest a shift come from the inverse of the operator about it (R. B. Lehoucq, D. C.
Sorensen, C. Yang, ARPACK Users' Guide, SIAM 1998).
"""

from collections.abc import Callable

from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from modal.tools.arrays import Array, Bools
from modal.tools.errors import InputError


def eigenpairs(
    apply: Callable[[Array], Array],
    start: Array,
    count: int,
    wanted: Callable[[Array], Bools],
    *,
    inverse: Callable[[Array], Array] | None = None,
    sigma: complex | None = None,
    ask: int,
    basis: int,
    tolerance: float = 0.0,
    what: str = "modes",
) -> tuple[Array, Array]:
    """Eigenvalues (k,) and unit vectors (size, k), of which `count` or more are `wanted`, or all.

    They are nearest to `sigma`, where `inverse` applies (A - sigma)^-1, or else largest in size.
    `start` (size,) is the first vector, `ask` how many are looked for at first, in a `basis` of so
    many vectors at least; twice as many follow where too few are wanted. `tolerance`: residual over
    the eigenvalue, zero for round-off; `what` they are called. InputError where they do not
    converge.
    """
    shape = 2 * (len(start),)
    operator = LinearOperator(shape, apply, dtype=start.dtype)
    given = {} if inverse is None else {"OPinv": LinearOperator(shape, inverse, dtype=start.dtype)}
    most = len(start) - 2
    while True:
        ask = min(ask, most)
        size = min(len(start), max(basis, 3 * ask + 20))
        try:
            value, vector = eigs(
                operator, ask, sigma=sigma, v0=start, ncv=size, tol=tolerance, **given
            )
        except ArpackError as error:
            # Its subclass for a search without an end has what did converge.
            done = len(getattr(error, "eigenvalues", ()))
            raise InputError(f"{done} of {ask} {what} converged; ask for fewer") from error
        if wanted(value).sum() >= count or ask == most:
            return value, vector
        ask *= 2
