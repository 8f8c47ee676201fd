"""A polynomial of A that lifts the low end of its spectrum: its lowest modes without a factor.

The Chebyshev polynomial T_d stays between -1 and 1 where its argument does, and grows beyond like
cosh(d arccosh x). With x = (top + edge - 2 omega^2) / (top - edge) the modes between `edge` and
`top` are left at 1 or less, while those below `edge` are lifted, the lowest ones furthest: a block
Lanczos finds these first. It takes d products with A where (A - sigma)^-1 takes a solve.
(Y. Saad, Math. Comp. 42, 567, 1984; H. Fang and Y. Saad, SIAM J. Sci. Comput. 34, A2220, 2012.)
"""

from dataclasses import dataclass
from itertools import islice

import numpy as np

from modal.solvers.chebyshev import ScaledOperator, chebyshev
from modal.tools.arrays import Floats

REACH = 10.0
"""Logarithm of twice what a mode at zero is lifted to. A larger one takes more products for each
vector of the basis, and fewer vectors: of 496 modes of a slender packing 1.65, 1.48 and 1.38 for
each at 7.5, 10 and 12.5. Each vector less also saves its share of keeping them orthogonal. Beyond,
round-off of what is lifted furthest nears `modal.solvers.lanczos.TOLERANCE` of the last modes."""


@dataclass(frozen=True)
class LowEnd:
    """T_d of A as above; `edge` and `top` in omega^2, 1/s^2, `top` above all omega^2."""

    operator: ScaledOperator
    edge: float
    top: float

    @property
    def degree(self) -> int:
        """Products with A for each vector.

        Odd: if a mode should lie above `top` after all, it goes far below -1, not above 1.
        """
        at_zero = np.arccosh((self.top + self.edge) / (self.top - self.edge))
        return 2 * round((REACH / at_zero - 1) / 2) + 1

    @property
    def _argument(self) -> tuple[float, float]:
        """x = c - a omega^2: c and a."""
        width = self.top - self.edge
        return (self.top + self.edge) / width, 2 / width

    def apply(self, block: Floats) -> Floats:
        """T_d(x(A)) of a block (size, k)."""
        c, a = self._argument
        start = np.array(self.operator.inward(block), order="C")
        orders = chebyshev(self.operator, start, -a, c)
        return self.operator.outward(next(islice(orders, self.degree, None)))

    def square(self, lifted: Floats) -> Floats:
        """The omega^2 (k,) of modes that are lifted to `lifted` (k,); `edge` where that is none."""
        c, a = self._argument
        return (c - np.cosh(np.arccosh(np.maximum(lifted, 1.0)) / self.degree)) / a
