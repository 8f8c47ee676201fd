"""Rough spheres: asperities first, then a transition, then Hertz's contact of the bulk.

Three power laws that follow each other, after M. Otsubo, C. O'Sullivan, K. J. Hanley, W. W. Sim,
"The influence of particle surface roughness on elastic stiffness and dynamic response",
Geotechnique 67, 452 (2017), doi 10.1680/jgeot.16.P.050, and of Otsubo et al., Geotechnique 65, 694
(2015). S is the combined roughness, sqrt(S1^2 + S2^2) of both surfaces' root mean squares, d the
overlap from the touch of the asperities on:

    N = N1 (d / d_T1)^c                          up to N1 = S E* sqrt(2 R* S)
    N = N2 ((d - d1) / (d_T2 - d1))^b            up to N2 = 100 N1
    N = 4/3 E* sqrt(R*) (d - d1 - d2)^(3/2)      beyond

with d1 = 0.82 S, d2 = 1.24 S. That the tangent goes on without a jump fixes d_T2, b = 1.58, d_T1
and c = 2.59. In units of N1 and S all of it is one curve. Along the contact Mindlin's ratio holds,
kt / kn = 4 G* / E* = 2 (1 - nu) / (2 - nu).

The equations are those of the authors' own program, geoLAMMPS (github.com/geoLAMMPS/geoLAMMPS,
`PairGranCMHistory` in src/GRANULAR/pair_gran_CM_history.cpp at 8328d78, which names the paper of
2017 as its reference): 0.82, 1.24, 1 and 100, exponents, energy and ratio of stiffnesses; numbers
agree to the 13 digits that were compared. There a wall is smooth: `rough S 1e-12`.

Besides, J. A. Greenwood, K. L. Johnson, E. Matsubara, Wear 100, 47 (1984), abstract: Hertz's theory
errs by no more than about 7 % where alpha = S R* / a0^2 (a0: Hertz's radius of contact) is below
0.05. Here alpha is 0.045 at N2, from where on the stiffness is Hertz's, and 0.96 at N1.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.tools.errors import InputError

SHIFT_1, SHIFT_2 = 0.82, 1.24
"""d1 and d2 over S."""
RATIO = 100.0
"""N2 over N1."""
HERTZ = (0.75 * np.sqrt(2) * RATIO) ** (2 / 3)
"""Overlap of smooth spheres under N2, over S."""
TOUCH_2 = SHIFT_1 + SHIFT_2 + HERTZ
MIDDLE = 1.5 * (HERTZ + SHIFT_2) / HERTZ
TOUCH_1 = SHIFT_1 + (HERTZ + SHIFT_2) * RATIO ** (-1 / MIDDLE)
FIRST = MIDDLE * TOUCH_1 / (TOUCH_1 - SHIFT_1)
"""d_T2, b, d_T1 and c, over S."""
WORK_1 = TOUCH_1 / (FIRST + 1) - (TOUCH_1 - SHIFT_1) / (MIDDLE + 1)
WORK_2 = RATIO * ((HERTZ + SHIFT_2) / (MIDDLE + 1) - HERTZ / 2.5)
"""What the regimes before have stored beyond the present one's power law, over N1 S."""
SMOOTH, COARSE = 1e-12, 1e-3
"""m: from less than an atom, which no surface is, to what is no roughness any more."""


def regime(beyond_1: Any, beyond_2: Any) -> tuple[Any, ...]:
    """Origin and span of a power law, its exponent, size and the work before, in N1 and S."""
    first, middle, last = 1.0 - beyond_1, 1.0 * beyond_1 - beyond_2, 1.0 * beyond_2
    return (
        middle * SHIFT_1 + last * (SHIFT_1 + SHIFT_2),
        first * TOUCH_1 + middle * (HERTZ + SHIFT_2) + last * HERTZ,
        first * FIRST + middle * MIDDLE + last * 1.5,
        first + (middle + last) * RATIO,
        (middle + last) * WORK_1 + last * WORK_2,
    )


def force_and_rate(young: Any, roughness: Any, overlap: Any, radius: Any) -> tuple[Any, ...]:
    """N, N; its exponent over the way from its origin, 1/m; the work stored, J."""
    unit = roughness * young * np.sqrt(2 * radius * roughness)
    deep = overlap / roughness
    origin, span, power, size, before = regime(deep >= TOUCH_1, deep >= TOUCH_2)
    force = unit * size * ((deep - origin) / span) ** power
    way = (deep - origin) * roughness
    return force, power / way, force * way / (power + 1) + unit * roughness * before


class Rough(NamedTuple):
    """E* and G*, Pa, and the combined roughness S, m, of a contact, or of each (m,)."""

    effective_young: Any
    effective_shear: Any
    roughness: Any

    @staticmethod
    def own_numbers(numbers: Sequence[float], wall: bool) -> tuple[float]:
        """Of the spheres' roughness and, where it is another, that of the walls, m."""
        if len(numbers) not in (1, 2) or not all(SMOOTH <= one <= COARSE for one in numbers):
            raise InputError(
                "contact model rough: give the root mean square roughness of the spheres, m, and "
                f"that of the walls where it is another, as rough 1e-6; {SMOOTH:g} to {COARSE:g}"
            )
        return (float(np.hypot(numbers[0], numbers[-1 if wall else 0])),)

    def normal_force(self, overlap: Any, radius: Any) -> Any:
        """The three power laws."""
        return force_and_rate(self.effective_young, self.roughness, overlap, radius)[0]

    def elastic_energy(self, overlap: Any, radius: Any) -> Any:
        """The integral of the force."""
        return force_and_rate(self.effective_young, self.roughness, overlap, radius)[2]

    def stiffness_normal(self, overlap: Any, radius: Any) -> Any:
        """The derivative of the force."""
        force, rate, _ = force_and_rate(self.effective_young, self.roughness, overlap, radius)
        return force * rate

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Any:
        """kn 4 G* / E*."""
        force, rate, _ = force_and_rate(self.effective_young, self.roughness, overlap, radius)
        return force * rate * (4 * self.effective_shear / self.effective_young)

    def overlap_of_force(self, force: Any, radius: Any) -> Any:
        """Each of the three power laws has its inverse."""
        unit = self.roughness * self.effective_young * np.sqrt(2 * radius * self.roughness)
        load = force / unit
        origin, span, power, size, _ = regime(load >= 1, load >= RATIO)
        return self.roughness * (origin + span * (load / size) ** (1 / power))


LAW = Rough
