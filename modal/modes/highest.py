"""The highest modes of a packing: block Lanczos with products of A, certified where asked.

All modes: `modal.modes.dense`; the low end and intervals: `modal.modes.lowest`.
"""

from __future__ import annotations

import numpy as np

from modal.modes.asked import check_count
from modal.modes.counts import count_below
from modal.modes.dense import dense_modes
from modal.modes.effort import from_the_top, refuse_endless_search
from modal.modes.mode_set import Choice, ModeSet, certificate, subset
from modal.modes.search import SearchFromTop
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError


def highest_modes(system: LinearSystem, count: int, *, certify: bool = True) -> ModeSet:
    """The `count` highest modes, from products with A as long as these converge.

    Certified: the exact count above the lowest of them is that of the modes found. It takes a
    factorisation, which costs more than a few modes; without `certify` it is left out.
    """
    check_count(system, count, system.size)
    choice = Choice("highest", count)
    if (
        system.size <= system.limits.small
        or count > system.size // system.limits.part
        or not system.symmetric
    ):
        top = slice(system.size - count, system.size)
        return dense_modes(system, lambda frequency: top, choice)
    effort = from_the_top(system, count)
    refuse_endless_search(system, effort, f"the highest {count} modes take", "ask for fewer")
    search = SearchFromTop(system)
    because = "" if certify else "the exact count was left out, as was asked for"

    def above(edge: float) -> int:
        nonlocal because
        try:
            return system.size - count_below(system, edge)
        except InputError as error:
            because = f"no exact count: {error}"
            return 0

    missing = 0 if because else search.complete(count, -1, above)
    if because:
        missing = search.look_again(count)
    modes = search.modes(-np.inf, np.inf, choice)
    found = len(modes.frequency)
    listed = min(found, count - max(missing, 0))
    modes = subset(modes, slice(found - listed, found), choice)
    modes.attributes |= certificate(missing, because)
    return modes
