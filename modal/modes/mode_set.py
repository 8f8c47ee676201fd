"""The modes of a network, and their file format "granular-modes", version 1, defined here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import numpy as np

from modal.formats.column import stored
from modal.formats.hdf5 import complete
from modal.formats.product import product_of
from modal.formats.provenance import Provenance
from modal.formats.tables import MAX_HTML_ROWS, Tabular, html_table
from modal.packing.network import Network
from modal.system.root_mass import RootMass
from modal.tools.arguments import frequencies
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.display import Drawn, quantity
from modal.tools.errors import InputError

SCHEMA = "granular-modes"
VERSION = 1
WHOLE_NUMBER_ATTRIBUTES = {"certified", "missing", "floppy_modes", "unstable_modes"}
"""Attributes of a list that are whole numbers; `certified` is 0 or 1."""
OBSERVABLES = ("residual", "chi_z", "chi_z_chain", "rotation_share")
"""Columns of a list of modes besides the frequencies."""
MIN_MOTION_SQUARED = 1e-18
"""Square of a displacement, relative to the largest of the mode, below which a particle is at
rest and its motion has no direction: the middle layer of an antisymmetric mode moves by round-off.
"""

ChoiceKind = Literal["lowest", "highest", "between", "all"]
"""The kind of request that a list of modes answers."""


@dataclass(frozen=True)
class Choice:
    """The modes that were requested.

    `count` is the number of the lowest or highest modes; `low` and `high`, Hz, are the ends of an
    interval.
    """

    kind: ChoiceKind
    count: int = 0
    low: float = 0.0
    high: float = np.inf

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes for a file: the request as `choice` with its numbers, and as `interval`."""
        attributes: dict[str, Any] = {"interval": self.kind, "choice": self.kind}
        if self.kind == "between":
            attributes["interval"] = f"{self.low:g} {self.high:g}"
            attributes["low"] = self.low
            attributes["high"] = self.high
        elif self.count:
            attributes["interval"] = f"{self.kind} {self.count}"
            attributes["count"] = self.count
        return attributes

    @classmethod
    def of_attributes(cls, attributes: Mapping[str, Any]) -> Choice:
        """Read the attributes of a file; if only `interval` exists, parse its words.

        Raises ValueError if a number cannot be read.
        """
        first, *rest = str(attributes.get("interval", "all")).split()
        kind = cast(ChoiceKind, first)
        if not rest:
            return cls(kind)
        if kind in ("lowest", "highest"):
            return cls(kind, int(rest[0]))
        low = attributes.get("low", first)
        high = attributes.get("high", rest[0])
        return cls("between", low=float(low), high=float(high))

    @classmethod
    def of_interval(cls, low: float, high: float) -> Choice:
        """Return the choice of modes from `low` to below `high`, Hz; InputError if low >= high."""
        if high == np.inf:
            raise InputError("interval", "an interval without an end", remedy="ask for all modes")
        low, high = map(float, frequencies((low, high)))
        if high <= low:
            raise InputError(
                "interval",
                f"the interval {low:g} to {high:g} Hz is empty",
                remedy="give the lower end first",
            )
        return cls("between", low=low, high=high)

    def part(self, frequency: Floats, zero: float) -> slice:
        """Return the slice of all frequencies (m,), ascending, Hz, whose modes are in the choice.

        Frequencies up to `zero`, Hz, belong to modes that are not elastic; choices of the lowest
        modes, and of an interval, leave them out.
        """
        first_elastic = int((frequency <= zero).sum())
        if self.kind == "lowest":
            return slice(first_elastic, first_elastic + self.count)
        if self.kind == "between":
            first = max(int((frequency < self.low).sum()), first_elastic)
            return slice(first, max(first, int((frequency < self.high).sum())))
        if self.kind == "highest":
            return slice(len(frequency) - self.count, len(frequency))
        return slice(0, len(frequency))


