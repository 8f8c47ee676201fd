"""What people see of results: numbers with engineering units, and the Axes that a picture is in."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PREFIXES = {-9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
"""Power of ten: its prefix; u stands for micro."""


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """A number with its unit and a prefix that leaves one to three digits before the point.

    >>> quantity(137616.0, "Hz"), quantity(1e5, "Pa"), quantity(0.0, "m")
    ('137.6 kHz', '100 kPa', '0 m')
    """
    if value == 0 or not math.isfinite(value):
        return f"{value:g} {unit}"
    rounded, power = _rounded(value, digits)
    return f"{rounded / 10.0**power:.{digits}g} {PREFIXES[power]}{unit}"


def scaled(
    values: Sequence[float], unit: str, digits: int = 4, *, prefixed: bool = True
) -> tuple[list[str], str]:
    """Texts of numbers, and their unit with the one prefix that suits the largest.

    They have as many decimals as that one has.

    >>> scaled([99976.5, 100012.3, 3.2], "Pa")
    (['100.0', '100.0', '0.0'], 'kPa')
    >>> scaled([2782.1, 549.04], "m/s", prefixed=False)
    (['2782', '549'], 'm/s')
    """
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    if largest == 0:
        return [f"{value:g}" for value in values], unit
    largest, power = _rounded(largest, digits)
    power = power if prefixed else 0
    decimals = max(0, digits - 1 - math.floor(math.log10(largest) - power))
    # Added to zero, a number that is rounded to -0 is 0.
    rounded = (round(value / 10.0**power, decimals) + 0.0 for value in values)
    return [f"{value:.{decimals}f}" for value in rounded], PREFIXES[power] + unit


def _rounded(value: float, digits: int) -> tuple[float, int]:
    """A number that is not zero, and the power of ten, a multiple of three, of its prefix.

    Rounded first: 999.96 with four digits is 1 k.
    """
    rounded = float(f"{value:.{digits}g}")
    power = 3 * math.floor(math.log10(abs(rounded)) / 3)
    return rounded, min(max(power, min(PREFIXES)), max(PREFIXES))


def duration(seconds: float) -> str:
    """A time in the unit that suits it.

    >>> duration(45.2), duration(600.0), duration(9000.0)
    ('45 s', '10 min', '2.5 h')
    """
    for name, unit in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds:.0f} s"


def plain(value: Any, digits: int = 17) -> Any:
    """As JSON has it, to so many digits: arrays as lists; what is not finite is None."""
    if isinstance(value, Mapping):
        return {name: plain(cell, digits) for name, cell in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(cell, digits) for cell in value]
    value = value.item() if isinstance(value, np.generic) else value
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") if np.isfinite(value) else None
    return value


def table(rows: list[tuple[str, str]]) -> str:
    """Lines of names and what they are, the latter in one column."""
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {text}" for name, text in rows)


class Drawn:
    """A result that has a picture."""

    def draw(self, ax: Any) -> None:
        """What the picture shows, in the Axes that are given."""

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw it into Axes, those of a new figure where none are given; returns the Axes."""
        if ax is None:
            from matplotlib import pyplot  # half a second, and not needed for numbers

            ax = pyplot.subplots()[1]
        self.draw(ax)
        return ax
