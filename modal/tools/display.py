"""Display results for people: numbers with engineering units, tables, and pictures."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PREFIXES = {-9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
"""Prefixes of units by their powers of ten; u stands for micro."""
TIME_UNITS = {"days": 86400.0, "h": 3600.0, "min": 60.0}
"""Units of long times, s."""


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a number with its unit and a prefix that leaves one to three digits before the point.

    >>> quantity(137616.0, "Hz"), quantity(1e5, "Pa"), quantity(0.0, "m")
    ('137.6 kHz', '100 kPa', '0 m')
    """
    if value == 0 or not math.isfinite(value):
        return f"{value:g} {unit}"
    rounded, power = _round_and_power(value, digits)
    return f"{rounded / 10.0**power:.{digits}g} {PREFIXES[power]}{unit}"


def scaled(
    values: Sequence[float], unit: str, digits: int = 4, *, prefixed: bool = True
) -> tuple[list[str], str]:
    """Return texts of numbers, and their unit with the prefix that suits the largest.

    All have as many decimals as the largest.

    >>> scaled([99976.5, 100012.3, 3.2], "Pa")
    (['100.0', '100.0', '0.0'], 'kPa')
    >>> scaled([2782.1, 549.04], "m/s", prefixed=False)
    (['2782', '549'], 'm/s')
    """
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    if largest == 0:
        return [f"{value:g}" for value in values], unit
    largest, power = _round_and_power(largest, digits)
    if not prefixed:
        power = 0
    decimals = max(0, digits - 1 - math.floor(math.log10(largest) - power))
    texts = []
    for value in values:
        # Added to zero, a number that is rounded to -0 is 0.
        rounded = round(value / 10.0**power, decimals) + 0.0
        texts.append(f"{rounded:.{decimals}f}")
    return texts, PREFIXES[power] + unit


def _round_and_power(value: float, digits: int) -> tuple[float, int]:
    """Round a number that is not zero, and return it with the power of ten of its prefix.

    Rounding comes first: 999.96 with four digits is 1 k.
    """
    rounded = float(f"{value:.{digits}g}")
    power = 3 * math.floor(math.log10(abs(rounded)) / 3)
    return rounded, min(max(power, min(PREFIXES)), max(PREFIXES))


def duration(seconds: float) -> str:
    """Return a time in the unit that suits it.

    >>> duration(45.2), duration(600.0), duration(9000.0)
    ('45 s', '10 min', '2.5 h')
    """
    for name, unit in TIME_UNITS.items():
        if seconds >= 2 * unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds:.0f} s"


def plain(value: Any, digits: int = 17) -> Any:
    """Return a value for JSON: arrays as lists, numbers rounded to `digits` digits.

    Numbers that are not finite become None.
    """
    if isinstance(value, Mapping):
        return {name: plain(item, digits) for name, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(item, digits) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") if np.isfinite(value) else None
    return value


def table(rows: list[tuple[str, str]]) -> str:
    """Return lines of names and texts, the texts in one column."""
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {text}" for name, text in rows)


class Drawn(ABC):
    """A result that has a picture."""

    @abstractmethod
    def draw(self, ax: Any) -> None:
        """Draw the picture into Axes."""

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the picture into Axes, by default those of a new figure, and return them."""
        if ax is None:
            from matplotlib import pyplot  # half a second, and not needed for numbers

            ax = pyplot.subplots()[1]
        self.draw(ax)
        return ax
