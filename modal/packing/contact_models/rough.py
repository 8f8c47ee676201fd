"""Model contacts of rough spheres: first asperities, then a transition, then Hertz's contact.

Three power laws follow each other, after M. Otsubo, C. O'Sullivan, K. J. Hanley, W. W. Sim, "The
influence of particle surface roughness on elastic stiffness and dynamic response", Geotechnique 67,
452 (2017), doi 10.1680/jgeot.16.P.050, and of Otsubo et al., Geotechnique 65, 694 (2015). S is the
combined roughness, sqrt(S1^2 + S2^2), where S1 and S2 are the root mean squares of both surfaces; d
is the overlap, counted from the first touch of asperities:

    N = N1 (d / d_T1)^c                          up to N1 = S E* sqrt(2 R* S)
    N = N2 ((d - d1) / (d_T2 - d1))^b            up to N2 = 100 N1
    N = 4/3 E* sqrt(R*) (d - d1 - d2)^(3/2)      beyond

with d1 = 0.82 S, d2 = 1.24 S. d_T2, b = 1.58, d_T1 and c = 2.59 follow from a continuous tangent.
In units of N1 and S all contacts have the same curve. Along the contact Mindlin's ratio holds, kt /
kn = 4 G* / E* = 2 (1 - nu) / (2 - nu).

The equations are those of the authors' own program, geoLAMMPS (github.com/geoLAMMPS/geoLAMMPS,
`PairGranCMHistory` in src/GRANULAR/pair_gran_CM_history.cpp at 8328d78, which names the paper of
2017 as its reference): 0.82, 1.24, 1 and 100, exponents, energy and ratio of stiffnesses; the
results agree to all 13 digits that were compared. In that program walls are smooth: `rough S
1e-12`.

J. A. Greenwood, K. L. Johnson, E. Matsubara, Wear 100, 47 (1984), abstract: Hertz's theory errs by
no more than about 7 % where alpha = S R* / a0^2 (a0: Hertz's radius of contact) is below 0.05. Here
alpha is 0.96 at N1 and 0.045 at N2, beyond which the stiffness is Hertz's.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.tools.errors import InputError

SHIFT_1 = 0.82
"""Ratio d1 / S of the model."""
SHIFT_2 = 1.24
"""Ratio d2 / S of the model."""
FORCE_RATIO = 100.0
"""Ratio N2 / N1 of the model."""
HERTZ_OVERLAP = (0.75 * np.sqrt(2) * FORCE_RATIO) ** (2 / 3)
"""Overlap of smooth spheres under N2, divided by S."""
TOUCH_2 = SHIFT_1 + SHIFT_2 + HERTZ_OVERLAP
"""Ratio d_T2 / S of the model."""
EXPONENT_2 = 1.5 * (HERTZ_OVERLAP + SHIFT_2) / HERTZ_OVERLAP
"""Exponent b of the second power law."""
TOUCH_1 = SHIFT_1 + (HERTZ_OVERLAP + SHIFT_2) * FORCE_RATIO ** (-1 / EXPONENT_2)
"""Ratio d_T1 / S of the model."""
EXPONENT_1 = EXPONENT_2 * TOUCH_1 / (TOUCH_1 - SHIFT_1)
"""Exponent c of the first power law."""
WORK_1 = TOUCH_1 / (EXPONENT_1 + 1) - (TOUCH_1 - SHIFT_1) / (EXPONENT_2 + 1)
"""Energy at d_T1, divided by N1 S, beyond that of the second power law."""
WORK_2 = FORCE_RATIO * ((HERTZ_OVERLAP + SHIFT_2) / (EXPONENT_2 + 1) - HERTZ_OVERLAP / 2.5)
"""Energy at d_T2, divided by N1 S, of the second power law beyond that of the third."""
MIN_ROUGHNESS = 1e-12
"""Least roughness, m: less than an atom, so that no surface is as smooth."""
MAX_ROUGHNESS = 1e-3
"""Largest roughness, m: more than that is shape."""


def select_power_law(beyond_1: Any, beyond_2: Any) -> tuple[Any, ...]:
    """Return origin, span, exponent, force and earlier work of the power law for each overlap.

    Lengths are in units of S, forces of N1, works of N1 S. `beyond_1` and `beyond_2` say whether
    the overlap is beyond the first and the second power law.
    """
    in_1 = 1.0 - beyond_1
    in_2 = 1.0 * beyond_1 - beyond_2
    in_3 = 1.0 * beyond_2
    origin = in_2 * SHIFT_1 + in_3 * (SHIFT_1 + SHIFT_2)
    span = in_1 * TOUCH_1 + in_2 * (HERTZ_OVERLAP + SHIFT_2) + in_3 * HERTZ_OVERLAP
    exponent = in_1 * EXPONENT_1 + in_2 * EXPONENT_2 + in_3 * 1.5
    size = in_1 + (in_2 + in_3) * FORCE_RATIO
    earlier_work = (in_2 + in_3) * WORK_1 + in_3 * WORK_2
    return origin, span, exponent, size, earlier_work


def force_rate_and_energy(
    young: Any, roughness: Any, overlap: Any, radius: Any
) -> tuple[Any, Any, Any]:
    """Return the force, N, its derivative divided by the force itself, 1/m, and the energy, J."""
    unit = roughness * young * np.sqrt(2 * radius * roughness)
    depth = overlap / roughness
    origin, span, exponent, size, earlier_work = select_power_law(
        depth >= TOUCH_1, depth >= TOUCH_2
    )
    force = unit * size * ((depth - origin) / span) ** exponent
    path = (depth - origin) * roughness
    energy = force * path / (exponent + 1) + unit * roughness * earlier_work
    return force, exponent / path, energy


class Rough(NamedTuple):
    """A rough contact, or many: E* and G*, Pa, and the combined roughness S, m; numbers or (m,)."""

    effective_young: Any
    effective_shear: Any
    roughness: Any

    @staticmethod
    def own_numbers(numbers: Sequence[float], wall: bool) -> tuple[float]:
        """Return the combined roughness, m.

        `numbers` are the roughness of the spheres and, if it differs, that of the walls, m.
        """
        in_range = all(MIN_ROUGHNESS <= number <= MAX_ROUGHNESS for number in numbers)
        if len(numbers) not in (1, 2) or not in_range:
            raise InputError(
                "roughness",
                "contact model rough",
                "give the root mean square roughness of the spheres, m, and "
                "that of the walls where it is another, as rough 1e-6",
                f"{MIN_ROUGHNESS:g} to {MAX_ROUGHNESS:g}",
            )
        other = numbers[-1] if wall else numbers[0]
        return (float(np.hypot(numbers[0], other)),)

    def normal_force(self, overlap: Any, radius: Any) -> Any:
        """Return the force of the three power laws, N."""
        return force_rate_and_energy(self.effective_young, self.roughness, overlap, radius)[0]

    def elastic_energy(self, overlap: Any, radius: Any) -> Any:
        """Return the integral of the force, J."""
        return force_rate_and_energy(self.effective_young, self.roughness, overlap, radius)[2]

    def stiffness_normal(self, overlap: Any, radius: Any) -> Any:
        """Return the derivative of the force, N/m."""
        force, rate, _ = force_rate_and_energy(
            self.effective_young, self.roughness, overlap, radius
        )
        return force * rate

    def stiffness_tangential(self, overlap: Any, radius: Any) -> Any:
        """Return the tangential stiffness kt = 4 G* / E* kn, N/m."""
        force, rate, _ = force_rate_and_energy(
            self.effective_young, self.roughness, overlap, radius
        )
        return force * rate * (4 * self.effective_shear / self.effective_young)

    def overlap_of_force(self, force: Any, radius: Any) -> Any:
        """Return the overlap, m, by the inverse of the power law for the force, N."""
        unit = self.roughness * self.effective_young * np.sqrt(2 * radius * self.roughness)
        load = force / unit
        origin, span, exponent, size, _ = select_power_law(load >= 1, load >= FORCE_RATIO)
        return self.roughness * (origin + span * (load / size) ** (1 / exponent))


LAW = Rough
