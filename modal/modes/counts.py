"""Exact number of modes below a frequency: the negative pivots of A - sigma, by Sylvester's law.

And how many modes may be asked of lists.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from modal.modes.effort import factorisation, refuse_endless_search, shape_of
from modal.packing.network import Network
from modal.solvers.factor import SingularError, choose
from modal.solvers.lanczos import start_block
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked, frequencies
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError, UnavailableError
from modal.tools.progress import progress


def check_count(system: LinearSystem, count: int, available_modes: int) -> None:
    """Raise InputError unless `count` is whole and 1 <= `count` <= `available_modes`.

    `available_modes` is the number of modes that can be listed: all degrees of freedom, less the
    zero modes where these are not listed.
    """
    if available_modes < 1 or not system.diagonal.any():
        raise UnavailableError(
            "no_stiffness",
            "no modes to list",
            f"no spring holds any of the {system.size} motions",
            "see the contacts with `info`",
        )
    if not (isinstance(count, int | np.integer) and 1 <= count <= available_modes):
        raise InputError(
            "input",
            f"{count} modes asked, the network has {system.size} degrees of freedom and "
            f"{available_modes} modes to list",
            remedy=f"ask for 1 to {available_modes}",
        )


BEYOND = 4.0
"""Times A's largest diagonal entry: for an omega^2 above it the upper bound of the spectrum is
computed, since there may be no modes above it at all."""
SOLVES = 3
"""Solves of an inverse iteration that looks for a mode at a frequency: each multiplies its share of
a random vector by how much nearer it is than the next mode."""
BESIDE = 1e-6
"""How far beside a frequency, relative in omega^2, one counts that cannot count at it."""


@overload
def count_modes(network: Network, frequency: float, **options: str | None) -> int: ...


@overload
def count_modes(
    network: Network, frequency: Sequence[float] | Array, **options: str | None
) -> Ints: ...


@checked  # type: ignore[misc]  # the overloads leave the options to the function itself
def count_modes(
    network: Network,
    frequency: ArrayLike,
    *,
    sliding: str = "elastic",
    pre_stress: str = "none",
    solver: str | None = None,
) -> Ints | int:
    """How many natural frequencies a packing has below each of some frequencies, exactly.

    Motions without energy count, as they lie at zero, and so do unstable ones, whose omega^2 is
    negative: at 0 Hz the count is theirs alone. Nothing is estimated: the signs of a factorised K -
    omega^2 M tell (Sylvester's law of inertia). Round-off hides the side of modes within 1e-11 of
    the largest diagonal entry of M^-1 K, in omega^2. So near to zero a motion is one without
    energy; elsewhere a frequency with a mode so near is refused.

    Parameters
    ----------
    network : Network
        The packing.
    frequency : float or array_like
        Hz, of any shape.
    sliding : str, default "elastic"
        As of `modal.eigenmodes`.
    pre_stress : str, default "none"
        Or "normal".
    solver : str, optional
        A factorisation: pardiso, blocks or superlu.

    Returns
    -------
    int or ndarray of int
        The counts, in the shape of `frequency`.

    Raises
    ------
    InputError
        Where a frequency is negative or lies on a mode.

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
    """As `count_modes`, of a system that is at hand; an array in the shape of `frequency`."""
    asked = frequencies(frequency)
    counts = [
        count_below(system, asked.flat[k], apart=True) for k in progress(asked.size, "counts")
    ]
    return np.array(counts, int).reshape(asked.shape)


def count_below(system: LinearSystem, frequency: float, *, apart: bool = False) -> int:
    """Exact number of modes below `frequency` (Hz), unstable and zero-energy ones included.

    It is the number of negative eigenvalues of K - omega^2 M (Sylvester's law), read from pivots
    of a factorisation. No factorisation can tell the sides of an omega^2 below the system's `zero`:
    all modes so low are zero modes, and the count above 0 Hz is made just above them, that at 0 Hz,
    of the unstable modes alone, just below. A factorisation may be uncertain at this very
    frequency, since a pivot may vanish although no mode is near. Then it is made a little below and
    a little above, and counts if both agree; otherwise that of the blocks is tried. InputError
    where no way is certain, and, if the modes must be `apart` from the frequency, where one is
    nearer than round-off.
    """
    if not system.symmetric:
        raise InputError(
            "input",
            f"pre-stress {system.pre_stress!r}",
            "K is not symmetric, and no factor of it counts modes",
            "take pre-stress normal, or all modes of a small packing",
        )
    if frequency <= 0 and system.semidefinite:
        return 0
    square = (2 * np.pi * frequency) ** 2
    if square <= system.zero_threshold:
        square = (1 if frequency > 0 else -1) * (1 + BESIDE) * system.zero_threshold
        apart = False
    if square > BEYOND * system.diagonal.max(initial=0.0) and square > system.bound:
        return system.size
    for counts in _by_factors(system, square, apart):
        count = counts.pop()
        if not counts and count is not None:
            return count
    raise UnavailableError(
        "not_converged",
        f"{frequency:g} Hz",
        "a mode is so near that its side is round-off",
        "ask at a slightly different frequency",
    )


def _by_factors(system: LinearSystem, square: float, apart: bool) -> Iterator[set[int | None]]:
    """Of one way after the other the negative eigenvalues of A - square, at places that must agree.

    A little beside the square, where none can tell at it; and by the blocks.
    """
    cost = factorisation(system, kept=False)
    refuse_endless_search(system, cost, "an exact count takes", "take the density of states")
    chosen = choose(shape_of(system), system.solver, kept=False).name
    step = max(BESIDE * abs(square), system.zero_threshold if apart else 0.0)
    for solver in dict.fromkeys([chosen, "blocks"]):
        yield {_negative(system, square, solver, apart)}
        yield {_negative(system, square + off, solver, False) for off in (-step, step)}


def _negative(system: LinearSystem, square: float, solver: str, apart: bool) -> int | None:
    """Negative eigenvalues of A - square; None where this factorisation cannot tell.

    Nor can it where modes must be `apart` and one is not. What was told once is kept.
    """

    def told() -> int | None:
        with suppress(SingularError):
            factor = system.factorised(square, solver=solver, kept=apart)
            on_a_mode = apart and _distance(factor.solve, system.size) <= system.zero_threshold
            factor.release()
            return None if on_a_mode else factor.negative
        return None

    return system.kept("counts", (square, solver, apart), told, lambda _: 0.0)


def _distance(solve: Callable[[Floats], Floats], size: int) -> float:
    """How far the eigenvalue next to zero is from it, by inverse iteration from a random vector."""
    vector = start_block(size, 1)[:, 0]
    for _ in range(SOLVES):
        vector = solve(vector / np.linalg.norm(vector))
    return float(1 / np.linalg.norm(vector))
