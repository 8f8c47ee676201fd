"""Wave signals: what a run, by DEM or by the linear operator, has recorded; its file format.

This module is the one definition of the format "granular-wave-signals", version 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.formats.hdf5 import complete, get, open_h5, put
from modal.formats.provenance import Provenance, new_product
from modal.tools.arrays import Floats, Ints
from modal.tools.display import axes_of, quantity
from modal.tools.errors import InputError
from modal.waves.energy_balance import EnergyBalance

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMA = "granular-wave-signals"
VERSION = 1
_DATASETS = {
    "time": ("time", "f", ("nt",), "s"),
    "chain_particle": ("chain/particle", "i", ("nc",), "1"),
    "chain_position": ("chain/position", "f", ("nc",), "m"),
    "chain_displacement": ("chain/displacement", "f", ("nt", "nc"), "m"),
    "source_displacement": ("source/displacement", "f", ("nt",), "m"),
    "source_stress": ("source/stress", "f", ("nt",), "Pa"),
    "receiver_stress": ("receiver/stress", "f", ("nt",), "Pa"),
    "layer_position": ("layers/position", "f", ("nl",), "m"),
    "layer_displacement": ("layers/displacement", "f", ("nt", "nl"), "m"),
    "particle_displacement": ("particles/displacement", "f", ("nt", "n"), "m"),
}
"""Field: dataset, kind, shape, units."""
DIRECTIONS = ("x", "y", "z")
"""Along which the source wall may move: z sends P-waves, x and y send S-waves."""
_OPTIONAL = {"layer_position", "layer_displacement", "particle_displacement"}


@dataclass(repr=False)
class Signals:
    """Recorded signals of one wave run; nt times, nc particles of the chain.

    time (nt,) s; chain_particle (nc,) index into the network; chain_position (nc,) z of the
    centres at the start, m; chain_displacement (nt, nc), m; source_displacement (nt,) m;
    source_stress, receiver_stress (nt,) Pa, change from the static value, positive as the walls
    push: the source along `direction`, which for z is compression. All displacements, and both
    stresses, are along `direction`, in which the source wall moves.
    amplitude is A of u = A (1 - cos 2 pi f t), m; time_step, run_time in seconds (run_time is
    the wall-clock time that the run took). Optional, None where not recorded: layer_position (nl,)
    and layer_displacement (nt, nl), means over slabs as in `modal.packing.layers`, m; and
    particle_displacement (nt, n) of every particle of the network, m; balance is the
    energy of a DEM run.
    """

    time: Floats
    chain_particle: Ints
    chain_position: Floats
    chain_displacement: Floats
    source_displacement: Floats
    source_stress: Floats
    receiver_stress: Floats
    producer: str
    case: str
    amplitude: float
    input_frequency: float
    time_step: float
    run_time: float
    network_sha256: str
    direction: str = "z"
    layer_position: Floats | None = None
    layer_displacement: Floats | None = None
    particle_displacement: Floats | None = None
    balance: EnergyBalance | None = None

    def __repr__(self) -> str:
        return (
            f"<Signals: {len(self.time)} times up to {quantity(float(self.time[-1]), 's')}, "
            f"{len(self.chain_particle)} particles of the chain, by {self.producer}>"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the displacement over time and distance from the source; returns the Axes.

        Means over layers where they are recorded, else the particles of the chain.
        """
        ax = axes_of(ax)
        place, motion = self.layer_position, self.layer_displacement
        if place is None or motion is None or len(place) < 2:
            place, motion = self.chain_position, self.chain_displacement
        order = np.argsort(place)
        largest = float(abs(motion).max()) * 1e9 or 1.0
        image = ax.pcolormesh(
            self.time * 1e6,
            place[order] * 1e3,
            motion[:, order].T * 1e9,
            cmap="RdBu_r",
            vmin=-largest,
            vmax=largest,
            shading="nearest",
            rasterized=True,
        )
        ax.figure.colorbar(image, ax=ax, label=rf"$u_{self.direction}$, nm")
        ax.set(xlabel=r"time, $\mu$s", ylabel="z, mm")
        return ax


