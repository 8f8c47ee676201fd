"""Packings known in closed form: the FCC crystal under isotropic stress, a column of spheres.

The crystal stands with [001] along z: square layers with spacing d (one contact distance), each
layer shifted by half a cell, layer distance l = d / sqrt(2). Each sphere has twelve contacts of
equal normal force. Its waves are in `modal.theory.fcc`.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from modal.packing.contact_law import GLASS, RADIUS, Material
from modal.packing.contact_models import ContactLaw, laws_of
from modal.packing.neighbours import ContactList
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.sample import Sample
from modal.tools.arguments import checked, refuse_other_kinds
from modal.tools.arrays import Ints
from modal.tools.errors import InputError
from modal.tools.workload import refuse_above_memory

SPHERE_BYTES = 2200.0
"""Memory for each sphere of a crystal while its contacts are listed, measured."""
DEEPEST_OF_CRYSTAL = 0.3
"""Overlap over the radius: beyond, no theory of contacts between small faces holds."""
STEPS = np.array([(0, 0, 1), (0, 1, 0), (1, 0, 0), (1, 0, 1), (1, 1, 0), (1, 1, 1)])
"""From a sphere to half of its neighbours: layers up, along y, along x. The layer above an even one
is shifted by half a cell to the right, the one above an odd one to the left."""
UP = sqrt(0.5)
NORMALS = np.array(
    [(1, 0, 0), (0, 1, 0), (-0.5, -0.5, UP), (0.5, -0.5, UP), (-0.5, 0.5, UP), (0.5, 0.5, UP)]
    + [(0, 0, -1), (0, 0, 1)]
)
"""Towards those neighbours, and towards the source and the receiver wall."""
MADE = {"command": "modal.packing.crystal"}


@dataclass(frozen=True)
class FccPacking:
    """FCC of equal spheres under isotropic stress (Pa): geometry and contact stiffnesses."""

    stress: float = 1e5
    radius: float = RADIUS
    material: Material = GLASS

    def __post_init__(self) -> None:
        refuse_other_kinds(FccPacking, type(self).__name__, vars(self))
        if not 1e-30 < self.radius < 1e9:
            raise InputError(f"radius {self.radius:g}: give a positive number below 1e9, in m")
        deepest = DEEPEST_OF_CRYSTAL * self.radius
        force = float(self.laws[0].normal_force(deepest, self.radius / 2))
        largest = 2 * sqrt(2) * force / (2 * self.radius - deepest) ** 2
        if not 0 < self.stress < largest:
            raise InputError(
                f"stress {self.stress:g} Pa: outside 0 to {largest:.3g} Pa, where spheres of this "
                f"material overlap by {DEEPEST_OF_CRYSTAL:g} of the radius; give it in Pa"
            )

    @property
    def laws(self) -> tuple[ContactLaw, ContactLaw]:
        """The contact law between spheres, and with a wall."""
        return laws_of(self.material)

    @property
    def overlap(self) -> float:
        """Overlap of two spheres, m, that balances the stress with spacing d = 2R - overlap.

        Isotropic stress = 2 sqrt(2) F / d^2; the spacing depends on the overlap, so a fixed
        point (contraction factor 4/3 overlap / d) is iterated to machine precision.
        """
        law, overlap, last = self.laws[0], 0.0, -1.0
        while abs(overlap - last) > 1e-15 * self.radius:
            last = overlap
            force = self.stress * (2 * self.radius - overlap) ** 2 / (2 * sqrt(2))
            overlap = float(law.overlap_of_force(force, self.radius / 2))
        return overlap

    @property
    def spacing(self) -> float:
        """Contact distance d, m."""
        return 2 * self.radius - self.overlap

    @property
    def layer_distance(self) -> float:
        """Distance of neighbouring layers along z, l = d / sqrt(2), m."""
        return self.spacing / sqrt(2)

    @property
    def wall_overlap(self) -> float:
        """Overlap of a sphere of the outer layers with the flat wall, m (force stress d^2)."""
        force = self.stress * self.spacing**2
        return float(self.laws[1].overlap_of_force(force, self.radius))

    @property
    def mass(self) -> float:
        """Mass of a sphere, kg."""
        return float(self.material.sphere(self.radius)[0])

    @property
    def kn(self) -> float:
        """Normal contact stiffness, N/m."""
        return float(self.laws[0].stiffness_normal(self.overlap, self.radius / 2))

    @property
    def kt(self) -> float:
        """Tangential contact stiffness, N/m."""
        return float(self.laws[0].stiffness_tangential(self.overlap, self.radius / 2))


@checked
def fcc(
    stress: float = 1e5,
    cells: tuple[int, int, int] = (4, 4, 200),
    *,
    radius: float = RADIUS,
    material: Material = GLASS,
    periodic_z: bool = False,
) -> Network:
    """A crystal of equal glass spheres between two flat walls, under the same pressure everywhere.

    The face-centred cubic packing of Otsubo et al. 2017, section 2, with [001] along z and periods
    along x and y. One or two spheres across are allowed: a sphere then touches itself, or a
    neighbour through several periods.

    Parameters
    ----------
    stress : float, default 1e5
        Pressure, Pa.
    cells : tuple of 3 int, default (4, 4, 200)
        Spheres along x and along y, layers along z.
    radius : float, default 1.27e-3
        Of a sphere, m.
    material : Material, default glass
        60 GPa, Poisson's ratio 0.2, 2,230 kg/m^3.
    periodic_z : bool, default False
        No walls: the layers, an even number, go on through a period along z.

    Returns
    -------
    Network
        The crystal at rest.

    Raises
    ------
    InputError
        Where there is no such crystal.

    Examples
    --------
    >>> net = fcc(stress=1e5, cells=(2, 2, 20))
    >>> net.n_particles, net.n_contacts
    (80, 472)
    """
    if len(cells) != 3 or any(number < 1 or number % 1 != 0 for number in cells):
        raise InputError(f"cells {cells}: give three whole numbers, along x and y, and layers")
    nx, ny, layers = (int(number) for number in cells)
    if periodic_z and layers % 2:
        raise InputError(f"{layers} layers: a crystal periodic along z has an even number of them")
    refuse_above_memory(
        SPHERE_BYTES * nx * ny * layers,
        f"a crystal of {nx} x {ny} x {layers} spheres",
        "take fewer; `tile` repeats a packing",
    )
    crystal = FccPacking(stress, radius, material)
    if not periodic_z and crystal.wall_overlap > DEEPEST_OF_CRYSTAL * radius:
        raise InputError(
            f"stress {stress:g} Pa: spheres of this material overlap with the walls by more than "
            f"{DEEPEST_OF_CRYSTAL:g} of the radius; take less"
        )
    d, l_z = crystal.spacing, crystal.layer_distance
    z0 = l_z / 2 if periodic_z else radius - crystal.wall_overlap
    height = 2 * z0 + (layers - 1) * l_z
    place: Ints = np.indices((layers, ny, nx)).reshape(3, -1).T
    layer, n = place[:, 0], len(place)
    offset = 0.5 * (layer % 2)
    position = np.column_stack(
        [(place[:, 2] + offset) * d, (place[:, 1] + offset) * d, z0 + layer * l_z]
    )
    there = place[:, None] + STEPS
    there[:, 2:, 1:] += (layer % 2 - 1)[:, None, None]
    shift, inside = np.divmod(there, (layers, ny, nx))
    other = (inside[..., 0] * ny + inside[..., 1]) * nx + inside[..., 2]
    exists = np.ones((n, 8), bool)
    if not periodic_z:
        exists[:, 2:6] = (layer + 1 < layers)[:, None]
    for column, end in ((6, 0), (7, layers - 1)):
        exists[:, column] = (layer == end) & (not periodic_z)
    sphere, kind = np.nonzero(exists)
    walls = np.broadcast_to([SOURCE_WALL, RECEIVER_WALL], (n, 2))
    contact = ContactList(
        sphere,
        np.column_stack([other, walls])[exists],
        np.pad(shift[..., ::-1], ((0, 0), (0, 2), (0, 0)))[exists],
        NORMALS[kind],
        np.where(kind < 6, crystal.overlap, crystal.wall_overlap),
    )
    return Sample(
        position,
        np.array([nx * d, ny * d]),
        np.array([0.0, height]),
        friction=np.inf,
        radius=radius,
        material=material,
        periodic_z=periodic_z,
        study={"case": "fcc", "stress": stress},
        provenance=MADE,
    ).network(contact)


def column(particles: int = 3, force: float = 0.5, radius: float = RADIUS) -> Network:
    """Glass spheres on one another between two flat walls under `force` (N), known exactly."""
    pair, wall = laws_of(GLASS)
    overlap = float(pair.overlap_of_force(force, radius / 2))
    at_wall = float(wall.overlap_of_force(force, radius))
    k: Ints = np.arange(particles)
    z = radius - at_wall + k * (2 * radius - overlap)
    normal = np.zeros((particles + 1, 3))
    normal[:, 2] = [-1.0, *np.ones(particles)]
    contact = ContactList(
        np.array([0, *k]),
        np.array([SOURCE_WALL, *k[1:], RECEIVER_WALL]),
        np.zeros((particles + 1, 3), int),
        normal,
        np.array([at_wall, *np.full(particles - 1, overlap), at_wall]),
    )
    return Sample(
        np.column_stack([np.zeros(particles), np.zeros(particles), z]),
        np.full(2, 4 * radius),
        np.array([0.0, z[-1] + radius - at_wall]),
        friction=np.inf,
        radius=radius,
        periodic_sides=(False, False),
        study={"case": "column"},
        provenance=MADE,
    ).network(contact)
