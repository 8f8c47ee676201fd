"""Remarks on unusual features of a network."""

from typing import Any, NamedTuple

import numpy as np


class Remark(NamedTuple):
    """An unusual feature that a network may have.

    code: the kind of remark, for programs and tests. applies: whether the network has the feature.
    text: the sentence for a reader. number: the number that the remark is about, NaN without one.
    """

    code: str
    applies: Any
    text: str
    number: float = np.nan


class Findings(NamedTuple):
    """Numbers by name, and remarks, including those that do not apply."""

    numbers: dict[str, Any]
    remarks: list[Remark]
