"""Numbers of a study's cases by their name: quantities, and expressions of them."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
import pandas as pd

from modal.tools.errors import InputError


def _named(frame: pd.DataFrame, text: str) -> pd.DataFrame:
    """The columns that an expression names: pandas looks at each of hundreds in every one."""
    return frame[[name for name in set(re.findall(r"\w+", text)) if name in frame]]


def select(frame: pd.DataFrame, text: str) -> pd.DataFrame:
    """The cases that an expression of their columns is true of; all for an empty one."""
    if not text:
        return frame
    try:
        return frame[_named(frame, text).eval(text, engine="python")]
    except (SyntaxError, ValueError, TypeError, pd.errors.UndefinedVariableError) as error:
        raise InputError(f"select: {text}: {error}; name columns of the cases") from None


def numbers(frame: pd.DataFrame, text: str) -> pd.Series:
    """A quantity of each case, or an expression of quantities; NaN where it is not known."""
    if text in frame.columns:
        return pd.to_numeric(frame[text], errors="coerce")
    if text.isidentifier():
        return pd.Series(np.nan, frame.index)
    try:
        return _named(frame, text).eval(text, engine="python").astype(float)
    except pd.errors.UndefinedVariableError:
        return pd.Series(np.nan, frame.index)
    except (SyntaxError, TypeError, ValueError) as error:
        raise InputError(f"quantity {text}: {error}; write names of quantities") from None


def spreads(frame: pd.DataFrame, text: str) -> pd.Series:
    """Uncertainty of a quantity of each case; NaN where it is not known, as of an expression."""
    return numbers(frame, f"{text}_spread" if text.isidentifier() else "unknown")


def runs(cases: Iterable[int]) -> str:
    """Numbers of cases as 1-4, 7."""
    each = np.sort(list(cases))
    found = np.split(each, np.flatnonzero(np.diff(each) > 1) + 1)
    parts = (f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in found if len(run))
    return ", ".join(parts)


def missing(frame: pd.DataFrame, text: str) -> str:
    """What is not there for a quantity of these cases."""
    away = frame[~frame["there"]]
    blank = frame[frame["there"] & ~np.isfinite(numbers(frame, text))]
    parts = [f"no packing of case {runs(away['case'])}"] if len(away) else []
    if len(blank):
        absent = sorted({kind for kinds in blank["absent"] for kind in kinds.split()})
        why = f" (absent: {', '.join(absent)})" if absent else ""
        parts.append(f"case {runs(blank['case'])} does not give it{why}")
    return "; ".join(parts) or "nothing to measure it on"
