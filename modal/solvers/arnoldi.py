"""Find eigenpairs of an operator that is not symmetric, by Arnoldi's method (ARPACK).

The modes nearest a shift come from the inverse of the operator about it (R. B. Lehoucq, D. C.
Sorensen, C. Yang, ARPACK Users' Guide, SIAM 1998).
"""

from collections.abc import Callable

from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from modal.tools.arrays import Array, Bools
from modal.tools.errors import UnavailableError


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
    """Return eigenpairs that include at least `count` wanted ones, or all that exist.

    Parameters
    ----------
    apply : callable
        Function that multiplies a vector (size,) by the operator A.
    start : ndarray (size,)
        First vector of the iteration; its type is that of the operator.
    count : int
        Number of wanted eigenpairs.
    wanted : callable
        Function that returns which of the eigenvalues (k,) are wanted, as bool (k,).
    inverse : callable, optional
        Function that applies (A - sigma)^-1. With it the eigenvalues nearest to `sigma` are found,
        without it those of largest absolute value.
    sigma : complex, optional
        The shift.
    ask : int
        Number of eigenpairs in the first search. It is doubled while too few of them are wanted.
    basis : int
        Least number of vectors in the basis.
    tolerance : float
        Residual divided by the eigenvalue; 0 stands for round-off.
    what : str
        Name of the eigenpairs for an error message.

    Returns
    -------
    eigenvalues : ndarray (k,)
    vectors : ndarray (size, k)
        Unit vectors.

    Raises
    ------
    InputError
        If the eigenpairs do not converge; code "not_converged".
    """
    shape = (len(start), len(start))
    operator = LinearOperator(shape, apply, dtype=start.dtype)
    options = {}
    if inverse is not None:
        options["OPinv"] = LinearOperator(shape, inverse, dtype=start.dtype)
    max_eigenpairs = len(start) - 2
    while True:
        ask = min(ask, max_eigenpairs)
        basis_size = min(len(start), max(basis, 3 * ask + 20))
        try:
            eigenvalues, vectors = eigs(
                operator, ask, sigma=sigma, v0=start, ncv=basis_size, tol=tolerance, **options
            )
        except ArpackError as error:
            # ArpackNoConvergence holds the eigenvalues that did converge.
            converged = len(getattr(error, "eigenvalues", ()))
            raise UnavailableError(
                "not_converged", f"{converged} of {ask} {what} converged", remedy="ask for fewer"
            ) from error
        if wanted(eigenvalues).sum() >= count or ask == max_eigenpairs:
            return eigenvalues, vectors
        ask *= 2
