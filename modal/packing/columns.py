"""The columns of a contact network, and what follows from them alone."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Annotated, Any, Self, TypeVar
from weakref import WeakValueDictionary

import numpy as np

from modal.formats.attributes import number_noted
from modal.formats.product import columns_of, stored
from modal.formats.provenance import NETWORK_SCHEMA
from modal.tools.arrays import Array, Bools, Floats, Ints

SOURCE_WALL = -1
"""Value of particle_j for the wall at low z, which sends the wave."""
RECEIVER_WALL = -2
"""Value of particle_j for the wall at high z."""

SCHEMA = NETWORK_SCHEMA
VERSION = (1, 2)
"""A reader that would miss a column of `OF_BONDS` refuses a file that says 2."""
UNKNOWN = ("force_normal", "force_tangential", "overlap", "sliding", "cell_shift")
"""Columns of the contacts that a program may not know."""
TURN, KG_M2 = {"unit": "N m/rad", "since": 2}, "kg m^2"


PART = 1 << 14
"""Contacts of a part, of those that are worked on together."""
Made = TypeVar("Made")


@dataclass(frozen=True, eq=False, repr=False)
class Columns:
    """The columns of `modal.packing.network.Network`, which has their meaning."""

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
    stiffness_rolling: Annotated[Floats | None, stored("contacts", "f", "m", **TURN)] = None
    stiffness_twisting: Annotated[Floats | None, stored("contacts", "f", "m", **TURN)] = None
    inertia_tensor: Annotated[
        Floats | None, stored("particles", "f", "n", 3, 3, unit=KG_M2, since=2)
    ] = None
    study: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    _made: dict[str, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        """A copy, or what is pickled: without the results, which are made again when needed."""
        return {**vars(self), "_made": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Arrays and notes become its own; the arrays cannot be written to."""
        own = {k: _own(v) if isinstance(v, np.ndarray) else v for k, v in state.items()}
        vars(self).update(own, study=dict(state["study"]), provenance=dict(state["provenance"]))

    def cached(self, name: str, make: Callable[[], Made]) -> Made:
        """What `make` gives, made when this name is first asked for and kept with the network.

        An array that is kept cannot be written to.
        """
        if name not in self._made:
            self._made[name] = make()
            if isinstance(self._made[name], np.ndarray):
                self._made[name].flags.writeable = False
        return self._made[name]

    @property
    def n_particles(self) -> int:
        """Number of particles n."""
        return len(self.position)

    @property
    def n_contacts(self) -> int:
        """Number of contacts m, walls included."""
        return len(self.particle_i)

    @property
    def with_wall(self) -> Bools:
        """Shape (m,) bool: contacts between a particle and a wall."""
        return self.particle_j < 0

    @property
    def partner(self) -> Ints:
        """Shape (m,): index of the contact's second particle; 0, for none, at a wall."""
        return np.where(self.with_wall, 0, self.particle_j)

    @property
    def periods(self) -> Ints:
        """Shape (m, 3): the periods to add to j, `cell_shift`.

        Where that is absent, as many as bring the branch nearest to the levers.
        """
        if self.cell_shift is not None:
            return self.cell_shift
        apart = self.lever_i - self.lever_j - self._apart
        period = np.where(self.cell_periodic & (self.cell_size > 0), self.cell_size, np.inf)
        return np.round(apart / period).astype(int)

    @property
    def _apart(self) -> Floats:
        """Shape (m, 3), m: from the centre of i to that of j in one and the same period."""
        apart = self.position.take(self.partner, axis=0)
        apart -= self.position.take(self.particle_i, axis=0)
        return apart

    @property
    def branch(self) -> Floats:
        """Shape (m, 3), m: from the centre of i to that of j through `periods`, or to the wall."""
        branch = self._apart
        if self.cell_periodic.any():
            branch += self.periods * np.where(self.cell_periodic, self.cell_size, 0.0)
        wall = np.flatnonzero(self.with_wall)
        branch[wall] = 0
        plane = self.wall_position[np.where(self.particle_j[wall] == SOURCE_WALL, 0, 1)]
        branch[wall, 2] = plane - self.position[self.particle_i[wall], 2]
        return branch

    def noted(self, name: str) -> float | None:
        """The positive number that the free notes in `study` give under this name, or None."""
        number = number_noted(self.study, name)
        return number if number is not None and number > 0 else None

    def unchecked(self, **columns: Array | None) -> Self:
        """The same with other columns, which nobody checks: for those that follow from sound ones.

        `dataclasses.replace` makes one that is checked.
        """
        other = object.__new__(type(self))
        other.__setstate__(self.__getstate__() | columns)
        return other

    def some(self, kept: Bools | Ints | slice) -> Self:
        """The contacts that `kept` selects, (m,) bool, indices or a slice, unchecked."""
        own = {name: data[kept] for name, data in self._known(CONTACTS).items()}
        return self.unchecked(**frozen(**own))

    def bodies(self) -> dict[str, Any]:
        """The columns of the particles that it has, by name."""
        return self._known(PARTICLES)

    def _known(self, names: list[str]) -> dict[str, Any]:
        return {name: data for name in names if (data := getattr(self, name)) is not None}

    def parts(self) -> Iterator[Self]:
        """`PART` contacts at a time, whose matrices then take little memory."""
        for first in range(0, self.n_contacts, PART):
            yield self.some(slice(first, first + PART))


COLUMNS = columns_of(Columns)
"""All columns of a network and of its file."""
PARTICLES, CONTACTS = (
    [name for name, column in COLUMNS.items() if column.shape[0] == length] for length in "nm"
)
"""Names of those of the particles and of the contacts."""
OF_BONDS = tuple(name for name, column in COLUMNS.items() if column.since > 1)
"""What spheres that touch do not have: contacts that roll or twist, bodies of other shapes."""


_LOCKED = WeakValueDictionary[int, Array]()
"""By their id the arrays that were locked here, of which nobody has a view that can be written to.

Of any other array its caller may have such a view, or unlock it again, however it is flagged.
"""


def frozen(**columns: Array) -> dict[str, Any]:
    """Lock new arrays that nobody else has: a network takes them as they are, without a copy."""
    for data in columns.values():
        _lock(data)
    return columns


def _lock(data: Array) -> None:
    """Lock a new array for good; a view of one is flagged alone, and copied when it is taken."""
    data.flags.writeable = False
    if data.base is None:
        _LOCKED[id(data)] = data


def _own(data: Array) -> Array:
    """Return a view of an array that was locked here, or of a copy of any other."""
    owner = data
    while isinstance(owner.base, np.ndarray):
        owner = owner.base
    if _LOCKED.get(id(owner)) is not owner:
        data = data.copy("C")
        _lock(data)
    return data.view()
