"""Compute Chebyshev polynomials of an operator by recurrence: for waves, densities, filters.

T_0 = 1, T_1 = X, T_k = 2 X T_(k-1) - T_(k-2), on a vector or a block of vectors. X is linear in A;
it maps the spectrum of A, or a part of it, to the interval from -1 to 1.
"""

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from modal.tools.arrays import Array, Floats

WIDTHS = (8, 16, 24, 32, 48)
"""Numbers of columns with which a product of a block costs least. The product is compiled for each
of them when it is first used. A column of such a block takes 0.4 to 0.5 of the time of a single
vector; one of 12 columns takes 0.65."""


class ScaledOperator(Protocol):
    """The interface of a mass-scaled `ContactOperator` that the recurrences use.

    The operator is A = M^-1/2 K M^-1/2, of shape (size, size).
    """

    shape: tuple[int, int]
    pre_stress: str

    def inward(self, u: Array) -> Array:
        """Return vectors (size, k) of the particles in the numbering of the operator."""

    def outward(self, u: Array) -> Array:
        """Return vectors (size, k), given in the operator's numbering, in that of the particles."""

    def combine(
        self,
        u: Array,
        out: Array,
        alpha: float,
        beta: float = 0.0,
        gamma: float = 0.0,
        *,
        sums: Floats | None = None,
    ) -> Array:
        """Set out = alpha A u + beta u + gamma out, (size,) or (size, k), in its numbering.

        `sums` (2, 6, k) receive, by component, the sums over particles of the products out out and
        out u, with the values of `out` before the call.
        """


def chebyshev(
    operator: ScaledOperator,
    start: Floats,
    slope: float,
    offset: float,
    sums: Floats | None = None,
) -> Iterator[Floats]:
    """Yield T_k(X) start for k = 0, 1, 2, ..., where X = slope A + offset.

    `start` (size,) or (size, k), in the numbering of the operator and in C order, is overwritten.
    Each yielded array is overwritten two steps later. A product with A is computed only when the
    next order is requested. At each order k >= 2, `sums` receives the scalar products, by
    component, of T_(k-2) start with itself and with T_(k-1) start, as `ScaledOperator.combine`
    computes them.
    """
    before = start
    now = np.empty_like(start)
    yield before
    # The sums of this call have no meaning; without them another kind of loop would be compiled.
    operator.combine(before, now, slope, beta=offset, sums=sums)
    while True:
        yield now
        operator.combine(now, before, 2 * slope, beta=2 * offset, gamma=-1.0, sums=sums)
        before, now = now, before


def jackson(count: int) -> Floats:
    """Return the damping (count,) of even orders that broadens a delta to nearly a Gaussian.

    This is Jackson's kernel (Weisse et al., Rev. Mod. Phys. 78, 275, 2006) of the orders 0, 2, ...,
    2 `count` - 2; odd orders vanish and are left out. The broadened delta is positive everywhere.
    """
    orders = 2 * count
    step = np.pi / (orders + 1)
    k = np.arange(0, orders, 2)
    numerator = np.cos(k * step) * (orders + 1 - k) + np.sin(k * step) / np.tan(step)
    return numerator / (orders + 1)
