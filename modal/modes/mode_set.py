"""Modes of a network and their file format "granular-modes", version 1 (one definition)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.display import axes_of, quantity
from modal.formats.arrays import Floats
from modal.formats.hdf5 import InputError, atomic_h5, get, open_h5, put
from modal.formats.provenance import Provenance

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMA = "granular-modes"
VERSION = 1
_UNITS = {
    "frequency": ((None,), "Hz"),
    "residual": ((None,), "1"),
    "chi_z": ((None,), "1"),
    "chi_z_chain": ((None,), "1"),
    "rotation_share": ((None,), "1"),
    "mode_shape": ((None, None, 6), "kg^-1/2"),
    "resonance_frequency": ((None,), "Hz"),
    "resonance_wavenumber": ((None,), "1/m"),
    "resonance_shape": ((None, None), "kg^-1/2"),
}


@dataclass(repr=False)
class ModeSet:
    """k modes in ascending order of frequency.

    frequency (k,) Hz; residual (k,) |A v - omega^2 v| / omega^2 of the unit vector v, with A =
    M^-1/2 K M^-1/2, which round-off keeps above about eps |A| / omega^2; chi_z, chi_z_chain (k,)
    Eq. 2 over all particles and over the chain; rotation_share (k,) of the kinetic energy;
    mode_shape (k, n, 6), mass-normalised, where asked for. resonance_* hold the P-wave
    resonances r = 1, 2, ...: frequency, wave number pi r / L (Eq. 4) and the z-component along
    the chain. attributes: interval, what was asked for; certified, whether an exact count says that
    the list is complete; uncertified_because, why it does not; missing, how many modes were asked
    for and not found; solver; numbers of floppy modes; shapes_left_out, why there are no mode
    shapes although they were asked for.
    """

    frequency: Floats
    residual: Floats
    chi_z: Floats
    chi_z_chain: Floats
    rotation_share: Floats
    mode_shape: Floats | None = None
    resonance_frequency: Floats | None = None
    resonance_wavenumber: Floats | None = None
    resonance_shape: Floats | None = None
    attributes: dict[str, Any] = field(default_factory=dict)

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

    def __repr__(self) -> str:
        text = f"<ModeSet: {len(self.frequency)} modes"
        if len(self.frequency):
            ends = (quantity(float(f), "Hz") for f in self.frequency[[0, -1]])
            text += f" from {' to '.join(ends)}"
        text += ", certified" if self.certified else ", not certified"
        text += f", {self.missing} missing" * (self.missing > 0)
        return f"{text}; {self.floppy_modes} floppy modes>"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw chi_z of each mode over its frequency, P-wave resonances apart; returns the Axes."""
        ax = axes_of(ax)
        ax.plot(self.frequency / 1e3, self.chi_z, ".", markersize=3, label="modes")
        if self.resonance_frequency is not None and len(self.resonance_frequency):
            at = self.resonance_frequency / 1e3
            ax.plot(at, np.ones(len(at)), "|", markersize=9, label="P-wave resonances")
            ax.legend()
        ax.set(xlabel="frequency, kHz", ylabel=r"$\chi_z$", ylim=(-0.03, 1.06))
        return ax


def write_modes(path: str | Path, modes: ModeSet, made: Provenance | None = None) -> None:
    """Write the modes atomically, and what they were made from."""
    with atomic_h5(path) as file:
        if made:
            made.write(file)
        file.attrs.update(modes.attributes)
        file.attrs.update(schema=SCHEMA, schema_version=VERSION)
        for name, (_, units) in _UNITS.items():
            data = getattr(modes, name)
            if data is not None:
                put(file, name, data, units)


def read_modes(path: str | Path) -> ModeSet:
    """Read and validate modes; raises InputError with one line for anything wrong."""
    with open_h5(path, SCHEMA, VERSION) as file:
        required = ("frequency", "residual", "chi_z", "chi_z_chain", "rotation_share")
        columns = {
            name: get(file, name, "f", shape)
            for name, (shape, _) in _UNITS.items()
            if name in required or name in file
        }
        reserved = ("schema", "schema_version")
        attributes = {key: value for key, value in file.attrs.items() if key not in reserved}
    modes = ModeSet(**columns, attributes=attributes)
    _validate(modes, str(path))
    return modes


def _validate(modes: ModeSet, name: str) -> None:
    """Refuse columns of different lengths, what is not finite, and frequencies out of order."""
    for count, columns in (
        ("frequency", ("residual", "chi_z", "chi_z_chain", "rotation_share", "mode_shape")),
        ("resonance_frequency", ("resonance_wavenumber", "resonance_shape")),
    ):
        frequency = getattr(modes, count)
        for column in columns:
            data = getattr(modes, column)
            if data is not None and (frequency is None or len(data) != len(frequency)):
                raise InputError(f"{name}: {column} and {count} differ in length; make it again")
    if (np.diff(modes.frequency) < 0).any():
        raise InputError(f"{name}: frequency is not in ascending order; make it again")
    for column in _UNITS:
        data = getattr(modes, column)
        # Without a chain there is no chi_z along it.
        absent = column == "chi_z_chain" and np.isnan(data).all()
        if data is not None and not (absent or np.isfinite(data).all()):
            raise InputError(f"{name}: {column} is not finite; make it again")
