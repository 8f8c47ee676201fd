"""The modes of a packing, by one question: the lowest, the highest, those of an interval, all.

Floppy and unstable modes are held out, so that the lowest modes, and those of an interval, are the
elastic ones. The exact counts of `modal.modes.counts` say whether a list is complete; where modes
did not converge the list ends early, and `missing` says how many it lacks.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from modal.modes.collective import counted_floppy, every_floppy
from modal.modes.counts import check_count, count_below
from modal.modes.dense import dense_modes
from modal.modes.mode_set import Choice, ModeSet, certificate
from modal.modes.observables import Piece, found_modes
from modal.modes.search import AboutShift, FromBelow, FromTop, Search
from modal.modes.strategy import ModeRequest
from modal.modes.unsymmetric import modes_at_an_end
from modal.modes.zero_modes import FloppyModes
from modal.packing.network import Network
from modal.packing.precision import refuse_few_digits
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arguments import checked
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError, UnavailableError
from modal.tools.workload import MAX_SECONDS

FEW = 10
"""Lowest modes where nothing else is asked for."""
SHIFT = 1e-7
"""Shift below zero, relative to the largest diagonal entry, that keeps the factor definite."""
NARROW = 1e-6
"""Relative width of an interval that is not cut further: a degenerate frequency, mostly."""
FURTHER = 1.1
"""Times a frequency below which there are fewer modes than were estimated."""


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
    hours: float = MAX_SECONDS / 3600,
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
        Where there are no such modes, the search would take more than `hours` or the free memory,
        or the packing's overlaps are known to too few digits for single modes.

    Examples
    --------
    >>> import modal
    >>> low = eigenmodes(modal.fcc(cells=(2, 2, 20)), lowest=3)
    >>> low.frequency.round()
    array([6669., 6669., 9313.])
    >>> low.certified, low.mode_shape.shape
    (True, (3, 80, 6))
    """
    refuse_few_digits(network)
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
        raise InputError("input", f"{' and '.join(given)}: which modes? Ask for one of them")
    kind: str = next(iter(given), "lowest")
    value: Any = given.get(kind)
    if not certify and kind != "highest":
        raise InputError(
            "input",
            "certify=False is for the highest modes only",
            remedy="elsewhere it saves hardly any time",
        )
    if kind == "between" and np.shape(value) != (2,):
        raise InputError(
            "input", f"between {value}", remedy="give two frequencies in Hz, the lower one first"
        )
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
        modes = _of_interval(system, choice, choice)
    else:
        of = system.size - (every_floppy(system).held if kind == "lowest" else 0)
        count = min(FEW, of) if value is None else value
        modes = _counted_off(system, Choice(kind, 0 if kind == "all" else count), of, certify)
    modes.attributes |= {"packing": system.packing.fingerprint, "pre_stress": system.pre_stress}
    for data in vars(modes).values():
        if isinstance(data, np.ndarray):
            data.flags.writeable = False
    return modes


def _counted_off(system: LinearSystem, choice: Choice, of: int, certify: bool) -> ModeSet:
    """All modes, or some at an end `of` those there are, as `modal.modes.strategy` finds them."""
    if choice.kind != "all":
        check_count(system, choice.count, of)
    asked = ModeRequest(system, choice, choice.count, of)
    if asked.way == "dense":
        return dense_modes(system, choice)
    if asked.way == "arnoldi":
        return modes_at_an_end(system, choice)
    asked.refuse_endless()
    if asked.way == "top":
        return _highest(system, choice, certify)
    if asked.way == "shift":
        return _beside(system, lambda floppy: _lowest(system, choice, floppy))
    high = asked.high
    while True:
        modes = _of_interval(system, Choice("between", low=0.0, high=high), choice)
        if len(modes.frequency) == choice.count or not modes.certified:
            return modes
        high *= FURTHER


def _beside(system: LinearSystem, listed: Callable[[FloppyModes], ModeSet]) -> ModeSet:
    """A list of the modes beside the zero modes, as `listed` makes it for these.

    Where these are not counted, and the list is not complete, they are, and it is made anew.
    """
    modes = listed(every_floppy(system))
    if not modes.certified and not every_floppy(system).counted:
        modes = listed(counted_floppy(system))
    floppy = every_floppy(system)
    return modes.with_zero_modes(floppy.total, floppy.unstable)


def _lowest(system: LinearSystem, choice: Choice, floppy: FloppyModes) -> ModeSet:
    """The lowest modes beside the `floppy` ones, about a shift just below zero."""
    source = AboutShift(system, -SHIFT * system.diagonal.max(), definite=not floppy.unstable)
    search = Search(system, source, floppy.basis)
    missing = search.complete(choice.count, 1, lambda f: count_below(system, f) - floppy.held)
    if not len(search.square):
        raise UnavailableError(
            "not_converged",
            "no mode converged",
            "the contrast of stiffnesses or masses leaves the lowest modes below round-off",
            "ask for the highest, or for an interval further up",
        )
    if not missing:
        counted_floppy(system, search.at_zero)
    return _of_search(search, choice, missing)


