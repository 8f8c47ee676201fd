"""Modes of a network and their file format "granular-modes", version 1 (one definition)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from modal.formats.hdf5 import complete
from modal.formats.product import product_of, stored
from modal.formats.provenance import Provenance
from modal.packing.network import Network
from modal.system.root_mass import RootMass
from modal.tools.arguments import frequencies
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.display import Drawn, quantity
from modal.tools.errors import InputError

SCHEMA = "granular-modes"
VERSION = 1
WHOLE_NUMBERS = {"certified", "missing", "floppy_modes", "unstable_modes"}
"""Attributes of a list, the first of them 0 or 1."""
OBSERVABLES = ("residual", "chi_z", "chi_z_chain", "rotation_share")
"""Columns of a list of modes, besides its frequencies."""


@dataclass(frozen=True)
class Choice:
    """Which modes were asked for: the lowest or highest so many, an interval, or all.

    kind: lowest, highest, between or all; count, of the first two; low, high, Hz, of an interval.
    """

    kind: str
    count: int = 0
    low: float = 0.0
    high: float = np.inf

    @property
    def attributes(self) -> dict[str, Any]:
        """What a file says of it: the kind, its limits, and all of it in words as `interval`."""
        said: dict[str, Any] = {"interval": self.kind, "choice": self.kind}
        if self.kind == "between":
            limits = {"low": self.low, "high": self.high}
            return said | {"interval": f"{self.low:g} {self.high:g}"} | limits
        if self.count:
            said |= {"interval": f"{self.kind} {self.count}", "count": self.count}
        return said

    @classmethod
    def of_attributes(cls, attributes: Mapping[str, Any]) -> Choice:
        """From a file's attributes; of a file that has `interval` alone, from its words."""
        first, *last = str(attributes.get("interval", "all")).split()
        if not last:
            return cls(first)
        if first in ("lowest", "highest"):
            return cls(first, int(last[0]))
        low, high = attributes.get("low", first), attributes.get("high", last[0])
        return cls("between", low=float(low), high=float(high))

    @classmethod
    def of_interval(cls, low: float, high: float) -> Choice:
        """From `low` to below `high`, Hz; InputError where there is nothing between."""
        if high == np.inf:
            raise InputError("input", "an interval without an end", remedy="ask for all modes")
        low, high = map(float, frequencies((low, high)))
        if high <= low:
            empty = f"the interval {low:g} to {high:g} Hz is empty"
            raise InputError("input", f"{empty}", remedy="give the lower end first")
        return cls("between", low=low, high=high)

    def part(self, frequency: Floats, zero: float) -> slice:
        """Which of all frequencies, ascending, Hz, are asked for.

        Those up to `zero` belong to modes that are no elastic ones: the lowest, and those of an
        interval, are without them.
        """
        first, last = int((frequency <= zero).sum()), len(frequency)
        if self.kind == "lowest":
            return slice(first, first + self.count)
        if self.kind == "between":
            first = max(int((frequency < self.low).sum()), first)
            return slice(first, max(first, int((frequency < self.high).sum())))
        return slice(last - self.count if self.kind == "highest" else 0, last)


