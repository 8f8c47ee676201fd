"""Lift the low end of a spectrum by a polynomial: the lowest modes of A without a factor.

The Chebyshev polynomial T_d stays between -1 and 1 for arguments in this interval, and grows beyond
it like cosh(d arccosh x). With x = (top + edge - 2 omega^2) / (top - edge) the modes between `edge`
and `top` are multiplied by 1 or less, while those below `edge` are multiplied by more ("lifted"),
the lowest modes by most, so that block Lanczos finds these first. T_d takes d products with A
instead of a solve with A - sigma. (Y. Saad, Math. Comp. 42, 567, 1984; H. Fang and Y. Saad, SIAM J.
Sci. Comput. 34, A2220, 2012.)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from modal.solvers.chebyshev import ScaledOperator, chebyshev
from modal.tools.arrays import Floats

LOG_TWICE_LIFT_AT_ZERO = 10.0
"""Logarithm of twice the factor by which the polynomial multiplies a mode at zero. A larger factor
takes more products for each vector of the basis, and fewer vectors: 496 modes of a slender packing
took 1.65, 1.48 and 1.38 vectors each at 7.5, 10 and 12.5. Each vector that is saved also saves its
orthogonalisation. Above 12.5, the round-off of the modes multiplied by most comes near
`modal.solvers.lanczos.TOLERANCE` of the last modes."""
MAX_EDGE_SHARE = 0.9
"""Highest edge, divided by the top of the spectrum."""


@dataclass(frozen=True)
class LowEnd:
    """The polynomial T_d of A that lifts the modes below `edge`.

    Attributes
    ----------
    operator : ScaledOperator
        The operator A.
    edge, top : float
        omega^2, 1/s^2: the end of the lifted modes, and a value above all omega^2.
    """

    operator: ScaledOperator
    edge: float
    top: float

    @property
    def degree(self) -> int:
        """Return the degree d, the number of products with A for each vector.

        It is odd: if a mode lies above `top` after all, its T_d is far below -1, not above 1.
        """
        at_zero = np.arccosh((self.top + self.edge) / (self.top - self.edge))
        return 2 * round((LOG_TWICE_LIFT_AT_ZERO / at_zero - 1) / 2) + 1

    @property
    def _offset_and_slope(self) -> tuple[float, float]:
        """Return c and a of the polynomial's argument x = c - a omega^2; a in s^2."""
        width = self.top - self.edge
        return (self.top + self.edge) / width, 2 / width

    def raised(self, factor: float) -> LowEnd:
        """Return the polynomial whose edge is `factor` times as high, at most `MAX_EDGE_SHARE`."""
        return replace(self, edge=min(factor * self.edge, MAX_EDGE_SHARE * self.top))

    @property
    def highest(self) -> bool:
        """Tell whether the edge can be raised no further."""
        return self.edge >= MAX_EDGE_SHARE * self.top

    def apply(self, block: Floats) -> Floats:
        """Return the polynomial T_d of A applied to a block (size, k)."""
        offset, slope = self._offset_and_slope
        start = np.array(self.operator.inward(block), order="C")
        orders = chebyshev(self.operator, start, -slope, offset)
        return self.operator.outward(next(islice(orders, self.degree, None)))

    def square(self, lifted: Floats) -> Floats:
        """Return the omega^2 (k,) of modes from their lifted values (k,).

        A value of 1 or less belongs to a mode above `edge`; the result is then `edge`.
        """
        offset, slope = self._offset_and_slope
        argument = np.cosh(np.arccosh(np.maximum(lifted, 1.0)) / self.degree)
        return (offset - argument) / slope
