"""Store signals of a wave, recorded by a DEM or computed from the linear system.

This module defines the format "granular-wave-signals": version 1 for waves from wall to wall,
version 2 for waves from other sources as well. A wave is recorded over time, in m and Pa (torsion:
in rad, and in N/m, torque divided by area); a response is recorded over frequency, complex, per
unit motion of the source. Both files share one table of columns. Data that do not exist for a
source or a packing are empty arrays, and absent from the file: a cell without walls, for example,
has neither a chain nor stresses on walls.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from modal.formats.attributes import read_attributes
from modal.formats.column import Column
from modal.formats.hdf5 import complete, open_h5
from modal.formats.product import Product, product_of
from modal.formats.provenance import Provenance
from modal.formats.tables import Tabular
from modal.tools.arrays import Floats, Ints
from modal.tools.display import Drawn, quantity
from modal.tools.errors import InputError
from modal.tools.visible import visible
from modal.tools.workload import refuse_above_memory
from modal.waves.energy_balance import EnergyBalance

Direction = Literal["x", "y", "z", "torsion"]
"""Motion of a source: z sends P-waves, x and y send S-waves, torsion turns about z."""
TORSION: Literal["torsion"] = "torsion"
DIRECTIONS = ("x", "y", "z")
"""Directions of a source that moves without turning."""
COMPONENT = {"x": 0, "y": 1, "z": 2, TORSION: 5}
"""Index, among the six motions of a sphere, of the one that is recorded for each direction."""
WALL_SOURCES = ("wall", "rough wall")
"""Names of the sources at the end of a packing, from which a wave goes to the other end."""
FILE_VERSIONS = (1, 2)
"""Versions of the file format that are read."""
DIRECTED_COLUMNS = ("displacement", "stress")
"""Last parts of the names of columns whose values are components along the source's direction."""
TORSION_UNITS = {"m": "rad", "Pa": "N/m"}
"""Units in torsion in place of those of displacements and of stresses."""
MAX_UNEVEN_STEP = 1e-3
"""Largest relative deviation of a recorded time step from the mean: estimators need even steps."""


def no_values(kind: type = float) -> Any:
    """Return a dataclass field that is an empty array by default."""
    return field(default_factory=lambda: np.empty(0, kind))


@dataclass(repr=False, kw_only=True)
class Recording(Tabular):
    """A recording at n times or n frequencies; the fields are the columns of its file.

    Fields that do not exist for a source or a packing are empty or None. Stresses are along
    `direction`, the direction of the source, with the sign of the walls' push: for z compression is
    positive.
    """

    DIMENSIONS = {"nc": "chain", "nl": "layer", "np": "particle", "ns": "slip", 2: "end"}

    chain_particle: Annotated[Ints, Column("chain/particle", "i", ("nc",), "1")] = no_values(int)
    chain_displacement: Annotated[Any, Column("chain/displacement", "f", ("n", "nc"), "m")] = (
        no_values()
    )
    layer_position: Annotated[Any, Column("layers/position", "f", ("nl",), "m")] = None
    layer_displacement: Annotated[Any, Column("layers/displacement", "f", ("n", "nl"), "m")] = None
    source_stress: Annotated[Any, Column("source/stress", "f", ("n",), "Pa")] = no_values()
    receiver_stress: Annotated[Any, Column("receiver/stress", "f", ("n",), "Pa")] = no_values()
    source_height: Annotated[Any, Column("source/height", "f", (1,), "m", since=2)] = None
    source_position: Annotated[Any, Column("source/position", "f", (3,), "m", since=2)] = None
    disc_position: Annotated[Any, Column("discs/position", "f", ("nd", 3), "m", since=2)] = None
    disc_displacement: Annotated[
        Any, Column("discs/displacement", "f", ("n", "nd"), "m", since=2)
    ] = None
    direction: str = "z"
    source: str = "wall"


def is_directed(column: Column) -> bool:
    """Return whether a column holds components along the direction of the source."""
    return column.dataset.rpartition("/")[2] in DIRECTED_COLUMNS


def write_recording(
    product: Product, path: str | Path, values: Mapping[str, Any], made: Provenance | None
) -> None:
    """Write a recording; torsion has other units, and empty columns are left out."""
    present = dict(values)
    for name in product.columns:
        if name in values and np.size(values[name]) == 0:
            present[name] = None
    _with_units_along(product, values["direction"]).write(path, present, made)


def _with_units_along(product: Product, direction: str) -> Product:
    """Return the format of a recording along a direction, with other units for torsion."""
    if direction != TORSION:
        return product
    columns = dict(product.columns)
    for name, column in columns.items():
        if is_directed(column):
            unit, *per = column.unit.split("/")
            unit = TORSION_UNITS.get(unit, unit)
            columns[name] = column._replace(unit="/".join([unit, *per]))
    return replace(product, columns=columns)