@dataclass(repr=False)
class ModeSet(Drawn):
    """k modes in ascending order of frequency, as `modal.eigenmodes` finds them.

    Of a crystal's degenerate pairs chi_z and rotation_share are those of travelling waves, while
    the shapes are standing. Equations are those of Otsubo et al. 2017.

    Attributes
    ----------
    frequency : ndarray (k,)
        Hz.
    residual : ndarray (k,)
        |A v - omega^2 v| / omega^2 of the unit vector v, with A = M^-1/2 K M^-1/2, which round-off
        keeps above about eps |A| / omega^2.
    chi_z, chi_z_chain : ndarray (k,)
        Share of the motion along z (Eq. 2), over all particles and over the chain; NaN of the
        latter without a chain.
    rotation_share : ndarray (k,)
        Of rotations in the kinetic energy.
    mode_shape : ndarray (k, n, 6), kg^-1/2, or None
        Displacements and turns, mass-normalised, where they were asked for.
    resonance_frequency, resonance_wavenumber : ndarray (r,), Hz and 1/m, or None
        Of the P-wave resonances r = 1, 2, ..., with the wave number pi r / L (Eq. 4).
    resonance_shape : ndarray (r, nc), kg^-1/2, or None
        Their z-component along the chain.
    attributes : dict
        What was asked for, as words (interval) and as choice, count, low, high; certified, whether
        an exact count says that the list is complete; uncertified_because, why it does not;
        missing, how many modes were asked for and not found; solver; floppy_modes, unstable_modes;
        shapes_left_out, why there are no mode shapes although they were asked for.

    Examples
    --------
    >>> import modal
    >>> modes = modal.eigenmodes(modal.fcc(cells=(1, 1, 20)), lowest=2)
    >>> modes.frequency.shape, modes.certified, modes.missing
    ((2,), True, 0)
    """

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

    @property
    def bytes(self) -> int:
        """What its arrays take."""
        return sum(data.nbytes for data in vars(self).values() if isinstance(data, np.ndarray))

    @property
    def certified(self) -> bool:
        """Whether an exact count says that no mode of the list is missing."""
        return bool(self.attributes.get("certified", False))

    @property
    def missing(self) -> int:
        """How many modes were asked for and not found."""
        return int(self.attributes.get("missing", 0))

    @property
    def floppy_modes(self) -> int:
        """How many motions without energy the network has."""
        return int(self.attributes.get("floppy_modes", 0))

    @property
    def unstable_modes(self) -> int:
        """How many modes release energy: their omega^2 is negative."""
        return int(self.attributes.get("unstable_modes", 0))

    def chi(self, axis: str) -> Floats:
        """Shape (k,): share of the motion along x, y or z of each mode shape that is kept.

        Along z it is `chi_z`, except of pairs of equal frequency that a crystal's lateral symmetry
        gives: their shapes are standing waves, and `chi_z` is that of the travelling wave which the
        two make together. InputError where the mode shapes were not kept.
        """
        if axis not in ("x", "y", "z"):
            raise InputError("input", f"axis {axis!r}", remedy="choose x, y or z")
        return chi_z(self.shapes(), axis="xyz".index(axis))

    def shapes(self, network: Network | None = None) -> Floats:
        """Shape (k, n, 6): the mode shapes; InputError where they were not kept.

        With a `network` also where the modes are of another one.
        """
        if self.mode_shape is None:
            raise InputError(
                "input", "no mode shapes were kept", remedy="ask for fewer modes, or with -o"
            )
        if network is not None:
            noted = self.attributes.get("packing")
            known = noted is None or network.matches(noted)
            if not known or self.mode_shape.shape[1] != network.n_particles:
                raise InputError(
                    "modes_of_another_network",
                    "the modes are of another network, of other spheres, contacts, stiffnesses or "
                    "forces",
                    remedy="take those of this one",
                )
        return self.mode_shape

    def participation(self, network: Network) -> Floats:
        """Shape (k,): share of the network's particles that take part in each mode, 0 to 1.

        InputError where the mode shapes were not kept, or are of another packing.
        """
        return participation_ratio(self.shapes(network), RootMass.of(network))

    def with_zero_modes(self, floppy: int, unstable: int) -> ModeSet:
        """The list, which says how many motions are floppy and unstable unless it does already."""
        self.attributes = {"floppy_modes": floppy, "unstable_modes": unstable} | self.attributes
        return self

    def __repr__(self) -> str:
        text = f"<ModeSet: {len(self.frequency)} modes"
        if len(self.frequency):
            ends = (quantity(float(f), "Hz") for f in self.frequency[[0, -1]])
            text += f" from {' to '.join(ends)}"
        text += ", certified" if self.certified else ", not certified"
        text += f", {self.missing} missing" * (self.missing > 0)
        return f"{text}; {self.floppy_modes} floppy modes>"

    def draw(self, ax: Any) -> None:
        """Draw chi_z of each mode over its frequency, P-wave resonances apart."""
        ax.plot(self.frequency / 1e3, self.chi_z, ".", markersize=3, label="modes")
        if self.resonance_frequency is not None and len(self.resonance_frequency):
            at = self.resonance_frequency / 1e3
            ax.plot(at, np.ones(len(at)), "|", markersize=9, label="P-wave resonances")
            ax.legend()
        ax.set(xlabel="frequency, kHz", ylabel=r"$\chi_z$", ylim=(-0.03, 1.06))


FORMAT = product_of(SCHEMA, ModeSet, others="attributes")


