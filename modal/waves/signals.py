"""Wave signals: what a run, by DEM or by the linear operator, has recorded; its file format.

This module defines the format "granular-wave-signals": version 1 from wall to wall, version 2 also
of what else can send a wave. The columns of a recording, over time or over frequency, are one table
for both of their files. A wave is recorded over time, in m and Pa (of torsion in rad, and torque
over area, N/m); a response over frequency, complex, per unit of the source's motion. What a source
or a packing does not have, as a cell without walls a chain and stresses on them, is an empty array,
and not in the file.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.formats.hdf5 import complete, open_h5
from modal.formats.product import Column, Product
from modal.formats.provenance import Provenance
from modal.tools.arrays import Floats, Ints
from modal.tools.display import axes_of, quantity
from modal.tools.errors import InputError
from modal.waves.energy_balance import EnergyBalance

if TYPE_CHECKING:
    from matplotlib.axes import Axes


TORSION = "torsion"
DIRECTIONS = ("x", "y", "z")
"""Along which a source may move: z sends P-waves, x and y send S-waves."""
COMPONENT = {"x": 0, "y": 1, "z": 2, TORSION: 5}
"""Of the six motions of a sphere the one that is recorded: along the direction, or about z."""
_RECORDED = {
    "source_stress": Column("source/stress", "f", ("n",), "Pa", optional=True),
    "receiver_stress": Column("receiver/stress", "f", ("n",), "Pa", optional=True),
    "chain_displacement": Column("chain/displacement", "f", ("n", "nc"), "m", optional=True),
    "layer_displacement": Column("layers/displacement", "f", ("n", "nl"), "m", optional=True),
}
_PLACES = {
    "chain_particle": Column("chain/particle", "i", ("nc",), "1", optional=True),
    "layer_position": Column("layers/position", "f", ("nl",), "m", optional=True),
    "source_height": Column("source/height", "f", (1,), "m", optional=True, since=2),
}
OF_TIME = {
    "time": Column("time", "f", ("n",), "s"),
    "source_displacement": Column("source/displacement", "f", ("n",), "m"),
    "particle_displacement": Column("particles/displacement", "f", ("n", "np"), "m", optional=True),
    "chain_position": Column("chain/position", "f", ("nc",), "m", optional=True),
    "slip_ends": Column("slip/ends", "i", ("ns", 2), "1", optional=True),
    "slip_energy": Column("slip/energy", "f", ("ns",), "J", optional=True),
    **(_PLACES | _RECORDED),
}
"""Of a recording over time."""
OF_FREQUENCY = {
    "frequency": Column("frequency", "f", ("n",), "Hz"),
    "gain": Column("gain", "f", ("n",), "1", optional=True),
    **_PLACES,
    **{
        name: column._replace(
            kind="c", unit=f"{column.unit}/m", optional=name != "layer_displacement"
        )
        for name, column in _RECORDED.items()
    },
}
"""Over frequency, per metre of the source; means over layers are always there."""
VERSION = (1, 2)
"""Of the files."""
TWISTED = {"m": "rad", "Pa": "N/m"}
"""Units in torsion, of what moves and of what resists."""
SAID = {"direction": str, "source": str, "network_sha256": str}
"""Attributes of both, with what files of before mean that do not say so."""
UNSAID = {"direction": "z", "source": "wall", "network_sha256": ""}


def write_recording(
    product: Product, path: str | Path, values: Mapping[str, Any], made: Provenance | None
) -> None:
    """Write what is there, torsion in its own units; what is empty is left out."""
    columns = product.columns
    if values["direction"] == TORSION:
        columns = {name: _twisted(column) for name, column in columns.items()}
    there = {
        name: None if name in columns and np.size(value) == 0 else value
        for name, value in values.items()
    }
    replace(product, columns=columns).write(path, there, made)


def read_recording(product: Product, path: str | Path) -> dict[str, Any]:
    """All values that are there; InputError for anything wrong."""
    said = product.read(path)
    if said["direction"] not in COMPONENT:
        known = ", ".join(COMPONENT)
        raise InputError(f"{path}: direction {said['direction']!r} is none of {known}; mend it")
    there = {name: value for name, value in said.items() if value is not None}
    length = len(said["time" if "time" in said else "frequency"])
    return {"chain_displacement": np.empty((length, 0))} | there


def absent(kind: type = float) -> Any:
    """A column of a recording that an empty array stands for where it is not there."""
    return field(default_factory=lambda: np.empty(0, kind))


def _twisted(column: Column) -> Column:
    """The column in torsion's units, of what is recorded along its direction."""
    if column.dataset.rpartition("/")[2] not in ("displacement", "stress"):
        return column
    unit, *per = column.unit.split("/")
    return column._replace(unit="/".join([TWISTED[unit], *per]))