@dataclass(repr=False)
class ModeSet(Drawn, Tabular):
    """k modes in ascending order of frequency, as `modal.eigenmodes` finds them.

    For degenerate pairs of a crystal, chi_z and rotation_share are those of travelling waves, while
    the shapes are standing waves. Equations are those of Otsubo et al. 2017.

    Attributes
    ----------
    frequency : ndarray (k,)
        Natural frequencies, Hz.
    residual : ndarray (k,)
        |A v - omega^2 v| / omega^2 of the unit vector v, with A = M^-1/2 K M^-1/2; round-off keeps
        it above about eps |A| / omega^2.
    chi_z, chi_z_chain : ndarray (k,)
        Share of the motion along z (Eq. 2), over all particles and over the chain from wall to
        wall; the latter is NaN without a chain.
    rotation_share : ndarray (k,)
        Share of rotations in the kinetic energy.
    mode_shape : ndarray (k, n, 6), kg^-1/2, or None
        Displacements and rotations, mass-normalised, if they were requested.
    resonance_frequency, resonance_wavenumber : ndarray (r,), Hz and 1/m, or None
        Frequencies of the P-wave resonances r = 1, 2, ..., and wave numbers pi r / L (Eq. 4).
    resonance_shape : ndarray (r, nc), kg^-1/2, or None
        Displacements along z of the particles of the chain in the resonances.
    attributes : dict
        `interval`: the request in words; `choice`, `count`, `low`, `high`: the request as numbers.
        `certified`: whether an exact count confirms that the list is complete;
        `uncertified_because`: the reason if not. `missing`: number of requested modes that were not
        found. `solver`: its name. `floppy_modes`, `unstable_modes`: numbers of such modes.
        `shapes_left_out`: why there are no mode shapes although they were requested.

    Examples
    --------
    >>> import modal
    >>> modes = modal.eigenmodes(modal.fcc(cells=(1, 1, 20)), lowest=2)
    >>> modes.frequency.shape, modes.certified, modes.missing
    ((2,), True, 0)
    """

    DIMENSIONS = {"k": "mode", "n": "particle", 6: "motion", "r": "resonance", "nc": "chain"}
    ROWS = "mode"

    frequency: Annotated[Floats, stored("", "f", "k", unit="Hz")]
    residual: Annotated[Floats, stored("", "f", "k")]
    chi_z: Annotated[Floats, stored("", "f", "k")]
    # Without a chain there is no chi_z along it.
    chi_z_chain: Annotated[Floats, stored("", "f", "k", finite=False)]
    rotation_share: Annotated[Floats, stored("", "f", "k")]
    mode_shape: Annotated[Floats | None, stored("", "f", "k", "n", 6, unit="kg^-1/2")] = None
    resonance_frequency: Annotated[Floats | None, stored("", "f", "r", unit="Hz")] = None
    resonance_wavenumber: Annotated[Floats | None, stored("", "f", "r", unit="1/m")] = None
    resonance_shape: Annotated[Floats | None, stored("", "f", "r", "nc", unit="kg^-1/2")] = None
    attributes: dict[str, Any] = field(default_factory=dict)

    def _repr_html_(self) -> str:
        """Return the first modes as a table, for a notebook."""
        rows = []
        for k in range(min(len(self.frequency), MAX_HTML_ROWS)):
            numbers = (self.frequency[k], self.residual[k], self.chi_z[k], self.rotation_share[k])
            rows.append([str(k + 1), *(f"{number:.6g}" for number in numbers)])
        header = ["mode", "frequency, Hz", "residual", "chi_z", "rotation_share"]
        return html_table(header, rows, len(self.frequency) - len(rows))

    @property
    def bytes(self) -> int:
        """Memory of the arrays, bytes."""
        return sum(data.nbytes for data in vars(self).values() if isinstance(data, np.ndarray))

    @property
    def certified(self) -> bool:
        """Whether an exact count confirms that no mode of the list is missing."""
        return bool(self.attributes.get("certified", False))

    @property
    def missing(self) -> int:
        """Number of requested modes that were not found."""
        return int(self.attributes.get("missing", 0))

    @property
    def floppy_modes(self) -> int:
        """Number of motions of the network without energy."""
        return int(self.attributes.get("floppy_modes", 0))

    @property
    def unstable_modes(self) -> int:
        """Number of modes that release energy: their omega^2 is negative."""
        return int(self.attributes.get("unstable_modes", 0))

    def chi(self, axis: str) -> Floats:
        """Compute the share of the motion along x, y or z of each mode shape, (k,).

        Along z the share is `chi_z`, except for pairs of equal frequency that follow from a
        crystal's lateral symmetry: their shapes are standing waves, and `chi_z` is that of the
        travelling wave which the two make together. Raises InputError if the mode shapes were not
        kept.
        """
        if axis not in ("x", "y", "z"):
            raise InputError("axis", f"axis {axis!r}", remedy="choose x, y or z")
        return chi_z(self.shapes(), axis="xyz".index(axis))

    def shapes(self, network: Network | None = None) -> Floats:
        """Return the mode shapes (k, n, 6), kg^-1/2.

        Raises InputError if the shapes were not kept, or belong to another packing than `network`.
        """
        if self.mode_shape is None:
            raise InputError(
                "no_mode_shapes",
                "no mode shapes were kept",
                remedy="ask for fewer modes, or with -o",
            )
        if network is not None:
            fingerprint = self.attributes.get("packing")
            matches = fingerprint is None or network.matches(fingerprint)
            if not matches or self.mode_shape.shape[1] != network.n_particles:
                raise InputError(
                    "modes_of_another_network",
                    "the modes are of another network",
                    "of other spheres, contacts, stiffnesses or forces",
                    "take those of this one",
                )
        return self.mode_shape

    def participation(self, network: Network) -> Floats:
        """Compute the share of the network's particles that take part in each mode, (k,), 0 to 1.

        Raises InputError if the mode shapes were not kept, or belong to another packing.
        """
        return participation_ratio(self.shapes(network), RootMass.of(network))

    def with_zero_modes(self, floppy: int, unstable: int) -> ModeSet:
        """Return the list with the numbers of floppy and unstable motions, if it lacks them."""
        self.attributes = {"floppy_modes": floppy, "unstable_modes": unstable} | self.attributes
        return self

    def __repr__(self) -> str:
        text = f"<ModeSet: {len(self.frequency)} modes"
        if len(self.frequency):
            lowest = quantity(float(self.frequency[0]), "Hz")
            highest = quantity(float(self.frequency[-1]), "Hz")
            text += f" from {lowest} to {highest}"
        text += ", certified" if self.certified else ", not certified"
        if self.missing > 0:
            text += f", {self.missing} missing"
        return f"{text}; {self.floppy_modes} floppy modes>"

    def draw(self, ax: Any) -> None:
        """Draw chi_z of each mode against its frequency, with the P-wave resonances marked."""
        ax.plot(self.frequency / 1e3, self.chi_z, ".", markersize=3, label="modes")
        if self.resonance_frequency is not None and len(self.resonance_frequency):
            resonances = self.resonance_frequency / 1e3
            ones = np.ones(len(resonances))
            ax.plot(resonances, ones, "|", markersize=9, label="P-wave resonances")
            ax.legend()
        ax.set(xlabel="frequency, kHz", ylabel=r"$\chi_z$", ylim=(-0.03, 1.06))


