"""The modes of a packing, by one question: the lowest, the highest, those of an interval, all."""

from dataclasses import replace
from typing import Any

import numpy as np

from modal.modes.collective import every_floppy
from modal.modes.lists import listed_modes
from modal.modes.mode_set import Choice, ModeSet
from modal.packing.network import Network
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked
from modal.tools.errors import InputError
from modal.tools.workload import LONGEST

FEW = 10
"""Lowest modes where nothing else is asked for."""


@checked
def eigenmodes(
    network: Network,
    *,
    lowest: int | None = None,
    highest: int | None = None,
    below: float | None = None,
    between: tuple[float, float] | None = None,
    all: bool = False,
    translations_only: bool = False,
    sliding: str = "elastic",
    pre_stress: str = "none",
    solver: str | None = None,
    shapes: bool = True,
    certify: bool = True,
    hours: float = LONGEST / 3600,
) -> ModeSet:
    """Natural frequencies and mode shapes of a packing, and whether any mode is missing.

    They solve K phi = omega^2 M phi (Otsubo et al. 2017, Eq. 1), with three displacements and three
    rotations a sphere. Motions without energy are counted (`floppy_modes` of the result), and so
    are those that release energy (`unstable_modes`); the lowest modes, and those of an interval,
    are without both. With the shear forces (`pre_stress` "full" or "law") K is not symmetric:
    omega^2 may be complex, the frequency is that of omega's real part, and with more than 3,000
    degrees of freedom the lowest and the highest modes come without a certificate.

    Parameters
    ----------
    network : Network
        The packing, n spheres.
    lowest, highest : int, optional
        So many modes from one end. One of these five says which modes; without, the ten lowest.
    below : float, optional
        All modes below a frequency, Hz.
    between : tuple of 2 float, optional
        All modes of an interval, Hz.
    all : bool, default False
        All 6n.
    translations_only : bool, default False
        Hold the rotations at zero.
    sliding : str, default "elastic"
        "slip": contacts at the friction limit have their normal springs alone.
    pre_stress : str, default "none"
        What the contact forces add: "normal", "full" or "law" (`modal.system.contacts`).
    solver : str, optional
        A factorisation: pardiso, blocks or superlu.
    shapes : bool, default True
        Keep the shapes, where they take no more than 2 GB.
    certify : bool, default True
        Count the modes; only with `highest` it may be left out.
    hours : float, default 24
        Longest search, by its estimate.

    Returns
    -------
    ModeSet
        k modes: `frequency` (k,) Hz; `chi_z` (k,), the share of motion along z (Eq. 2; of a
        crystal's degenerate pairs that of travelling waves); `mode_shape` (k, n, 6),
        mass-normalised, kg^-1/2; `certified` where an exact count says that none is missing.

    Raises
    ------
    InputError
        Where there are no such modes, or the search would take more than `hours` or the free
        memory.

    Examples
    --------
    >>> import modal
    >>> low = eigenmodes(modal.fcc(cells=(2, 2, 20)), lowest=3)
    >>> low.frequency.round()
    array([6669., 6669., 9313.])
    >>> low.certified, low.mode_shape.shape
    (True, (3, 80, 6))
    """
    system = LinearSystem.of(
        network,
        pre_stress=pre_stress,
        sliding=sliding,
        translations_only=translations_only,
        solver=solver,
        shapes=shapes,
        hours=hours,
    )
    asked = {"lowest": lowest, "highest": highest, "below": below, "between": between}
    return modes_of(system, certify=certify, **asked, all=all)


def modes_of(system: LinearSystem, *, certify: bool = True, **asked: Any) -> ModeSet:
    """As `eigenmodes`, of a system that is at hand; the last lists are kept with its network."""
    given = {name: which for name, which in asked.items() if not (which is None or which is False)}
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)}: which modes? Ask for one of them")
    kind: str = next(iter(given), "lowest")
    value: Any = given.get(kind)
    if not certify and kind != "highest":
        raise InputError(
            "certify=False is for the highest modes only; elsewhere it saves hardly any time"
        )
    if kind == "between" and np.shape(value) != (2,):
        raise InputError(f"between {value}: give two frequencies in Hz, the lower one first")
    how = (system.solver, system.shapes, system.limits, system.hours)
    modes = system.kept(
        "lists of modes",
        (kind, *np.ravel(value).tolist(), certify, *how),
        lambda: _listed(system, kind, value, certify),
        lambda modes: modes.bytes,
    )
    return replace(modes, attributes=dict(modes.attributes))


def _listed(system: LinearSystem, kind: str, value: Any, certify: bool) -> ModeSet:
    """The modes of one kind; its arrays cannot be written to."""
    if kind in ("below", "between"):
        choice = Choice.of_interval(*((0.0, value) if kind == "below" else value))
    elif kind == "all":
        choice = Choice("all")
    else:
        few = min(FEW, system.size - every_floppy(system).held) if value is None else 0
        choice = Choice(kind, few if value is None else value)
    modes = listed_modes(system, choice, certify=certify)
    modes.attributes |= {"packing": system.network.fingerprint, "pre_stress": system.pre_stress}
    for data in vars(modes).values():
        if isinstance(data, np.ndarray):
            data.flags.writeable = False
    return modes
