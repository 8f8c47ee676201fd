"""The columns of a contact network, and what follows from them alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from modal.formats.product import Column
from modal.formats.provenance import NETWORK_SCHEMA
from modal.tools.arrays import Array, Bools, Floats, Ints

SOURCE_WALL = -1
"""Value of particle_j for the wall at low z, which sends the wave."""
RECEIVER_WALL = -2
"""Value of particle_j for the wall at high z."""

SCHEMA = NETWORK_SCHEMA
VERSION = (1, 2)
"""With a column of `OF_BONDS` a file says 2, which a reader that would miss it refuses."""
OF_A_LAW = ("shear_growth", "motion_shortening", "torque_shortening")
"""What another program's law of contact does otherwise than springs do."""
OF_BONDS = ("stiffness_rolling", "stiffness_twisting", "inertia_tensor")
"""What spheres that touch do not have: contacts that roll or twist, bodies of other shapes."""
UNKNOWN = ("force_normal", "force_tangential", "overlap", "sliding", "cell_shift")
"""Columns of the contacts that a program may not know."""
OPTIONAL = (*UNKNOWN, *OF_A_LAW, *OF_BONDS)
"""Columns that a network may lack."""


def _column(dataset: str, kind: str, *shape: int | str, unit: str) -> Column:
    """A column of that name; what is not finite is refused by its row, with all else."""
    name = dataset.rpartition("/")[2]
    since = VERSION[name in OF_BONDS]
    return Column(dataset, kind, shape, unit, name in OPTIONAL, finite=False, since=since)


PARTICLES = {
    "position": _column("particles/position", "f", "n", 3, unit="m"),
    "radius": _column("particles/radius", "f", "n", unit="m"),
    "mass": _column("particles/mass", "f", "n", unit="kg"),
    "inertia": _column("particles/inertia", "f", "n", unit="kg m^2"),
    "inertia_tensor": _column("particles/inertia_tensor", "f", "n", 3, 3, unit="kg m^2"),
}
"""Columns of the particles, the one that tells their number first."""
CONTACTS = {
    "particle_i": _column("contacts/particle_i", "i", "m", unit="1"),
    "particle_j": _column("contacts/particle_j", "i", "m", unit="1"),
    "normal": _column("contacts/normal", "f", "m", 3, unit="1"),
    "lever_i": _column("contacts/lever_i", "f", "m", 3, unit="m"),
    "lever_j": _column("contacts/lever_j", "f", "m", 3, unit="m"),
    "stiffness_normal": _column("contacts/stiffness_normal", "f", "m", unit="N/m"),
    "stiffness_tangential": _column("contacts/stiffness_tangential", "f", "m", unit="N/m"),
    "stiffness_rolling": _column("contacts/stiffness_rolling", "f", "m", unit="N m/rad"),
    "stiffness_twisting": _column("contacts/stiffness_twisting", "f", "m", unit="N m/rad"),
    "force_normal": _column("contacts/force_normal", "f", "m", unit="N"),
    "force_tangential": _column("contacts/force_tangential", "f", "m", 3, unit="N"),
    "overlap": _column("contacts/overlap", "f", "m", unit="m"),
    "sliding": _column("contacts/sliding", "b", "m", unit="1"),
    "cell_shift": _column("contacts/cell_shift", "i", "m", 3, unit="1"),
    "shear_growth": _column("contacts/shear_growth", "f", "m", unit="1/m"),
    "motion_shortening": _column("contacts/motion_shortening", "f", "m", unit="1"),
    "torque_shortening": _column("contacts/torque_shortening", "f", "m", unit="1"),
}
"""The same of the contacts."""
COLUMNS = {
    **PARTICLES,
    **CONTACTS,
    "cell_size": _column("cell/size", "f", 3, unit="m"),
    "cell_periodic": _column("cell/periodic", "b", 3, unit="1"),
    "wall_position": _column("walls/position", "f", 2, unit="m"),
}
"""All columns of a network and of its file."""
PART = 1 << 14
"""Contacts of a part, of those that are worked on together."""
Made = TypeVar("Made")
Same = TypeVar("Same", bound="Columns")


