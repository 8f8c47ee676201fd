"""Find eigenpairs of an operator that is not symmetric, by Arnoldi's method (ARPACK).

The modes nearest a shift come from the inverse of the operator about it (R. B. Lehoucq, D. C.
Sorensen, C. Yang, ARPACK Users' Guide, SIAM 1998).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from modal.tools.arrays import Array, Bools
from modal.tools.errors import UnavailableError


class Shift(NamedTuple):
    """A shift about which eigenpairs are sought.

    Attributes
    ----------
    sigma : complex
        The shift.
    inverse : callable
        Applies (A - sigma)^-1.
    """

    sigma: complex
    inverse: Callable[[Array], Array]


class ArnoldiSettings(NamedTuple):
    """Sizes of the search by Arnoldi's method.

    Attributes
    ----------
    first_count : int
        Number of eigenpairs of the first search. It is doubled while too few are wanted.
    basis : int
        Least number of vectors in the basis.
    tolerance : float
        Residual divided by the eigenvalue; 0 stands for round-off.
    """

    first_count: int
    basis: int = 0
    tolerance: float = 0.0


def eigenpairs(
    apply: Callable[[Array], Array],
    start: Array,
    count: int,
    wanted: Callable[[Array], Bools],
    settings: ArnoldiSettings,
    shift: Shift | None = None,
    *,
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
    settings : ArnoldiSettings
        Sizes of the search.
    shift : Shift, optional
        The eigenvalues nearest to it are found; without it, those of largest size.
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
    options: dict[str, Any] = {}
    if shift is not None:
        options["sigma"] = shift.sigma
        options["OPinv"] = LinearOperator(shape, shift.inverse, dtype=start.dtype)
    max_eigenpairs = len(start) - 2
    n_sought = settings.first_count
    while True:
        n_sought = min(n_sought, max_eigenpairs)
        basis_size = min(len(start), max(settings.basis, 3 * n_sought + 20))
        try:
            eigenvalues, vectors = eigs(
                operator, n_sought, v0=start, ncv=basis_size, tol=settings.tolerance, **options
            )
        except ArpackError as error:
            # ArpackNoConvergence holds the eigenvalues that did converge.
            converged = len(getattr(error, "eigenvalues", ()))
            raise UnavailableError(
                "not_converged",
                f"{converged} of {n_sought} {what} converged",
                remedy="ask for fewer",
            ) from error
        if wanted(eigenvalues).sum() >= count or n_sought == max_eigenpairs:
            return eigenvalues, vectors
        n_sought *= 2
