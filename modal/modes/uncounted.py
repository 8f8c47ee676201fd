"""Search for the lowest modes without an exact count, and estimate whether the list is complete.

Davidson's method, and Lanczos with a polynomial that lifts the low end, converge from there, so
that a mode is missed only if the start block was nearly orthogonal to it. Two tests show missing
modes. A second search, from other vectors and orthogonal to all modes of the first, finds what the
first one missed. The density of states, from products with random vectors, gives an estimate of the
number of modes up to the last one.
"""

from typing import NamedTuple

import numpy as np

from modal.modes.density import density_of
from modal.modes.search import AboutShift, FromBelow, Search, no_mode_converged
from modal.modes.zero_modes import by_structure
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Bools, Floats

NEAR_LAST = 1e-3
"""Distance above the last omega^2, divided by it, within which the lowest mode of the second
search, known roughly, may lie below: its omega^2 errs by the square of the residual divided by the
relative distance of further modes."""
SECOND_SEARCH_MODES = 4
"""Number of modes that the second search then finds to the full number of digits."""
RESOLUTION_SHARE = 0.05
"""Resolution of the density of states divided by the last frequency: a mode counts in part if it is
as near to the last one."""


class UncountedSearch(NamedTuple):
    """The result of a search without a count, with evidence that it is complete.

    missing: number of modes that did not converge. new: number of modes below the last mode of the
    list that only the second search found. expected, error: number of elastic modes up to the last
    mode, estimated from the density of states, and its standard error. The estimate counts modes
    near the last one in part: more modes than were asked for if the list ends in a cluster.
    """

    search: Search
    missing: int
    new: int
    expected: float
    error: float

    @property
    def attributes(self) -> dict[str, float]:
        """Return the additional attributes for the `ModeSet`."""
        return {
            "expected_modes": self.expected,
            "expected_modes_error": self.error,
            "found_by_second_search": self.new,
        }

    @property
    def evidence(self) -> str:
        """Return the sentence on completeness that follows the reason why no count was made."""
        return (
            f"up to the last mode moments expect {self.expected:.1f} +- {self.error:.1f}, in which "
            f"modes within {RESOLUTION_SHARE:.0%} of it count in part, and a second search from "
            f"other vectors found {self.new} that the first had missed"
        )


def search_uncounted(
    system: LinearSystem, count: int, source: AboutShift | FromBelow
) -> UncountedSearch:
    """Search for the `count` lowest elastic modes from a source."""
    search = Search(system, source, by_structure(system).basis)

    def is_elastic(square: Floats) -> Bools:
        return square != 0

    missing = max(search.search_until(count, is_elastic), 0)
    if missing == count:
        raise no_mode_converged()
    elastic = np.sort(search.square[is_elastic(search.square)])
    last = float(elastic[: count - missing][-1])
    n_known = len(search.square)
    next_square = source.roughly_lowest(search.held())
    n_new = 0
    if next_square < last * (1 + NEAR_LAST) and search.run_round(SECOND_SEARCH_MODES):
        new = search.square[n_known:]
        n_new = int((is_elastic(new) & (new < last)).sum())
    frequency = float(frequency_of(np.array(last)))
    states = density_of(system, RESOLUTION_SHARE * frequency, counting=False)
    value, error = states.count_below(frequency)
    at_zero = states.zero_modes.sum() + (search.square == 0).sum()
    return UncountedSearch(search, missing, n_new, float(value[6] - at_zero), float(error[6]))