FORMAT = product_of(SCHEMA, ModeSet, others="attributes")


def chi_z(shape: Array, particles: Ints | slice = slice(None), axis: int = 2) -> Floats:
    """Compute Eq. 2, the mean over particles of u_z^2 / |u|^2 (translations only), shape (k,).

    The displacement of each particle is normalised by its own size; 1 therefore means that every
    particle moves along z only. The mean is over the particles that move (`MIN_MOTION_SQUARED`).
    Another `axis`, 0 or 1, gives the share along x or y, which identifies S-waves as chi_z
    identifies P-waves.
    """
    squares = np.abs(shape[:, particles, :3]) ** 2
    total = squares.sum(axis=2)
    moving = total > MIN_MOTION_SQUARED * total.max(axis=1, keepdims=True)
    share = np.divide(squares[:, :, axis], total, out=np.zeros_like(total), where=moving)
    return share.sum(axis=1) / np.maximum(moving.sum(axis=1), 1)


def participation_ratio(shape: Array, root: RootMass) -> Floats:
    """Compute the share of the particles that take part in modes of shapes (k, n, 6), (k,).

    This is (sum e)^2 / (n sum e^2), with the kinetic energy e of each particle, rotations included,
    and the number n of particles that are not held. The ratio is 1 if all move alike, 2/3 in a
    plane standing wave, 1/n if one moves alone (R. J. Bell and P. Dean, Discuss. Faraday Soc. 50,
    55, 1970). `root` is M^1/2.
    """
    count, n, _ = shape.shape
    scaled = root.times(np.ascontiguousarray(shape.reshape(count, -1).T)).T
    energy = (np.abs(scaled.reshape(count, n, 6)) ** 2).sum(axis=2)
    moving = int(root.diagonal.reshape(n, 6).any(axis=1).sum())
    return energy.sum(axis=1) ** 2 / (moving * (energy**2).sum(axis=1))