def read_recording(product: Product, path: str | Path) -> dict[str, Any]:
    """Return all values that a file has; raise InputError for any fault."""
    with open_h5(path) as file:
        direction = read_attributes(file).get("direction", "z")
    values = _with_units_along(product, direction).read(path)
    if values["direction"] not in COMPONENT:
        raise InputError(
            "direction",
            f"{path}: direction {values['direction']!r}",
            f"is none of {', '.join(COMPONENT)}",
            "mend it",
        )
    present = {name: value for name, value in values.items() if value is not None}
    axis = "time" if "time" in values else "frequency"
    no_chain = np.empty((len(values[axis]), 0))
    return {"chain_displacement": no_chain} | present


@dataclass(repr=False, kw_only=True)
class Signals(Recording, Drawn):
    """Recorded signals of one wave run; nt times, nc particles of the chain, nl layers.

    All displacements, and both stresses, are along `direction`, in which the source moves. In
    torsion displacements are turns about z, rad, and stresses are torques divided by the area, N/m.
    A cell without walls has an empty chain and an empty stress on the receiver.

    Attributes
    ----------
    time : ndarray (nt,)
        Times, s, evenly spaced from 0.
    chain_particle, chain_position : ndarray (nc,), index into the network and m
        Particles of the chain, and z of their centres at the start.
    chain_displacement : ndarray (nt, nc)
        Displacements of the chain, m.
    source_displacement : ndarray (nt,)
        Displacement of the source, m; for a source of force, its force, N, or torque, N m.
    source_stress, receiver_stress : ndarray (nt,)
        Change of the stress from its static value, Pa, positive in the sense of the walls' push,
        for z compression. For a plane, the force that holds the plane divided by the area; empty
        for a source of force.
    layer_position, layer_displacement : ndarray (nl,) and (nt, nl), m, or None
        Means over slabs as in `modal.packing.layers`.
    particle_displacement : ndarray (nt, n), m, or None
        Displacement of every particle of the network.
    source, source_height : str, ndarray (1,) m or None
        Name of the source, "wall" or another, and its height inside the packing.
    source_position : ndarray (3,), m, or None
        Mean position of the spheres of a disc or point source.
    disc_position, disc_displacement : ndarray (nd, 3) m, (nt, nd) m, or None
        Mean position and mean displacement of the spheres of each receiving disc.
    direction : str, default "z"
        Direction of the source: x, y, z or torsion.
    amplitude, input_frequency : float, m and Hz
        A and f of u = A (1 - cos 2 pi f t).
    time_step, run_time : float
        Step of the integration and wall-clock time of the run, s.
    producer, case : str
        Program that made the record, and case of the packing.
    balance : EnergyBalance or None
        Energy balance of a run that was integrated in time steps.
    slip_ends, slip_energy : ndarray of int (ns, 2) and ndarray (ns,) J, or None
        For a non-linear wave, the two ends of each contact that slid (index of a particle or number
        of a wall), and the energy that slip dissipated in it; the sum is the whole energy
        dissipated by slip.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 20))
    >>> signals = modal.propagate(crystal, duration=2e-5, interval=1e-6).signals
    >>> signals.time.shape, signals.chain_displacement.shape
    ((21,), (21, 20))
    """

    ROWS = "n"
    INDEX = "time"

    time: Annotated[Floats, Column("time", "f", ("n",), "s")]
    source_displacement: Annotated[Floats, Column("source/displacement", "f", ("n",), "m")]
    chain_position: Annotated[Floats, Column("chain/position", "f", ("nc",), "m")] = no_values()
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
        """Whether a wall sent the wave along x, y or z, and a chain leads to another wall."""
        records = (self.chain_particle, self.source_stress, self.receiver_stress)
        is_complete = all(len(record) for record in records)
        return is_complete and self.source in WALL_SOURCES and self.direction != TORSION

    def draw(self, ax: Any) -> None:
        """Draw the displacement against time and height.

        Draw the means over layers if at least two are recorded, else the particles of the chain.
        """
        height = self.layer_position
        motion = self.layer_displacement
        if height is None or motion is None or len(height) < 2:
            height = self.chain_position
            motion = self.chain_displacement
        order = np.argsort(height)
        largest = float(abs(motion).max()) * 1e9 or 1.0
        image = ax.pcolormesh(
            self.time * 1e6,
            height[order] * 1e3,
            motion[:, order].T * 1e9,
            vmin=-largest,
            vmax=largest,
            cmap="RdBu_r",
            shading="nearest",
            rasterized=True,
        )
        label = rf"$u_{self.direction}$, nm"
        if self.direction == TORSION:
            label = r"$\theta_z$, nrad"
        ax.figure.colorbar(image, ax=ax, label=label)
        ax.set(xlabel=r"time, $\mu$s", ylabel="z, mm")


