"""The contact network: particles, contacts, periodic cell and walls.

Its file: `modal.packing.network_file`; which networks are refused: `modal.packing.validation`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from modal.display import table
from modal.formats.arrays import Array, Bools, Floats, Ints
from modal.formats.hdf5 import InputError

SOURCE_WALL = -1
"""Value of particle_j for the wall at low z, which sends the wave."""
RECEIVER_WALL = -2
"""Value of particle_j for the wall at high z."""

PARTICLES = {
    "position": ("f", (3,), "m"),
    "radius": ("f", (), "m"),
    "mass": ("f", (), "kg"),
    "inertia": ("f", (), "kg m^2"),
}
"""Columns of the particles: kind of number, shape of a row, unit."""
CONTACTS = {
    "particle_i": ("i", (), "1"),
    "particle_j": ("i", (), "1"),
    "normal": ("f", (3,), "1"),
    "lever_i": ("f", (3,), "m"),
    "lever_j": ("f", (3,), "m"),
    "stiffness_normal": ("f", (), "N/m"),
    "stiffness_tangential": ("f", (), "N/m"),
    "force_normal": ("f", (), "N"),
    "force_tangential": ("f", (3,), "N"),
    "overlap": ("f", (), "m"),
    "sliding": ("b", (), "1"),
    "cell_shift": ("i", (3,), "1"),
    "shear_growth": ("f", (), "1/m"),
    "motion_shortening": ("f", (), "1"),
    "torque_shortening": ("f", (), "1"),
}
"""The same of the contacts."""
OF_A_LAW = ("shear_growth", "motion_shortening", "torque_shortening")
"""What another program's law of contact does otherwise than springs do."""
OPTIONAL = ("force_normal", "force_tangential", "overlap", "sliding", "cell_shift", *OF_A_LAW)
"""Columns of the contacts that a program may not know."""
PART = 1 << 16
"""Contacts of a part, of those that are worked on together."""
Made = TypeVar("Made")


def handed_over(**columns: Array) -> dict[str, Array]:
    """Arrays that nobody else writes to: a `Network` takes them as they are, without a copy."""
    for data in columns.values():
        data.flags.writeable = False
    return columns


@dataclass(frozen=True, eq=False, repr=False)
class Network:
    """A packing at rest, n particles and m contacts, SI units; see `docs/formats.md`.

    `normal` (m, 3) points from i towards j or the wall; `lever_i`, `lever_j` (m, 3) from the
    centre to the contact point, zero for a wall. `study` and `provenance` are free attributes. A
    network does not change: what follows from it is kept with it (`once`), and
    `dataclasses.replace` makes another one.
    What a program does not know of its contacts is None, which is not zero: `force_normal` (m,),
    compression positive; `force_tangential` (m, 3) on i; `overlap` (m,); `sliding` (m,) bool;
    `cell_shift` (m, 3), the periods that are added to j. Of another program's law (m,):
    `shear_growth`, by which share the shear force grows per overlap, 1/m; `motion_shortening` and
    `torque_shortening`, which share of the overlap its lever arms lack of the radius.
    """

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
    study: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    _made: dict[str, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Arrays and notes become the network's own; the arrays cannot be written to."""
        for name, data in vars(self).items():
            if isinstance(data, np.ndarray):
                own = data
                if own.flags.writeable:
                    own = data.copy("K")
                    own.flags.writeable = False
                object.__setattr__(self, name, own.view())
        for name in ("study", "provenance"):
            object.__setattr__(self, name, dict(getattr(self, name)))

    def __getstate__(self) -> dict[str, Any]:
        """A copy, or what is pickled: without the results, which are made again when needed."""
        return {**vars(self), "_made": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.__post_init__()

    def once(self, name: str, make: Callable[[], Made]) -> Made:
        """What `make` gives, made when this name is first asked for and kept with the network."""
        if name not in self._made:
            self._made[name] = make()
        made: Made = self._made[name]
        return made

    def __repr__(self) -> str:
        return f"<Network: {self.n_particles} particles, {self.n_contacts} contacts>"

    def __str__(self) -> str:
        from modal.packing.summary import described  # it stands on this module

        return table(described(self))

    @property
    def n_particles(self) -> int:
        """Number of particles n."""
        return len(self.position)

    @property
    def n_contacts(self) -> int:
        """Number of contacts m, walls included."""
        return len(self.particle_i)

    @property
    def length(self) -> float:
        """Distance between source and receiver wall, m."""
        return float(self.wall_position[1] - self.wall_position[0])

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
    def area(self) -> float:
        """Cross-section, m^2, to which stresses refer; InputError where the cell has none."""
        area = float(self.cell_size[0] * self.cell_size[1])
        if not area > 0:
            raise InputError(
                "the network has no cross-section for stresses (cell/size is 0 along x or y); "
                "give the widths of the packing there"
            )
        return area

    @property
    def absent(self) -> list[str]:
        """Names of the optional data of contacts that are not known."""
        asked = (name for name in OPTIONAL if name not in OF_A_LAW)
        return [name for name in asked if getattr(self, name) is None]

    def known(self, name: str, purpose: str) -> Array:
        """The optional data `name` of the contacts; InputError where they are absent.

        `purpose` says in the message what cannot be computed without them.
        """
        data: Array | None = getattr(self, name)
        if data is None:
            raise InputError(
                f"the network has no contacts/{name}, without which there is no {purpose}; "
                "export it too"
            )
        return data

    def noted(self, name: str) -> float | None:
        """The positive number that the free notes in `study` give under this name, or None."""
        said = self.study.get(name)
        if isinstance(said, int | float | np.number) and 0 < said < np.inf:
            return float(said)
        return None

    def with_contacts(self, kept: Bools | Ints | slice) -> Network:
        """The same particles with the contacts that `kept` selects: (m,) bool, indices, a slice."""
        columns = {name: getattr(self, name) for name in CONTACTS}
        return replace(
            self, **{name: data[kept] for name, data in columns.items() if data is not None}
        )

    def parts(self) -> Iterator[tuple[int, Network]]:
        """The network with `PART` contacts at a time, and the number of the first of them.

        What is worked out contact by contact then takes little memory, and a cache holds it. The
        parts are views, not copies.
        """
        for first in range(0, self.n_contacts, PART):
            yield first, self.with_contacts(slice(first, first + PART))
