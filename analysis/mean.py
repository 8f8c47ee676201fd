"""Compute means over packings, with one rule for their errors wherever they are shown."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.steps import Step
from analysis.value import COMMON, Value
from modal.tools.arrays import Array, Floats


def mean_of_values(values: Sequence[Value]) -> Value:
    """Return the mean of a quantity over the packings that have it, with error and scatter.

    Arrays are interpolated at the frequencies of the first packing; the mean is NaN where another
    packing has no frequencies. Samples may agree by chance; therefore the error of the mean is
    never smaller than the one propagated from the errors of the values. The part of an error that
    all packings share does not decrease in the mean: the largest one is kept.
    """
    first = values[0]
    shape = np.shape(first.value)
    count = len(values)
    grids = [_grid_of(value) for value in values]
    numbers = _on_first_grid(grids, [value.value for value in values]).reshape(count, *shape)
    scatter = np.nan * numbers[0]
    if count > 1:
        scatter = numbers.std(axis=0, ddof=1)
    squares = _on_first_grid(grids, [_independent_square(value) for value in values])
    parts: dict[str, Any] = {
        "fit": np.sqrt(squares.sum(axis=0)).reshape(shape) / count,
        "samples": scatter / np.sqrt(count),
    }
    common = [value.parts[COMMON] for value in values if COMMON in value.parts]
    if common:
        parts[COMMON] = max(common)
    mean = numbers.mean(axis=0)
    steps = [_step_of_sample(number, value) for number, value in enumerate(values, 1)]
    of_mean = {"averaged_samples": float(count)}
    if not shape:
        of_mean["sample_scatter"] = float(scatter)
    steps.append(Step("mean", "averaged", of_mean, value_unit=first.unit))
    return Value(mean, first.unit, parts, (), first.at, scatter, steps=tuple(steps))


def _step_of_sample(number: int, value: Value) -> Step:
    """Return the value of one of the samples, or how many values it has, as a step."""
    numbers: dict[str, float] = {"sample": number}
    if np.ndim(value.value):
        numbers["values"] = np.isfinite(value.value).sum()
        if value.at is not None:
            numbers |= {"lowest": value.at.min(), "highest": value.at.max()}
    else:
        numbers["sample_value"] = value.value
        numbers["sample_error"] = float(np.sqrt(np.maximum(_independent_square(value), 0.0)))
        numbers["shared_error"] = value.common_error
    return Step("sample", "read", numbers, value_unit=value.unit)


def _grid_of(value: Value) -> Array:
    """Return the frequencies of an array (n,), or 0 ... n - 1 for a list without frequencies."""
    if value.at is None:
        return np.arange(np.size(value.value))
    return value.at


def _independent_square(value: Value) -> Any:
    """Return the squared error without the part that all packings share."""
    return value.error**2 - value.parts.get(COMMON, 0.0) ** 2


def _on_first_grid(grids: Sequence[Array], numbers: Sequence[Any]) -> Floats:
    """Interpolate the numbers of k packings at the first packing's grid (n,); shape (k, n).

    NaN outside the grid of a packing.
    """
    rows = []
    for grid, number in zip(grids, numbers, strict=True):
        rows.append(np.interp(grids[0], grid, np.atleast_1d(number), np.nan, np.nan))
    return np.array(rows)
