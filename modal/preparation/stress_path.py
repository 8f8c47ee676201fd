"""Stresses that a packing is brought to: isotropic ones in turn, and unequal ones after them."""

from dataclasses import dataclass
from typing import Final

from modal.preparation.protocol import STRESSES
from modal.preparation.study import PEAK, Study
from modal.tools.errors import InputError

PRESSURES = (1e5, 1e6, 1e7)
"""Pressures, Pa, of states without friction, after the peak."""
MIN_PRESSURE = 10.0
"""Lowest stress, Pa, of a state of glass spheres: at lower ones round-off hides the overlaps."""
MAX_PEAK_RATIO = 10.0
"""Largest peak pressure that is accepted, divided by the usual peak, `PEAK`."""
RATIO_RANGE: Final = (0.05, 20.0)
"""Ratios of lateral to axial stress that are attempted."""


@dataclass(frozen=True)
class StressPath:
    """Stresses to which a packing is brought, one after the other.

    Attributes
    ----------
    stresses : tuple of float, optional
        Stresses, Pa; if empty, those of the study, multiplied by the hardness of the spheres.
    peak : float, optional
        Peak pressure of packings without friction, Pa; by default that of the study.
    stress_ratio : float, optional
        Ratio of lateral to axial stress to which each isotropic state is loaded further.
    oedometric : bool, default False
        Whether the spheres are compressed along z alone, from a tenth of the first stress to each
        axial stress.
    """

    stresses: tuple[float, ...] = ()
    peak: float | None = None
    stress_ratio: float | None = None
    oedometric: bool = False

    @property
    def is_isotropic(self) -> bool:
        """Whether all states have equal stresses along all axes."""
        return self.stress_ratio is None and not self.oedometric

    def targets(self, study: Study) -> list[float]:
        """Return the stresses of the states, Pa: axial ones where stresses are unequal.

        Raises InputError for stresses that the spheres of the study do not bear, and for unequal
        stresses that are contradictory, frictionless or extreme.
        """
        hardness = study.mixture.hardness
        self._refuse_stresses(hardness)
        targets = list(self.stresses)
        if not targets:
            usual_stresses = STRESSES if study.mu_comp else PRESSURES
            targets = [stress * hardness for stress in usual_stresses]
        if self.peak is not None:
            _refuse_peak(self.peak, max(targets), PEAK * hardness)
        self._refuse_unequal_stresses(study.mu_comp)
        return targets

    def _refuse_stresses(self, hardness: float) -> None:
        """Raise InputError for a stress, Pa, outside the range for spheres of this hardness."""
        for stress in self.stresses:
            if not MIN_PRESSURE * hardness <= stress <= PEAK * hardness:
                raise InputError(
                    "stress",
                    f"stress {stress:g} Pa",
                    f"outside {MIN_PRESSURE * hardness:g} Pa to {PEAK * hardness:g} Pa",
                    "give it in Pa",
                )

    def _refuse_unequal_stresses(self, friction: float) -> None:
        """Raise InputError for unequal stresses that are contradictory, frictionless or extreme."""
        ratio = self.stress_ratio
        if self.oedometric and ratio is not None:
            raise InputError(
                "ratio_and_oedometric",
                "a stress ratio of one-dimensional compression comes about",
                remedy="leave one out",
            )
        if friction == 0 and not self.is_isotropic:
            raise InputError(
                "unequal_stress_without_friction",
                "unequal stresses need friction, without which spheres flow",
                remedy="give some",
            )
        lowest, highest = RATIO_RANGE
        if ratio is not None and not lowest <= ratio <= highest:
            raise InputError(
                "stress_ratio",
                f"stress ratio {ratio:g}",
                f"lateral over axial stress, {lowest:g} to {highest:g}",
                "few packings hold less than 0.3",
            )


def _refuse_peak(peak: float, max_stress: float, usual: float) -> None:
    """Raise InputError for a peak, Pa, below the largest stress, or far above the usual peak."""
    if not max_stress <= peak <= MAX_PEAK_RATIO * usual:
        raise InputError(
            "peak",
            f"peak {peak:g} Pa",
            f"below one of the stresses, or above {MAX_PEAK_RATIO * usual:g} Pa",
            f"{usual:g} is usual",
        )