SCHEMA = "granular-wave-signals"
PLANE = "granular-plane-wave"
"""The schema, version 1, of a wave from a plane in files of before."""
FORMAT = Product(
    SCHEMA,
    OF_TIME,
    SAID
    | {"producer": str, "case": str}
    | dict.fromkeys(("amplitude", "input_frequency", "time_step", "run_time"), float),
    UNSAID,
    groups=("balance",),
    versions=VERSION,
)
_OF_PLANE = (
    *("time", "source_displacement", "particle_displacement"),
    *("layer_position", "layer_displacement"),
)
PLANE_FORMAT = Product(
    PLANE,
    {name: OF_TIME[name] for name in _OF_PLANE},
    {"height": float, "direction": str, "network_sha256": str},
)


@dataclass(repr=False, kw_only=True)
class Signals:
    """Recorded signals of one wave run; nt times, nc particles of the chain.

    time (nt,) s; chain_particle (nc,) index into the network; chain_position (nc,) z of the
    centres at the start, m; chain_displacement (nt, nc), m; source_displacement (nt,) m;
    source_stress, receiver_stress (nt,) Pa, change from the static value, positive as the walls
    push: the source along `direction`, which for z is compression. All displacements, and both
    stresses, are along `direction`, in which the source moves.
    amplitude is A of u = A (1 - cos 2 pi f t), m; time_step, run_time in seconds (run_time is
    the wall-clock time that the run took). `source` is "wall", or says what else was moved, at
    `source_height` (1,), m; `source_stress` is then what holds it, over the area, or empty where a
    force is given. `receiver_stress` and the chain are empty in a cell without walls. Of torsion
    displacements are turns about z, rad, and stresses torques over the area, N/m. Optional, None
    where not recorded: layer_position (nl,) and layer_displacement (nt, nl), means over slabs as in
    `modal.packing.layers`, m; and particle_displacement (nt, n) of every particle of the network,
    m; balance is the energy of a DEM run. Of a non-linear wave slip_ends (ns, 2) are the two
    particles, or a particle and a wall (as in a network), of each contact that slid, and
    slip_energy (ns,), J, what its slip dissipated: their sum is all that slip dissipated.
    """

    time: Floats
    chain_particle: Ints = absent(int)
    chain_position: Floats = absent()
    chain_displacement: Floats
    source_displacement: Floats
    source_stress: Floats = absent()
    receiver_stress: Floats = absent()
    producer: str
    case: str
    amplitude: float
    input_frequency: float
    time_step: float
    run_time: float
    network_sha256: str
    direction: str = "z"
    source: str = "wall"
    source_height: Floats | None = None
    layer_position: Floats | None = None
    layer_displacement: Floats | None = None
    particle_displacement: Floats | None = None
    balance: EnergyBalance | None = None
    slip_ends: Ints | None = None
    slip_energy: Floats | None = None

    def __repr__(self) -> str:
        return (
            f"<Signals: {len(self.time)} times up to {quantity(float(self.time[-1]), 's')}, "
            f"{len(self.chain_particle)} particles of the chain, by {self.producer}>"
        )

    @property
    def from_wall_to_wall(self) -> bool:
        """Whether a wall sent it along x, y or z, and a chain leads to another one."""
        whole = min(map(len, (self.chain_particle, self.source_stress, self.receiver_stress)))
        return whole > 0 and self.source == "wall" and self.direction != TORSION

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
        twisted = self.direction == TORSION
        label = r"$\theta_z$, nrad" if twisted else rf"$u_{self.direction}$, nm"
        ax.figure.colorbar(image, ax=ax, label=label)
        ax.set(xlabel=r"time, $\mu$s", ylabel="z, mm")
        return ax


