"""Wave signals: what a run, by DEM or by the linear operator, has recorded; its file format.

This module defines the format "granular-wave-signals": version 1 from wall to wall, version 2 also
of what else can send a wave. The columns of a recording, over time or over frequency, are one table
for both of their files. A wave is recorded over time, in m and Pa (of torsion in rad, and torque
over area, N/m); a response over frequency, complex, per unit of the source's motion. What a source
or a packing does not have, as a cell without walls a chain and stresses on them, is an empty array,
and not in the file.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from modal.formats.attributes import read_attributes
from modal.formats.hdf5 import complete, open_h5
from modal.formats.product import Column, Product, product_of
from modal.formats.provenance import Provenance
from modal.tools.arrays import Floats, Ints
from modal.tools.display import Drawn, quantity
from modal.tools.errors import InputError
from modal.tools.visible import visible
from modal.tools.workload import refuse_above_memory
from modal.waves.energy_balance import EnergyBalance

TORSION = "torsion"
DIRECTIONS = ("x", "y", "z")
"""Along which a source may move: z sends P-waves, x and y send S-waves."""
COMPONENT = {"x": 0, "y": 1, "z": 2, TORSION: 5}
"""Of the six motions of a sphere the one that is recorded: along the direction, or about z."""
VERSION = (1, 2)
"""Of the files."""
MOVED = ("displacement", "stress")
"""Names of columns along the direction of the source."""
TWISTED = {"m": "rad", "Pa": "N/m"}
"""Units in torsion, of what moves and of what resists."""


def absent(kind: type = float) -> Any:
    """A column of a recording that an empty array stands for where it is not there."""
    return field(default_factory=lambda: np.empty(0, kind))


@dataclass(repr=False, kw_only=True)
class Recording:
    """What is recorded over time or over frequency, n of them, as its file has it.

    What a source or a packing does not have is empty, or None. Stresses are along `direction`, in
    which the source moves, as the walls push: for z compression is positive.
    """

    chain_particle: Annotated[Ints, Column("chain/particle", "i", ("nc",), "1")] = absent(int)
    chain_displacement: Annotated[Any, Column("chain/displacement", "f", ("n", "nc"), "m")] = (
        absent()
    )
    layer_position: Annotated[Any, Column("layers/position", "f", ("nl",), "m")] = None
    layer_displacement: Annotated[Any, Column("layers/displacement", "f", ("n", "nl"), "m")] = None
    source_stress: Annotated[Any, Column("source/stress", "f", ("n",), "Pa")] = absent()
    receiver_stress: Annotated[Any, Column("receiver/stress", "f", ("n",), "Pa")] = absent()
    source_height: Annotated[Any, Column("source/height", "f", (1,), "m", since=2)] = None
    direction: str = "z"
    source: str = "wall"


def along(column: Column, **changed: Any) -> Column:
    """The column, changed where it is along the direction of the source."""
    return column._replace(**changed) if column.dataset.rpartition("/")[2] in MOVED else column


def write_recording(
    product: Product, path: str | Path, values: Mapping[str, Any], made: Provenance | None
) -> None:
    """Write what is there, torsion in its own units; what is empty is left out."""
    there = {
        name: None if name in product.columns and np.size(value) == 0 else value
        for name, value in values.items()
    }
    _of_direction(product, values["direction"]).write(path, there, made)


def _of_direction(product: Product, direction: str) -> Product:
    """Return the format of a recording along a direction: torsion has units of its own."""
    if direction != TORSION:
        return product
    columns = dict(product.columns)
    for name, column in columns.items():
        unit, *per = column.unit.split("/")
        columns[name] = along(column, unit="/".join([TWISTED.get(unit, unit), *per]))
    return replace(product, columns=columns)


def read_recording(product: Product, path: str | Path) -> dict[str, Any]:
    """All values that are there; InputError for anything wrong."""
    with open_h5(path) as file:
        direction = read_attributes(file).get("direction", "z")
    said = _of_direction(product, direction).read(path)
    if said["direction"] not in COMPONENT:
        known = ", ".join(COMPONENT)
        raise InputError(
            "input", f"{path}: direction {said['direction']!r} is none of {known}", remedy="mend it"
        )
    there = {name: value for name, value in said.items() if value is not None}
    length = len(said["time" if "time" in said else "frequency"])
    return {"chain_displacement": np.empty((length, 0))} | there


@dataclass(repr=False, kw_only=True)
class Signals(Recording, Drawn):
    """Recorded signals of one wave run; nt times, nc particles of the chain, nl layers.

    All displacements, and both stresses, are along `direction`, in which the source moves. Of
    torsion displacements are turns about z, rad, and stresses torques over the area, N/m. What a
    cell without walls has not, the chain and a stress on the receiver, is empty.

    Attributes
    ----------
    time : ndarray (nt,)
        s, evenly spaced from 0.
    chain_particle, chain_position : ndarray (nc,), index into the network and m
        Of the chain, and z of its centres at the start.
    chain_displacement : ndarray (nt, nc)
        m.
    source_displacement : ndarray (nt,)
        m; of a force that is given N, or N m.
    source_stress, receiver_stress : ndarray (nt,)
        Pa, change from the static value, positive as the walls push: along z compression. Of a
        plane what holds it, over the area; empty of a force.
    layer_position, layer_displacement : ndarray (nl,) and (nt, nl), m, or None
        Means over slabs as in `modal.packing.layers`.
    particle_displacement : ndarray (nt, n), m, or None
        Of every particle of the network.
    source, source_height : str, ndarray (1,) m or None
        "wall", or what else was moved, and where.
    direction : str, default "z"
        x, y, z or torsion.
    amplitude, input_frequency : float, m and Hz
        A and f of u = A (1 - cos 2 pi f t).
    time_step, run_time : float
        s; the latter is the wall-clock time that the run took.
    producer, case : str
        Who made it, and of which packing.
    balance : EnergyBalance or None
        The energy of a DEM run.
    slip_ends, slip_energy : ndarray of int (ns, 2) and ndarray (ns,) J, or None
        Of a non-linear wave the two ends, particles or a wall's number, of each contact that slid,
        and what its slip dissipated: their sum is all that slip dissipated.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 20))
    >>> signals = modal.propagate(crystal, duration=2e-5, interval=1e-6).signals
    >>> signals.time.shape, signals.chain_displacement.shape
    ((21,), (21, 20))
    """

    time: Annotated[Floats, Column("time", "f", ("n",), "s")]
    source_displacement: Annotated[Floats, Column("source/displacement", "f", ("n",), "m")]
    chain_position: Annotated[Floats, Column("chain/position", "f", ("nc",), "m")] = absent()
    particle_displacement: Annotated[
        Floats | None, Column("particles/displacement", "f", ("n", "np"), "m")
    ] = None
    slip_ends: Annotated[Ints | None, Column("slip/ends", "i", ("ns", 2), "1")] = None
    slip_energy: Annotated[Floats | None, Column("slip/energy", "f", ("ns",), "J")] = None
    producer: str
    case: str
    amplitude: float
    input_frequency: float
    time_step: float
    run_time: float
    balance: EnergyBalance | None = None

    def __repr__(self) -> str:
        return (
            f"<Signals: {len(self.time)} times up to {quantity(float(self.time[-1]), 's')}, "
            f"{len(self.chain_particle)} particles of the chain, by {visible(self.producer)}>"
        )

    @property
    def from_wall_to_wall(self) -> bool:
        """Whether a wall sent it along x, y or z, and a chain leads to another one."""
        whole = min(map(len, (self.chain_particle, self.source_stress, self.receiver_stress)))
        return whole > 0 and self.source == "wall" and self.direction != TORSION

    def draw(self, ax: Any) -> None:
        """Draw the displacement over time and distance from the source.

        Means over layers where they are recorded, else the particles of the chain.
        """
        place, motion = self.layer_position, self.layer_displacement
        if place is None or motion is None or len(place) < 2:
            place, motion = self.chain_position, self.chain_displacement
        order = np.argsort(place)
        largest = float(abs(motion).max()) * 1e9 or 1.0
        drawn = self.time * 1e6, place[order] * 1e3, motion[:, order].T * 1e9
        style: dict[str, Any] = {"cmap": "RdBu_r", "shading": "nearest", "rasterized": True}
        image = ax.pcolormesh(*drawn, vmin=-largest, vmax=largest, **style)
        twisted = self.direction == TORSION
        label = r"$\theta_z$, nrad" if twisted else rf"$u_{self.direction}$, nm"
        ax.figure.colorbar(image, ax=ax, label=label)
        ax.set(xlabel=r"time, $\mu$s", ylabel="z, mm")


SCHEMA = "granular-wave-signals"
FORMAT = product_of(SCHEMA, Signals, groups=("balance",), versions=VERSION)
PLANE = "granular-plane-wave"
"""The schema, version 1, of a wave from a plane in files of before."""


@dataclass(frozen=True, repr=False)
class Wave(Drawn):
    """What a run gives: its `signals`, and what else it has to tell."""

    signals: Signals

    def __repr__(self) -> str:
        found = quantity(float(abs(self.signals.receiver_stress).max(initial=0.0)), "Pa")
        return f"<{type(self).__name__}: {self.signals!r}, {found} at most on the receiver wall>"

    def draw(self, ax: Any) -> None:
        """Draw the displacement over time and distance, as `Signals`."""
        self.signals.draw(ax)


def record_times(duration: float, interval: float) -> Floats:
    """Times (nt,), s, of a record: from 0 on, none after its `duration` but by round-off."""
    count = np.floor(duration / interval * (1 + 1e-9)) + 1
    refuse_above_memory(8 * count, f"a record every {interval:g} s", "take a longer interval")
    return interval * np.arange(count)


def write_signals(path: str | Path, signals: Signals, made: Provenance | None = None) -> None:
    """Write the signals atomically, and what they were made from.

    Parameters
    ----------
    path : str or Path
        `*.signals.h5`, replaced if it is there.
    signals : Signals
        What a wave recorded.
    made : Provenance, optional
        Command, sources and settings, kept with it.

    Raises
    ------
    InputError
        Where the file cannot be written.

    Examples
    --------
    >>> import modal, os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "push.signals.h5")
    >>> wave = modal.propagate(modal.fcc(cells=(1, 1, 10)), 2e-5).signals
    >>> write_signals(path, wave)
    >>> read_signals(path).producer
    'linear'
    """
    balance = signals.balance.attributes() if signals.balance else {}
    write_recording(FORMAT, path, vars(signals) | {"balance": balance}, made)


def read_signals(path: str | Path, *, of_any_source: bool = False) -> Signals:
    """Read and validate signals.

    Parameters
    ----------
    path : str or Path
        `*.signals.h5`.
    of_any_source : bool, default False
        Take also waves that do not go from wall to wall along x, y or z, and older files of planes.

    Returns
    -------
    Signals
        What the wave recorded, as it was written.

    Raises
    ------
    InputError
        With one line for anything wrong with the file.

    Examples
    --------
    >>> import modal, os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "push.signals.h5")
    >>> wave = modal.propagate(modal.fcc(cells=(1, 1, 10)), 2e-5).signals
    >>> write_signals(path, wave)
    >>> read_signals(path).producer
    'linear'
    """
    with open_h5(path) as file:
        plane = of_any_source and read_attributes(file).get("schema") == PLANE
    signals = Signals(**(_of_plane if plane else _said)(path))
    if not (signals.from_wall_to_wall or of_any_source):
        raise InputError(
            "other_source",
            f"{path}: a record of {signals.source} along {signals.direction}, not of a wave from "
            "wall to wall, of which velocities are measured",
            remedy=(
                "make one without --point, --plane and "
                "torsion, look at this one with `export` (recorded with --particles), or take its "
                "displacements in Python with read_signals(path, of_any_source=True)"
            ),
        )
    _validate(signals, str(path))
    return signals


def _said(path: str | Path) -> dict[str, Any]:
    said = read_recording(FORMAT, path)
    with complete(path):
        said["balance"] = EnergyBalance.of_attributes(said["balance"])
    return said


def _of_plane(path: str | Path) -> dict[str, Any]:
    """What a file of before says of a wave from a plane; the rest is taken from its columns."""
    attributes = {"height": float, "direction": str}
    said = read_recording(Product(PLANE, FORMAT.columns, attributes), path)
    height, time = said.pop("height"), said["time"]
    return (
        {"producer": "linear", "case": "", "run_time": 0.0}
        | said
        | {
            "source": f"plane at {height:g} m",
            "source_height": np.array([height]),
            "amplitude": float(np.ptp(said["source_displacement"])) / 2,
            "input_frequency": 1 / float(time[-1]),
            "time_step": float(time[1]),
        }
    )


def _validate(signals: Signals, name: str) -> None:
    """Refuse signals that no run records; all estimators rely on evenly spaced times."""
    time = signals.time
    chain = signals.chain_particle
    if len(time) < 2 or (len(chain) == 0 and signals.layer_position is None):
        raise InputError("input", f"{name}: fewer than two times or no chain", remedy="record more")
    step = np.diff(time)
    even = (abs(step - step.mean()) < 1e-3 * step.mean()).all()
    if not (abs(time[0]) < 1e-3 * step.mean() and even):
        raise InputError(
            "input",
            f"{name}: the times, from {time[0]:g} s on, are not evenly spaced from 0 on, where the "
            "source begins to move",
            remedy="record them so",
        )
    if (chain < 0).any() or len(set(chain.tolist())) < len(chain):
        raise InputError(
            "input", f"{name}: chain/particle has a negative or a repeated index", remedy="mend it"
        )
    numbers = (signals.input_frequency, signals.time_step)
    if not (np.isfinite([*numbers, signals.amplitude]).all() and min(numbers) > 0):
        raise InputError(
            "input", f"{name}: input_frequency and time_step must be positive", remedy="mend them"
        )
