"""Define the columns of a contact network, and quantities that follow from them alone."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Annotated, Any, Self, TypeVar
from weakref import WeakValueDictionary

import numpy as np

from modal.formats.attributes import number_noted
from modal.formats.column import columns_of, stored
from modal.formats.provenance import NETWORK_SCHEMA
from modal.tools.arrays import Array, Bools, Floats, Ints

SOURCE_WALL = -1
"""Value of particle_j for the wall at low z, which sends the wave."""
RECEIVER_WALL = -2
"""Value of particle_j for the wall at high z."""

SCHEMA = NETWORK_SCHEMA
VERSION = (1, 2)
"""Versions of the file format. Version 2 has the `BOND_COLUMNS`, `fixed` and `cell_vectors`;
programs that do not know these columns refuse the file."""
OPTIONAL_CONTACT_COLUMNS = ("force_normal", "force_tangential", "overlap", "sliding", "cell_shift")
"""Columns of contacts that a program may be unable to give."""
ROTATIONAL = stored("contacts", "f", "m", unit="N m/rad", since=2)
"""A stiffness of contacts against rolling or twisting, in N m/rad."""
KG_M2 = "kg m^2"


PART = 1 << 14
"""Number of contacts that are computed together, which bounds the memory."""
Cached = TypeVar("Cached")


@dataclass(frozen=True, eq=False, repr=False)
class Columns:
    """The columns of a network; `modal.packing.network.Network` explains them."""

    position: Annotated[Floats, stored("particles", "f", "n", 3, unit="m")]
    radius: Annotated[Floats, stored("particles", "f", "n", unit="m")]
    mass: Annotated[Floats, stored("particles", "f", "n", unit="kg")]
    inertia: Annotated[Floats, stored("particles", "f", "n", unit=KG_M2)]
    particle_i: Annotated[Ints, stored("contacts", "i", "m")]
    particle_j: Annotated[Ints, stored("contacts", "i", "m")]
    normal: Annotated[Floats, stored("contacts", "f", "m", 3)]
    lever_i: Annotated[Floats, stored("contacts", "f", "m", 3, unit="m")]
    lever_j: Annotated[Floats, stored("contacts", "f", "m", 3, unit="m")]
    stiffness_normal: Annotated[Floats, stored("contacts", "f", "m", unit="N/m")]
    stiffness_tangential: Annotated[Floats, stored("contacts", "f", "m", unit="N/m")]
    cell_size: Annotated[Floats, stored("cell", "f", 3, unit="m", name="size")]
    cell_periodic: Annotated[Bools, stored("cell", "b", 3, name="periodic")]
    wall_position: Annotated[Floats, stored("walls", "f", 2, unit="m", name="position")]
    force_normal: Annotated[Floats | None, stored("contacts", "f", "m", unit="N")] = None
    force_tangential: Annotated[Floats | None, stored("contacts", "f", "m", 3, unit="N")] = None
    overlap: Annotated[Floats | None, stored("contacts", "f", "m", unit="m")] = None
    sliding: Annotated[Bools | None, stored("contacts", "b", "m")] = None
    cell_shift: Annotated[Ints | None, stored("contacts", "i", "m", 3)] = None
    shear_growth: Annotated[Floats | None, stored("contacts", "f", "m", unit="1/m")] = None
    motion_shortening: Annotated[Floats | None, stored("contacts", "f", "m")] = None
    torque_shortening: Annotated[Floats | None, stored("contacts", "f", "m")] = None
    stiffness_rolling: Annotated[Floats | None, ROTATIONAL] = None
    stiffness_twisting: Annotated[Floats | None, ROTATIONAL] = None
    moment: Annotated[Floats | None, stored("contacts", "f", "m", 3, unit="N m", since=2)] = None
    inertia_tensor: Annotated[
        Floats | None, stored("particles", "f", "n", 3, 3, unit=KG_M2, since=2)
    ] = None
    fixed: Annotated[Bools | None, stored("particles", "b", "n", 6, since=2)] = None
    cell_vectors: Annotated[
        Floats | None, stored("cell", "f", 3, 3, unit="m", since=2, name="vectors")
    ] = None
    study: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    _cache: dict[str, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return the columns without cached results, to copy or pickle the network."""
        return {**vars(self), "_cache": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore columns and notes: arrays become read-only, dictionaries are copied."""
        for name, value in state.items():
            vars(self)[name] = _lock_or_copy(value) if isinstance(value, np.ndarray) else value
        vars(self)["study"] = dict(state["study"])
        vars(self)["provenance"] = dict(state["provenance"])

    def cached(self, name: str, compute: Callable[[], Cached]) -> Cached:
        """Return the cached result of this name, after the first call of `compute`.

        The name must contain everything that the result depends on besides the network. A cached
        array cannot be written to.
        """
        if name not in self._cache:
            result = compute()
            if isinstance(result, np.ndarray):
                result.flags.writeable = False
            self._cache[name] = result
        return self._cache[name]

    @property
    def n_particles(self) -> int:
        """Number of particles n."""
        return len(self.position)

    @property
    def n_contacts(self) -> int:
        """Number of contacts m, walls included."""
        return len(self.particle_i)

    @property
    def free_motions(self) -> Bools:
        """Whether each body can make each motion (n, 6): along x, y, z, and turning about them."""
        if self.fixed is None:
            return np.ones((self.n_particles, 6), bool)
        return ~self.fixed

    @property
    def held(self) -> Bools:
        """Whether each body (n,) is held in all its six motions, as a part of a wall."""
        if self.fixed is None:
            return np.zeros(self.n_particles, bool)
        return np.asarray(self.fixed.all(axis=1))

    @property
    def degrees_of_freedom(self) -> int:
        """Number of motions of all bodies that are not held."""
        if self.fixed is None:
            return 6 * self.n_particles
        return int((~self.fixed).sum())

    @property
    def with_wall(self) -> Bools:
        """Whether each contact (m,) is between a particle and a wall."""
        return self.particle_j < 0

    @property
    def with_held(self) -> Bools:
        """Whether each contact (m,) is with a wall or with a held body."""
        if self.fixed is None:
            return self.with_wall
        held = self.held
        return self.with_wall | held[self.particle_i] | held[self.partner]

    @property
    def partner(self) -> Ints:
        """Index (m,) of the second particle of each contact; 0 for a wall."""
        return np.where(self.with_wall, 0, self.particle_j)

    @property
    def periods(self) -> Ints:
        """Periods (m, 3) to add to the position of j: `cell_shift`, if it is known.

        Otherwise they are the periods that bring the branch vector nearest to the difference of the
        levers.
        """
        if self.cell_shift is not None:
            return self.cell_shift
        missing = self.lever_i - self.lever_j - self._difference_of_positions
        return np.round(self.in_periods(missing)).astype(int)

    @property
    def period_vectors(self) -> Floats:
        """The periods, m, as rows (3, 3); an axis without a period has a row of zeros."""
        if self.cell_vectors is None:
            return np.diag(np.where(self.cell_periodic, self.cell_size, 0.0))
        return np.where(self.cell_periodic[:, None], self.cell_vectors, 0.0)

    @property
    def cell_widths(self) -> Floats:
        """Distances (3,), m, of opposite faces of the cell; its sides unless it is sheared."""
        if self.cell_vectors is None:
            return self.cell_size
        return 1 / np.linalg.norm(np.linalg.inv(self.cell_vectors), axis=0)

    def in_periods(self, vector: Floats) -> Floats:
        """Return vectors (k, 3), m, in units of the periods; zero along a non-periodic axis."""
        if self.cell_vectors is None:
            period = np.where(self.cell_periodic & (self.cell_size > 0), self.cell_size, np.inf)
            return vector / period
        return (vector @ np.linalg.inv(self.cell_vectors)) * self.cell_periodic

    @property
    def _difference_of_positions(self) -> Floats:
        """Position of j minus position of i (m, 3), m, without periods."""
        difference = self.position.take(self.partner, axis=0)
        difference -= self.position.take(self.particle_i, axis=0)
        return difference

    @property
    def branch(self) -> Floats:
        """Branch vectors (m, 3), m: from the centre of i to that of j or to the wall's plane."""
        branch = self._difference_of_positions
        if self.cell_vectors is not None:
            branch += self.periods @ self.period_vectors
        elif self.cell_periodic.any():
            branch += self.periods * np.where(self.cell_periodic, self.cell_size, 0.0)
        wall = np.flatnonzero(self.with_wall)
        branch[wall] = 0
        plane = self.wall_position[np.where(self.particle_j[wall] == SOURCE_WALL, 0, 1)]
        branch[wall, 2] = plane - self.position[self.particle_i[wall], 2]
        return branch

    def noted(self, name: str) -> float | None:
        """Return the positive number of this name in the group `study`; None if there is none."""
        number = number_noted(self.study, name)
        return number if number is not None and number > 0 else None

    def unchecked(self, **columns: Array | None) -> Self:
        """Return a copy of the network with other columns, without checking them.

        Use this only for columns that follow from checked ones; `dataclasses.replace` checks its
        result.
        """
        network = object.__new__(type(self))
        network.__setstate__(self.__getstate__() | columns)
        return network

    def some(self, selection: Bools | Ints | slice) -> Self:
        """Return the network with the selected contacts, without checks.

        `selection` is (m,) bool, indices or a slice.
        """
        selected = {name: data[selection] for name, data in self._present(CONTACTS).items()}
        return self.unchecked(**frozen(**selected))

    def bodies(self) -> dict[str, Any]:
        """Return the columns of the particles by name, without absent ones."""
        return self._present(PARTICLES)

    def _present(self, names: list[str]) -> dict[str, Any]:
        """Return those columns with these names that are present."""
        columns = {name: getattr(self, name) for name in names}
        return {name: data for name, data in columns.items() if data is not None}

    def parts(self) -> Iterator[Self]:
        """Yield the network with `PART` of its contacts at a time, to keep matrices small."""
        for first in range(0, self.n_contacts, PART):
            yield self.some(slice(first, first + PART))


COLUMNS = columns_of(Columns)
"""All columns of a network and of its file."""
PARTICLES = [name for name, column in COLUMNS.items() if column.shape[0] == "n"]
"""Names of the columns of the particles."""
CONTACTS = [name for name, column in COLUMNS.items() if column.shape[0] == "m"]
"""Names of the columns of the contacts."""
BOND_COLUMNS = ("stiffness_rolling", "stiffness_twisting", "inertia_tensor")
"""Columns that ordinary contacts of spheres do not have: those of bonds that resist rolling or
twisting, and of bodies of other shapes."""


_LOCKED = WeakValueDictionary[int, Array]()
"""Arrays that this module has locked, by their `id`: no view of them can be written to.

Of any other array, even if it is flagged as read-only, the caller may have a writable view, or
unlock it again."""


def frozen(**columns: Array) -> dict[str, Any]:
    """Make new arrays read-only, so that a network takes them without a copy."""
    for data in columns.values():
        _lock(data)
    return columns


def _lock(data: Array) -> None:
    """Make a new array read-only for good; a view is copied later, when a network takes it."""
    data.flags.writeable = False
    if data.base is None:
        _LOCKED[id(data)] = data


def _lock_or_copy(data: Array) -> Array:
    """Return a view of an array that `_lock` made read-only, or of a read-only copy of another."""
    owner = data
    while isinstance(owner.base, np.ndarray):
        owner = owner.base
    if _LOCKED.get(id(owner)) is not owner:
        data = data.copy("C")
        _lock(data)
    return data.view()