@dataclass(frozen=True, repr=False)
class Wave(ABC):
    """What a run gives: its `signals`, and what else it has to tell."""

    signals: Signals

    @property
    @abstractmethod
    def told(self) -> str:
        """Beside the signals."""

    def __repr__(self) -> str:
        found = quantity(float(abs(self.signals.receiver_stress).max(initial=0.0)), "Pa")
        return (
            f"<{type(self).__name__}: {self.signals!r}, {found} at most on the receiver wall, "
            f"{self.told}>"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the displacement over time and distance, as `Signals.plot`; returns the Axes."""
        return self.signals.plot(ax)


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


def write_signals(path: str | Path, signals: Signals, made: Provenance | None = None) -> None:
    """Write the signals atomically, and what they were made from."""
    balance = signals.balance.attributes() if signals.balance else {}
    write_recording(FORMAT, path, vars(signals) | {"balance": balance}, made)


def read_signals(path: str | Path, *, of_any_source: bool = False) -> Signals:
    """Read and validate signals; InputError with one line for anything wrong.

    They are of a wave that goes from wall to wall along x, y or z, unless those `of_any_source` are
    asked for; those of a plane in files of before then, too.
    """
    with open_h5(path) as file:
        plane = of_any_source and file.attrs.get("schema") == PLANE
    signals = _of_plane(PLANE_FORMAT.read(path)) if plane else Signals(**_read(path))
    if not (signals.from_wall_to_wall or of_any_source):
        raise InputError(f"{path}: not of a wave from wall to wall; only `export` shows it")
    _validate(signals, str(path))
    return signals


def _read(path: str | Path) -> dict[str, Any]:
    said = read_recording(FORMAT, path)
    with complete(path):
        said["balance"] = EnergyBalance.of_attributes(said["balance"])
    return said


def _of_plane(said: dict[str, Any]) -> Signals:
    """What a file of before says of a wave from a plane; the rest is taken from its columns."""
    height, time = said.pop("height"), said["time"]
    return Signals(
        **said,
        chain_displacement=np.empty((len(time), 0)),
        source=f"plane at {height:g} m",
        source_height=np.array([height]),
        producer="linear",
        case="",
        amplitude=float(np.ptp(said["source_displacement"])) / 2,
        input_frequency=1 / float(time[-1]),
        time_step=float(time[-1]) / (len(time) - 1),
        run_time=0.0,
    )


def _validate(signals: Signals, name: str) -> None:
    """Refuse signals that no run records; all estimators rely on evenly spaced times."""
    time = signals.time
    chain = signals.chain_particle
    if len(time) < 2 or (len(chain) == 0 and signals.layer_position is None):
        raise InputError(f"{name}: fewer than two times or no chain; record more")
    step = np.diff(time)
    even = (abs(step - step.mean()) < 1e-3 * step.mean()).all()
    if not (abs(time[0]) < 1e-3 * step.mean() and even):
        raise InputError(
            f"{name}: the times, from {time[0]:g} s on, are not evenly spaced from 0 on, where the "
            "source begins to move; record them so"
        )
    if (chain < 0).any() or len(set(chain.tolist())) < len(chain):
        raise InputError(f"{name}: chain/particle has a negative or a repeated index; mend it")
    numbers = (signals.input_frequency, signals.time_step)
    if not (np.isfinite([*numbers, signals.amplitude]).all() and min(numbers) > 0):
        raise InputError(f"{name}: input_frequency and time_step must be positive; mend them")
