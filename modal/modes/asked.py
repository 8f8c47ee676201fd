"""What may be asked of a list of modes: frequencies in Hz, and how many modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import InputError


def frequencies(given: ArrayLike) -> Floats:
    """The frequencies as an array, Hz; InputError where one is no number from 0 on."""
    try:
        asked = np.asarray(given, float)
    except (TypeError, ValueError) as error:
        raise InputError(f"frequency is {given!r}, not numbers of Hz") from error
    wrong = ~(np.isfinite(asked) & (asked >= 0))
    if wrong.any():
        raise InputError(f"{asked[wrong][0]:g} Hz is no frequency; give a number from 0 Hz on")
    return asked


def check_count(system: LinearSystem, count: int, available_modes: int) -> None:
    """Raise InputError unless `count` is whole and 1 <= `count` <= `available_modes`.

    `available_modes` is the number of modes that can be listed: all degrees of freedom, less the
    zero modes where these are not listed.
    """
    if available_modes < 1 or not system.diagonal.any():
        raise InputError(
            f"no modes to list: no spring holds any of the {system.size} motions; see the "
            "contacts with `info`"
        )
    if not (isinstance(count, int | np.integer) and 1 <= count <= available_modes):
        raise InputError(
            f"{count} modes asked, the network has {system.size} degrees of freedom and "
            f"{available_modes} modes to list; ask for 1 to {available_modes}"
        )