SCHEMA = "granular-wave-signals"
FORMAT = product_of(SCHEMA, Signals, groups=("balance",), versions=FILE_VERSIONS)
EARLY_PLANE_SCHEMA = "granular-plane-wave"
"""Schema, version 1, of waves from a plane in early files."""


@dataclass(frozen=True, repr=False)
class Wave(Drawn):
    """The result of a run: its `signals`; subclasses add the cost and error of the run."""

    signals: Signals

    def __repr__(self) -> str:
        stress = quantity(float(abs(self.signals.receiver_stress).max(initial=0.0)), "Pa")
        return f"<{type(self).__name__}: {self.signals!r}, {stress} at most on the receiver wall>"

    def draw(self, ax: Any) -> None:
        """Draw the displacement against time and height, as `Signals` does."""
        self.signals.draw(ax)


def record_times(duration: float, interval: float) -> Floats:
    """Return the times (nt,), s, of a record from 0 to its `duration`, within round-off."""
    count = np.floor(duration / interval * (1 + 1e-9)) + 1
    refuse_above_memory(8 * count, f"a record every {interval:g} s", "take a longer interval")
    return interval * np.arange(count)


def write_signals(path: str | Path, signals: Signals, made: Provenance | None = None) -> None:
    """Write signals atomically, with their provenance.

    Parameters
    ----------
    path : str or Path
        `*.signals.h5`; an existing file is replaced.
    signals : Signals
        Signals of one wave.
    made : Provenance, optional
        Command, sources and settings to write into the file.

    Raises
    ------
    InputError
        If the file cannot be written.

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
        Also accept waves that do not go from wall to wall along x, y or z, and early files of
        waves from planes.

    Returns
    -------
    Signals
        The signals as they were written.

    Raises
    ------
    InputError
        If the file has a fault, or if the wave has a source that is not accepted.

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
        schema = read_attributes(file).get("schema")
    if of_any_source and schema == EARLY_PLANE_SCHEMA:
        values = _read_early_plane(path)
    else:
        values = _read_values(path)
    signals = Signals(**values)
    if not (signals.from_wall_to_wall or of_any_source):
        raise InputError(
            "other_source",
            f"{path}: a record of {signals.source} along {signals.direction}",
            "not of a wave from wall to wall, of which velocities are measured",
            "make one without --point, --plane and torsion, look at this one with `export` "
            "(recorded with --particles), or take its displacements in Python with "
            "read_signals(path, of_any_source=True)",
        )
    _validate(signals, str(path))
    return signals


def _read_values(path: str | Path) -> dict[str, Any]:
    """Return the fields of `Signals` in a file."""
    values = read_recording(FORMAT, path)
    with complete(path):
        values["balance"] = EnergyBalance.of_attributes(values["balance"])
    return values


def _read_early_plane(path: str | Path) -> dict[str, Any]:
    """Return the fields of `Signals` in an early file of a wave from a plane.

    Fields that such a file lacks are found from its columns.
    """
    attributes = {"height": float, "direction": str}
    values = read_recording(Product(EARLY_PLANE_SCHEMA, FORMAT.columns, attributes), path)
    height = values.pop("height")
    time = values["time"]
    absent_from_file = {"producer": "linear", "case": "", "run_time": 0.0}
    derived = {
        "source": f"plane at {height:g} m",
        "source_height": np.array([height]),
        "amplitude": float(np.ptp(values["source_displacement"])) / 2,
        "input_frequency": 1 / float(time[-1]),
        "time_step": float(time[1]),
    }
    return absent_from_file | values | derived


def _validate(signals: Signals, name: str) -> None:
    """Raise InputError for impossible signals, such as unevenly spaced times."""
    time = signals.time
    chain = signals.chain_particle
    if len(time) < 2 or (len(chain) == 0 and signals.layer_position is None):
        raise InputError(
            "too_few_records", f"{name}: fewer than two times or no chain", remedy="record more"
        )
    step = np.diff(time)
    tolerance = MAX_UNEVEN_STEP * step.mean()
    is_even = (abs(step - step.mean()) < tolerance).all()
    if not (abs(time[0]) < tolerance and is_even):
        raise InputError(
            "uneven_times",
            f"{name}: the times, from {time[0]:g} s on, are not evenly spaced from 0 on, where the "
            "source begins to move",
            remedy="record them so",
        )
    if (chain < 0).any() or len(set(chain.tolist())) < len(chain):
        raise InputError(
            "wrong_chain",
            f"{name}: chain/particle has a negative or a repeated index",
            remedy="mend it",
        )
    positive = (signals.input_frequency, signals.time_step)
    if not (np.isfinite([*positive, signals.amplitude]).all() and min(positive) > 0):
        raise InputError(
            "wrong_setting",
            f"{name}: input_frequency and time_step must be positive",
            remedy="mend them",
        )