def record_times(duration: float, interval: float) -> Floats:
    """Times (nt,), s, of a record: from 0 on, none after its `duration` but by round-off."""
    return interval * np.arange(np.floor(duration / interval * (1 + 1e-9)) + 1)


def source_pulse(time: Floats, amplitude: float, frequency: float, cycles: int = 1) -> Floats:
    """Wall displacement u = A (1 - cos 2 pi f t) for one period, or some, zero elsewhere; m.

    A sine period with its phase shifted by 270 degrees (Otsubo et al. 2017, Fig. 2a).
    """
    time = np.asarray(time)
    inside = (time > 0) & (time * frequency < cycles)
    # 1 - cos x = 2 sin^2 (x / 2) keeps its digits where the pulse is much longer than the record.
    return np.where(inside, 2 * amplitude * np.sin(np.pi * frequency * time) ** 2, 0.0)


_ATTRIBUTES = {
    "producer": str,
    "case": str,
    "amplitude": float,
    "input_frequency": float,
    "time_step": float,
    "run_time": float,
    "network_sha256": str,
}


def write_signals(path: str | Path, signals: Signals, made: Provenance | None = None) -> None:
    """Write the signals atomically, and what they were made from."""
    with new_product(path, SCHEMA, VERSION, made) as file:
        for name, convert in _ATTRIBUTES.items():
            file.attrs[name] = convert(getattr(signals, name))
        file.attrs["direction"] = signals.direction
        for name, (dataset, kind, _, units) in _DATASETS.items():
            value = getattr(signals, name)
            if value is None and name in _OPTIONAL:
                continue
            data = np.asarray(value).astype(np.float64 if kind == "f" else np.int32)
            put(file, dataset, data, units)
        if signals.balance:
            file.create_group("balance").attrs.update(signals.balance.attributes())


def read_signals(path: str | Path) -> Signals:
    """Read and validate signals; raises InputError with one line for anything wrong."""
    with open_h5(path, SCHEMA, VERSION) as file:
        lengths: dict[str, int] = {}
        columns: dict[str, Any] = {}
        for name, (dataset, kind, shape, _) in _DATASETS.items():
            if name in _OPTIONAL and dataset not in file:
                continue
            column = get(file, dataset, kind, tuple(lengths.get(length) for length in shape))
            lengths.update(zip(shape, column.shape, strict=True))
            if not np.isfinite(column).all():
                raise InputError(f"{path}: {dataset} is not finite; the run failed, make it again")
            columns[name] = column
        with complete(path):
            for name, convert in _ATTRIBUTES.items():
                columns[name] = convert(file.attrs[name])
            # Files of earlier versions are of P-waves and do not say so.
            columns["direction"] = str(file.attrs.get("direction", "z"))
            said = file["balance"].attrs if "balance" in file else {}
            balance = EnergyBalance.of_attributes(said)
    signals = Signals(**columns, balance=balance)
    _validate(signals, str(path))
    return signals


def _validate(signals: Signals, name: str) -> None:
    """Refuse signals that no run records; all estimators rely on evenly spaced times."""
    time = signals.time
    if len(time) < 2 or len(signals.chain_particle) == 0:
        raise InputError(f"{name}: fewer than two times or no chain; record more")
    step = np.diff(time)
    even = (abs(step - step.mean()) < 1e-3 * step.mean()).all()
    if not (abs(time[0]) < 1e-3 * step.mean() and even):
        raise InputError(
            f"{name}: the times, from {time[0]:g} s on, are not evenly spaced from 0 on, where the "
            "source begins to move; record them so"
        )
    if (signals.chain_particle < 0).any() or len(set(signals.chain_particle.tolist())) < len(
        signals.chain_particle
    ):
        raise InputError(f"{name}: chain/particle has a negative or a repeated index; mend it")
    if signals.direction not in DIRECTIONS:
        raise InputError(f"{name}: direction {signals.direction!r} is none of x, y, z; mend it")
    numbers = (signals.input_frequency, signals.time_step)
    if not (np.isfinite([*numbers, signals.amplitude]).all() and min(numbers) > 0):
        raise InputError(f"{name}: input_frequency and time_step must be positive; mend them")
