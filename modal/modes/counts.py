"""Count the modes below a frequency exactly: the negative pivots of A - sigma (Sylvester's law)."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from modal.modes.effort import factorisation, refuse_endless_search, shape_of
from modal.packing.network import Network
from modal.solvers.factor import SingularError, choose
from modal.solvers.lanczos import start_block
from modal.system.contacts import PreStress, Sliding
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked, frequencies
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError, UnavailableError
from modal.tools.progress import progress

MIN_SQUARE_ABOVE_ALL = 4.0
"""An omega^2, divided by A's largest diagonal entry, above which there may be no mode at all: the
upper bound of the spectrum is then computed."""
INVERSE_ITERATIONS = 3
"""Number of inverse iterations that look for a mode at a frequency. Each multiplies the mode's
component in a random vector by the ratio of the next mode's distance to this mode's distance."""
SIDE_STEP = 1e-6
"""Relative distance in omega^2 of the two counts, below and above, that replace a count at a
frequency where none is possible."""


def check_count(system: LinearSystem, count: int, available_modes: int) -> None:
    """Raise InputError unless `count` is whole and 1 <= `count` <= `available_modes`.

    `available_modes` is the number of modes that can be listed: all degrees of freedom minus the
    zero modes, if these are not listed.
    """
    if available_modes < 1 or not system.diagonal.any():
        raise UnavailableError(
            "no_stiffness",
            "no modes to list",
            f"no spring holds any of the {system.degrees_of_freedom} motions",
            "see the contacts with `info`",
        )
    if not (isinstance(count, int | np.integer) and 1 <= count <= available_modes):
        raise InputError(
            "mode_count",
            f"{count} modes asked",
            f"the network has {system.degrees_of_freedom} degrees of freedom and {available_modes} "
            "modes to list",
            f"ask for 1 to {available_modes}",
        )


@overload
def count_modes(
    network: Network,
    frequency: float,
    *,
    sliding: Sliding = ...,
    pre_stress: PreStress = ...,
    solver: str | None = ...,
) -> int: ...


@overload
def count_modes(
    network: Network,
    frequency: Sequence[float] | Array,
    *,
    sliding: Sliding = ...,
    pre_stress: PreStress = ...,
    solver: str | None = ...,
) -> Ints: ...


@checked
def count_modes(
    network: Network,
    frequency: ArrayLike,
    *,
    sliding: Sliding = "elastic",
    pre_stress: PreStress = "none",
    solver: str | None = None,
) -> Ints | int:
    """Count the natural frequencies of a packing below each of some frequencies, exactly.

    Motions without energy, at zero, and unstable ones, whose omega^2 is negative, are included; at
    0 Hz only the unstable ones are counted. Nothing is estimated: the count follows from the signs
    of the pivots of a factorised K - omega^2 M (Sylvester's law of inertia). Round-off hides on
    which side of a frequency a mode lies if the two omega^2 differ by less than 1e-11 of the
    largest diagonal entry of M^-1 K. A mode so close to zero counts as one without energy; any
    other frequency so close to a mode is refused.

    Parameters
    ----------
    network : Network
        The packing.
    frequency : float or array_like
        Frequencies, Hz, of any shape.
    sliding : str, default "elastic"
        As in `modal.eigenmodes`.
    pre_stress : str, default "none"
        "none" or "normal".
    solver : str, optional
        A factorisation: pardiso, blocks or superlu.

    Returns
    -------
    int or ndarray of int
        The counts, in the shape of `frequency`.

    Raises
    ------
    InputError
        If a frequency is negative or lies on a mode, or K is not symmetric.

    Examples
    --------
    >>> import modal
    >>> count_modes(modal.fcc(cells=(2, 2, 20)), [1e3, 1e5, 1e6])
    array([  0,  79, 480])
    """
    system = LinearSystem.of(network, pre_stress=pre_stress, sliding=sliding, solver=solver)
    counts = counts_below(system, frequency)
    return counts if counts.ndim else int(counts)


def counts_below(system: LinearSystem, frequency: ArrayLike) -> Ints:
    """Count the modes of a system below each frequency, Hz; the counts have its shape."""
    limits = frequencies(frequency)
    if system.solver is not None:
        choose(shape_of(system), system.solver, kept=False)  # refuses one that counts no modes
    counts = [
        count_below(system, limits.flat[k], apart=True) for k in progress(limits.size, "counts")
    ]
    return np.array(counts, int).reshape(limits.shape)


def count_below(system: LinearSystem, frequency: float, *, apart: bool = False) -> int:
    """Count the modes below `frequency`, Hz, exactly, unstable and zero-energy ones included.

    The count is the number of negative eigenvalues of K - omega^2 M (Sylvester's law), read from
    the pivots of a factorisation. No factorisation can resolve an omega^2 below the
    `zero_threshold` of the system: all modes below it count as zero modes. Therefore a count above
    0 Hz is made above this threshold, and the count at 0 Hz, of the unstable modes alone, below
    minus the threshold. A factorisation may be uncertain at a frequency, because a pivot may vanish
    although no mode is near. Then counts are made a little below and a little above, and are taken
    if they agree; otherwise the factorisation by blocks is tried. Raises InputError if no method is
    certain, if K is not symmetric, and, where modes must be `apart` from the frequency, if one is
    nearer than round-off.
    """
    if not system.symmetric:
        raise InputError(
            "unsymmetric",
            f"pre-stress {system.pre_stress!r}",
            "K is not symmetric, and no factor of it counts modes",
            "take pre-stress normal, or all modes of a small packing",
        )
    if frequency <= 0 and system.semidefinite:
        return 0
    square = (2 * np.pi * frequency) ** 2
    if square <= system.zero_threshold:
        side = 1 if frequency > 0 else -1
        square = side * (1 + SIDE_STEP) * system.zero_threshold
        apart = False
    may_be_above_all = square > MIN_SQUARE_ABOVE_ALL * system.diagonal.max(initial=0.0)
    if may_be_above_all and square > system.row_sum_bound:
        return system.degrees_of_freedom
    for counts in _counts_by_method(system, square, apart):
        count = counts.pop()
        if not counts and count is not None:
            return count
    raise UnavailableError(
        "not_converged",
        f"{frequency:g} Hz",
        "a mode is so near that its side is round-off",
        "ask at a slightly different frequency",
    )


def _counts_by_method(
    system: LinearSystem, square: float, apart: bool
) -> Iterator[set[int | None]]:
    """Yield, for each factorisation, the counts that must agree.

    The counts are made at the `square` itself, in 1/s^2, or below and above it if modes must be
    `apart`. The factorisations are the chosen one, then the blocks.
    """
    cost = factorisation(system, kept=False)
    refuse_endless_search(system, cost, "an exact count takes", "take the density of states")
    chosen = choose(shape_of(system), system.direct_solver, kept=False).name
    step = max(SIDE_STEP * abs(square), system.zero_threshold if apart else 0.0)
    for solver in dict.fromkeys([chosen, "blocks"]):
        yield {_count_negative(system, square, solver, apart)}
        yield {
            _count_negative(system, square - step, solver, False),
            _count_negative(system, square + step, solver, False),
        }


def _count_negative(system: LinearSystem, square: float, solver: str, apart: bool) -> int | None:
    """Count the negative eigenvalues of A - square; None if the factorisation is not certain.

    The result is also None if modes must be `apart` from the square and one is not. The result is
    kept with the network.
    """

    def count() -> int | None:
        with suppress(SingularError):
            factor = system.factorised(square, solver=solver, kept=apart)
            on_a_mode = False
            if apart:
                distance = _distance_of_mode(factor.solve, system.size)
                on_a_mode = distance <= system.zero_threshold
            factor.release()
            return None if on_a_mode else factor.negative
        return None

    return system.cached_recent("counts", (square, solver, apart), count, lambda _: 0.0)


def _distance_of_mode(solve: Callable[[Floats], Floats], size: int) -> float:
    """Estimate the smallest absolute eigenvalue by inverse iteration from a random vector.

    `solve` applies the inverse of the matrix.
    """
    vector = start_block(size, 1)[:, 0]
    for _ in range(INVERSE_ITERATIONS):
        vector = solve(vector / np.linalg.norm(vector))
    return float(1 / np.linalg.norm(vector))
