"""Faults of data: what is wrong with which particle or contact, and the error to raise."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from modal.tools.errors import InputError

MEND_EXPORT = "mend the export"
"""Text of the remedy for what only a faulty exporter writes."""


class Fault(NamedTuple):
    """A possible fault: which particles or contacts have it, and the error to raise if any does.

    subject: what the fault is about, such as "contact", or "" for the whole network. wrong: which
    particles or contacts (k,) are at fault, or a single bool. The other fields are those of
    `InputError`; the message names the first particle or contact at fault.
    """

    subject: str
    wrong: Any
    code: str
    problem: str
    reason: str = ""
    remedy: str = MEND_EXPORT


Faults = Iterable[Fault]


def refuse_first(faults: Faults, offset: int = 0) -> None:
    """Raise InputError for the first fault that applies; add `offset` to the number in its message.

    If `faults` is a generator, later faults are not computed.
    """
    for fault in faults:
        if np.any(fault.wrong):
            problem = fault.problem
            if fault.subject:
                number = offset + int(np.argmax(fault.wrong))
                problem = f"{fault.subject} {number} {problem}"
            raise InputError(fault.code, problem, fault.reason, fault.remedy)