@dataclass(frozen=True, eq=False, repr=False)
class Columns:
    """The columns of `modal.packing.network.Network`, which has their meaning."""

    position: Floats
    radius: Floats
    mass: Floats
    inertia: Floats
    particle_i: Ints
    particle_j: Ints
    normal: Floats
    lever_i: Floats
    lever_j: Floats
    stiffness_normal: Floats
    stiffness_tangential: Floats
    cell_size: Floats
    cell_periodic: Bools
    wall_position: Floats
    force_normal: Floats | None = None
    force_tangential: Floats | None = None
    overlap: Floats | None = None
    sliding: Bools | None = None
    cell_shift: Ints | None = None
    shear_growth: Floats | None = None
    motion_shortening: Floats | None = None
    torque_shortening: Floats | None = None
    stiffness_rolling: Floats | None = None
    stiffness_twisting: Floats | None = None
    inertia_tensor: Floats | None = None
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
        made: Made = self._made[name]
        return made

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
    def wall_distance(self) -> Floats:
        """Shape (m,), m: how far above the centre of i the contact's wall lies; 0 without one."""
        plane = self.wall_position[np.where(self.particle_j == SOURCE_WALL, 0, 1)]
        return np.where(self.with_wall, plane - self.position[self.particle_i, 2], 0.0)

    @property
    def branch(self) -> Floats:
        """Shape (m, 3), m: from the centre of i to that of j, or straight to the wall.

        Where `cell_shift` is absent, through as many periods as bring it nearest to the levers.
        """
        branch = self.position.take(self.partner, axis=0)
        branch -= self.position.take(self.particle_i, axis=0)
        period = np.where(self.cell_periodic, self.cell_size, 0.0)
        if self.cell_shift is not None:
            branch += self.cell_shift * period
        elif self.cell_periodic.any():
            missing = self.lever_i - self.lever_j - branch
            branch += np.round(missing / np.where(period > 0, period, np.inf)) * period
        wall = np.flatnonzero(self.with_wall)
        branch[wall] = 0
        branch[wall, 2] = self.some(wall).wall_distance
        return branch

    def noted(self, name: str) -> float | None:
        """The positive number that the free notes in `study` give under this name, or None."""
        said = self.study.get(name)
        if isinstance(said, int | float | np.number) and 0 < said < np.inf:
            return float(said)
        return None

    def unchecked(self: Same, **columns: Array | None) -> Same:
        """The same with other columns, which nobody checks: for those that follow from sound ones.

        `dataclasses.replace` makes one that is checked.
        """
        other = object.__new__(type(self))
        other.__setstate__(self.__getstate__() | columns)
        return other

    def some(self: Same, kept: Bools | Ints | slice) -> Same:
        """The contacts that `kept` selects, (m,) bool, indices or a slice, unchecked."""
        columns = {name: getattr(self, name) for name in CONTACTS}
        return self.unchecked(
            **{name: data[kept] for name, data in columns.items() if data is not None}
        )

    def bodies(self) -> dict[str, Any]:
        """The columns of the particles that it has, by name."""
        columns = {name: getattr(self, name) for name in PARTICLES}
        return {name: data for name, data in columns.items() if data is not None}

    def parts(self: Same) -> Iterator[Same]:
        """`PART` contacts at a time, whose matrices then take little memory."""
        for first in range(0, self.n_contacts, PART):
            yield self.some(slice(first, first + PART))


def _own(data: Array) -> Array:
    """A view of the array, or of a copy of it where someone else could write to its memory."""
    base: Any = data
    while isinstance(base, np.ndarray) and not base.flags.writeable:
        base = base.base
    if base is not None:
        data = data.copy("K")
        data.flags.writeable = False
    return data.view()