def write_modes(path: str | Path, modes: ModeSet, made: Provenance | None = None) -> None:
    """Write modes to a file atomically, with their provenance.

    Parameters
    ----------
    path : str or Path
        `*.modes.h5`, replaced if it exists.
    modes : ModeSet
        A list of modes, with shapes if these are to be kept.
    made : Provenance, optional
        Command, sources and settings, kept with the modes.

    Raises
    ------
    InputError
        If the file cannot be written.

    Examples
    --------
    >>> import modal, os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "low.modes.h5")
    >>> low = modal.eigenmodes(modal.fcc(cells=(1, 1, 10)), lowest=4)
    >>> write_modes(path, low)
    >>> read_modes(path).certified
    True
    """
    FORMAT.write(path, vars(modes), made)


def read_modes(path: str | Path, *, shapes: bool = True) -> ModeSet:
    """Read modes from a file and validate them.

    Parameters
    ----------
    path : str or Path
        `*.modes.h5`.
    shapes : bool, default True
        Whether to read the mode shapes, which make up nearly all of a file.

    Returns
    -------
    ModeSet
        The modes as they were written.

    Raises
    ------
    InputError
        If the file is not valid; the message names the first fault.

    Examples
    --------
    >>> import modal, os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "low.modes.h5")
    >>> low = modal.eigenmodes(modal.fcc(cells=(1, 1, 10)), lowest=4)
    >>> write_modes(path, low)
    >>> read_modes(path).certified
    True
    """
    left_out = () if shapes else ("mode_shape",)
    modes = ModeSet(**FORMAT.read(path, leave=left_out))
    with complete(path):
        Choice.of_attributes(modes.attributes)
        for name in WHOLE_NUMBER_ATTRIBUTES & modes.attributes.keys():
            modes.attributes[name] = int(modes.attributes[name])
    if (np.diff(modes.frequency) < 0).any():
        raise InputError(
            "not_ascending", f"{path}: frequency is not in ascending order", remedy="make it again"
        )
    without_chain = np.isnan(modes.chi_z_chain)
    if without_chain.any() and not without_chain.all():
        raise InputError("not_finite", f"{path}: chi_z_chain is not finite", remedy="make it again")
    return modes


def read_z_shapes(path: str | Path) -> Floats | None:
    """Read the displacements along z of the mode shapes, (k, n), kg^-1/2; None without shapes.

    This reads a sixth of the data, because files store the components separately. Raises InputError
    if the file is not valid.
    """
    others = FORMAT.columns.keys() - {"frequency", "mode_shape"}
    along_z = {"mode_shape": np.s_[:, :, 2]}
    shape: Floats | None = FORMAT.read(path, leave=others, parts=along_z)["mode_shape"]
    return shape


def certificate(missing: int, reason: str = "") -> dict[str, Any]:
    """Return the attributes that say whether a list is complete, and how many modes it lacks.

    `reason` says why no count was made. A negative `missing` means that more modes were found than
    the count allows.
    """
    if missing > 0:
        reason = f"{missing} modes are missing: not converged, or on an end to round-off"
    if missing < 0:
        reason = f"{-missing} more modes were found than the exact count allows"
    attributes: dict[str, Any] = {"certified": not reason, "missing": max(missing, 0)}
    if reason:
        attributes["uncertified_because"] = reason
    return attributes
