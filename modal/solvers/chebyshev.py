"""The one recurrence of Chebyshev polynomials of an operator: for waves, densities, and filters.

T_0 = 1, T_1 = X, T_k = 2 X T_(k-1) - T_(k-2), on a vector or a block of vectors, where X is linear
in A: between -1 and 1 where the spectrum of A is mapped into that interval.
"""

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from modal.tools.arrays import Array, Floats

WIDTHS = (8, 16, 24, 32, 48)
"""Columns of a block with which a product costs least: it is compiled for each of them when it is
first met. Each column then takes 0.4 to 0.5 of the time that a vector alone takes; 0.65 of 12."""


class ScaledOperator(Protocol):
    """What is needed of A: `modal.system.operator.ContactOperator` with `mass_scaled`."""

    shape: tuple[int, int]
    pre_stress: str

    def inward(self, u: Array) -> Array:
        """Vectors (size, k) in the operator's own numbering."""

    def outward(self, u: Array) -> Array:
        """The inverse."""

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
        """out = alpha A u + beta u + gamma out, (size,) or (size, k), in that numbering.

        Into `sums` (2, 6, k) come those of out out and of out u, by component, `out` as it came.
        """


def chebyshev(
    operator: ScaledOperator,
    start: Floats,
    slope: float,
    offset: float,
    sums: Floats | None = None,
) -> Iterator[Floats]:
    """Yield T_k(X) start for k = 0, 1, 2, ..., where X = slope A + offset.

    `start` (size,) or (size, k), in the operator's own numbering and C order, is worked on: each
    array that is yielded is overwritten two steps later. A product with A is made when the next
    order is asked for. Into `sums` come at each order k from 2 on the sums of T_(k-2) start, by
    component, with itself and with T_(k-1) start, as `combine` of the operator gives them.
    """
    before, now = start, np.empty_like(start)
    yield before
    # These sums mean nothing; without them another kind of loop would have to be compiled.
    operator.combine(before, now, slope, beta=offset, sums=sums)
    while True:
        yield now
        operator.combine(now, before, 2 * slope, beta=2 * offset, gamma=-1.0, sums=sums)
        before, now = now, before


def jackson(count: int) -> Floats:
    """Shape (count,): damping of the even orders, which makes a delta a positive near-Gaussian.

    Jackson's kernel (Weisse et al., Rev. Mod. Phys. 78, 275, 2006), of orders 0, 2, ..., 2 `count`
    - 2, odd ones left out as they vanish.
    """
    orders = 2 * count
    k, step = np.arange(0, orders, 2), np.pi / (orders + 1)
    turn = np.cos(k * step) * (orders + 1 - k) + np.sin(k * step) / np.tan(step)
    return turn / (orders + 1)
