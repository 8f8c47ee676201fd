"""Means over packings, with one rule for their errors wherever they are shown."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.value import COMMON, Value
from modal.tools.arrays import Array, Floats


def mean_of_values(each: Sequence[Value]) -> Value:
    """Return the mean of a quantity over packings that have it, with its error and their scatter.

    Of arrays at the frequencies of the first, NaN outside of their own. Samples may agree by
    chance: the mean is not surer than what each of them is known to.
    """
    first = each[0]
    shape = np.shape(first.value)
    # A list without frequencies has the first, second ... of each packing.
    places = [np.arange(np.size(v.value)) if v.at is None else v.at for v in each]
    rows = _at_first(places, [v.value for v in each]).reshape(len(each), *shape)
    scatter = np.nan * rows[0]
    if len(each) > 1:
        scatter = rows.std(axis=0, ddof=1)
    squares = _at_first(places, [v.error**2 - v.parts.get(COMMON, 0.0) ** 2 for v in each])
    parts: dict[str, Any] = {"fit": np.sqrt(squares.sum(axis=0)).reshape(shape) / len(each)}
    parts["samples"] = scatter / np.sqrt(len(each))
    if common := [v.parts[COMMON] for v in each if COMMON in v.parts]:
        parts[COMMON] = max(common)
    return Value(rows.mean(axis=0), first.unit, parts, (), first.at, scatter)


def _at_first(places: Sequence[Array], numbers: Sequence[Any]) -> Floats:
    """Shape (k, n): those of k packings at the places (n,) of the first, NaN outside of theirs."""
    own = zip(places, map(np.atleast_1d, numbers), strict=True)
    return np.array([np.interp(places[0], x, y, np.nan, np.nan) for x, y in own])