def _highest(system: LinearSystem, choice: Choice, certify: bool) -> ModeSet:
    """The highest modes; zero modes, far from the top, need not be held out.

    An exact count takes a factorisation, which costs more than a few modes; without `certify`, or
    where it does not fit, it is left out.
    """
    search = Search(system, FromTop(system), sp.csc_matrix((system.size, 0)))
    missing, because = 0, "" if certify else "the exact count was left out, as was asked for"
    if certify:
        try:
            missing = search.complete(
                choice.count, -1, lambda f: system.size - count_below(system, f)
            )
        except InputError as error:
            because = f"no exact count: {error}"
    if because:
        missing = max(search.search_until(choice.count, np.isfinite), 0)
    floppy = every_floppy(system)
    modes = _of_search(search, choice, missing, because)
    return modes.with_zero_modes(floppy.total, floppy.unstable)


def _of_search(search: Search, choice: Choice, missing: int, because: str = "") -> ModeSet:
    """The modes of a choice that a search has found, less those that are `missing`."""
    which = search.sorted(search.system.zero_frequency if choice.kind == "lowest" else -np.inf)
    enough = min(choice.count - max(missing, 0), len(which))
    which = which[:enough] if choice.kind == "lowest" else which[len(which) - enough :]
    modes = found_modes(search.system, [search.piece(which)], len(which), choice)
    modes.attributes |= {"solver": search.source.solver} | certificate(missing, because)
    return modes


def _of_interval(system: LinearSystem, interval: Choice, choice: Choice) -> ModeSet:
    """Every elastic mode with low <= f < high, Hz, certified by counts beside both ends.

    These are made outside, as far as round-off reaches, so that an interval may end on a mode:
    whether that is one of the list is then decided by its frequency as it was found. Of a `choice`
    of the lowest modes the list has no more than these.
    """
    if ModeRequest(system, interval, 0, system.size).way == "dense":
        return dense_modes(system, interval)
    low, high = interval.low, interval.high
    if low <= system.zero_frequency:
        low = 0.0
    low -= low * system.count_uncertainty((2 * np.pi * low) ** 2)
    high += high * system.count_uncertainty((2 * np.pi * high) ** 2)
    ends = low, high
    return _beside(system, lambda floppy: _between(system, interval, ends, choice, floppy))


def _between(
    system: LinearSystem,
    interval: Choice,
    ends: tuple[float, float],
    choice: Choice,
    floppy: FloppyModes,
) -> ModeSet:
    """Every mode of an `interval`, counted between the `ends`, Hz, beside the `floppy` ones."""
    low, high = ends
    below = {low: floppy.held if low == 0 else count_below(system, low)}
    below[high] = count_below(system, high)
    wanted = below[high] - below[low]
    from_zero = below[low] == floppy.held and not floppy.unstable
    asked = ModeRequest(
        system, Choice("between", low=low, high=high), wanted, system.size - floppy.held, from_zero
    )
    if asked.way == "dense":
        return dense_modes(system, choice)
    asked.refuse_endless()
    most = min(wanted, choice.count or wanted)
    missing, solvers, at_zero = list[int](), list[str](), [np.empty((system.size, 0))]

    def pieces() -> Iterator[Piece]:
        first = 0
        lifted = asked.way == "lifted"
        for a, b in [(low, high)] if lifted else _slices(system, low, high, below):

            def inside(square: Floats, a: float = a, b: float = b) -> Bools:
                return (frequency_of(square) >= a) & (frequency_of(square) < b)

            # Both ends are equally far in omega^2: the nearest modes are those of the slice. A
            # shift at its lower end, where A - sigma is definite, needs twice as many solves.
            middle = (2 * np.pi) ** 2 * (a**2 + b**2) / 2
            source = FromBelow(asked.low_end) if lifted else AboutShift(system, middle)
            search = Search(system, source, floppy.basis)
            missing.append(search.search_until(below[b] - below[a], inside))
            at_zero.append(search.at_zero)
            which = search.sorted(
                max(a, interval.low, system.zero_frequency), min(b, interval.high)
            )
            which = which[: most - first]
            solvers.append(source.solver)
            yield search.piece(which, first)
            first += len(which)

    modes = found_modes(system, pieces(), most, choice)
    short = sum(max(lack, 0) for lack in missing)
    modes.attributes |= certificate(short or min(missing, default=0))
    if low == 0 and modes.certified:
        counted_floppy(system, np.concatenate(at_zero, axis=1))
    slices = f"; {len(solvers)} slices" * (len(solvers) > 1)
    modes.attributes["solver"] = "".join(solvers[:1]) + slices or "count"
    return modes


def _slices(
    system: LinearSystem, low: float, high: float, below: dict[float, int]
) -> Iterator[tuple[float, float]]:
    """Cut [low, high) where exact counts leave `Limits.slice` modes or fewer in each slice.

    A cut in the middle of the volume f^3, as the number of waves grows; a cluster of equal
    frequencies that cannot be cut stays whole. The counts are added to those `below`.
    """
    wanted = below[high] - below[low]
    if wanted <= system.limits.slice or high - low < NARROW * high:
        if wanted:
            yield low, high
        return
    middle = float(np.cbrt((low**3 + high**3) / 2))
    below[middle] = count_below(system, middle)
    yield from _slices(system, low, middle, below)
    yield from _slices(system, middle, high, below)