def chi_z(shape: Array, particles: Ints | slice = slice(None), axis: int = 2) -> Floats:
    """Shape (k,): Eq. 2, the mean over particles of u_z^2 / |u|^2 (translations only).

    With another `axis`, 0 or 1, the share along x or y, which tells S-waves as chi_z does P-waves.

    Each particle's displacement is normalised by its own size, so that 1 means that every
    particle moves along z only. The mean is over the particles that move: a particle at rest (below
    1e-9 of the largest, such as the middle layer of an antisymmetric mode) has no direction.
    """
    u2 = np.abs(shape[:, particles, :3]) ** 2
    total = u2.sum(axis=2)
    floor = 1e-18 * total.max(axis=1, keepdims=True)
    moving = total > floor
    share = np.divide(u2[:, :, axis], total, out=np.zeros_like(total), where=moving)
    return share.sum(axis=1) / np.maximum(moving.sum(axis=1), 1)


def participation_ratio(shape: Array, root: RootMass) -> Floats:
    """Shape (k,): share of the particles that take part in modes of shapes (k, n, 6).

    (sum e)^2 / (n sum e^2), e each particle's kinetic energy, rotations included: 1 where all move
    alike, 2/3 in a plane standing wave, 1/n where one moves alone (R. J. Bell and P. Dean, Discuss.
    Faraday Soc. 50, 55, 1970). `root` is M^1/2.
    """
    count, n, _ = shape.shape
    scaled = root.times(np.ascontiguousarray(shape.reshape(count, -1).T)).T
    energy = (np.abs(scaled.reshape(count, n, 6)) ** 2).sum(axis=2)
    return energy.sum(axis=1) ** 2 / (n * (energy**2).sum(axis=1))


def write_modes(path: str | Path, modes: ModeSet, made: Provenance | None = None) -> None:
    """Write the modes atomically, and what they were made from.

    Parameters
    ----------
    path : str or Path
        `*.modes.h5`, replaced if it is there.
    modes : ModeSet
        A list of modes, with shapes where they are to be kept.
    made : Provenance, optional
        Command, sources and settings, kept with it.

    Raises
    ------
    InputError
        Where the file cannot be written.

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
    """Read and validate modes.

    Parameters
    ----------
    path : str or Path
        `*.modes.h5`.
    shapes : bool, default True
        Read the mode shapes, nearly all of a file, too.

    Returns
    -------
    ModeSet
        The modes, as they were written.

    Raises
    ------
    InputError
        With one line for anything wrong with the file.

    Examples
    --------
    >>> import modal, os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "low.modes.h5")
    >>> low = modal.eigenmodes(modal.fcc(cells=(1, 1, 10)), lowest=4)
    >>> write_modes(path, low)
    >>> read_modes(path).certified
    True
    """
    modes = ModeSet(**FORMAT.read(path, leave=() if shapes else ("mode_shape",)))
    with complete(path):
        Choice.of_attributes(modes.attributes)
        for name in WHOLE_NUMBERS & modes.attributes.keys():
            modes.attributes[name] = int(modes.attributes[name])
    if (np.diff(modes.frequency) < 0).any():
        raise InputError(
            "input", f"{path}: frequency is not in ascending order", remedy="make it again"
        )
    along = np.isnan(modes.chi_z_chain)
    if along.any() and not along.all():
        raise InputError("input", f"{path}: chi_z_chain is not finite", remedy="make it again")
    return modes


def read_z_shapes(path: str | Path) -> Floats | None:
    """Shape (k, n), kg^-1/2: the displacements along z of the mode shapes; None without shapes.

    A sixth of the data: files hold the components apart. InputError for anything wrong.
    """
    others = FORMAT.columns.keys() - {"frequency", "mode_shape"}
    along_z = {"mode_shape": np.s_[:, :, 2]}
    shape: Floats | None = FORMAT.read(path, leave=others, parts=along_z)["mode_shape"]
    return shape


def certificate(missing: int, because: str = "") -> dict[str, Any]:
    """Attributes that say whether a list is complete, and how many modes it lacks.

    `because` says why no count was made. A `missing` below zero is a count that contradicts.
    """
    if missing > 0:
        because = f"{missing} modes are missing: not converged, or on an end to round-off"
    if missing < 0:
        because = f"{-missing} more modes were found than the exact count allows"
    attributes = {"certified": not because, "missing": max(missing, 0)}
    return attributes | ({"uncertified_because": because} if because else {})
