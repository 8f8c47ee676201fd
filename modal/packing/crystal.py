"""Build packings with closed solutions: the FCC crystal under isotropic stress, a column.

The crystal stands with [001] along z: square layers of spacing d (the contact distance), each
shifted by half a cell, at layer distance l = d / sqrt(2). Each sphere has twelve contacts of equal
normal force. The waves of the crystal are in `modal.theory.fcc`.
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

BYTES_PER_SPHERE = 2200.0
"""Memory for each sphere of a crystal while its contacts are listed, measured."""
MAX_OVERLAP_IN_RADII = 0.3
"""Overlap, divided by the radius, beyond which no theory of contacts with small faces holds."""
STEPS = np.array([(0, 0, 1), (0, 1, 0), (1, 0, 0), (1, 0, 1), (1, 1, 0), (1, 1, 1)])
"""Steps from a sphere to half of its neighbours: layers up, along y, along x. The layer above an
even one is shifted by half a cell to the right, the one above an odd one to the left."""
UP = sqrt(0.5)
"""z component of the unit vector to a neighbour in the next layer."""
NORMALS = np.array(
    [(1, 0, 0), (0, 1, 0), (-0.5, -0.5, UP), (0.5, -0.5, UP), (-0.5, 0.5, UP), (0.5, 0.5, UP)]
    + [(0, 0, -1), (0, 0, 1)]
)
"""Unit vectors to the neighbours that `STEPS` lead to, then to the source wall and the receiver
wall."""
PROVENANCE = {"command": "modal.packing.crystal"}


@dataclass(frozen=True)
class FccPacking:
    """FCC crystal of equal spheres under isotropic stress: geometry and contact stiffnesses.

    Attributes
    ----------
    stress : float
        Isotropic stress, Pa.
    radius : float
        Radius of the spheres, m.
    material : Material
        Material of spheres and walls.
    """

    stress: float = 1e5
    radius: float = RADIUS
    material: Material = GLASS

    def __post_init__(self) -> None:
        refuse_other_kinds(FccPacking, type(self).__name__, vars(self))
        if not 1e-30 < self.radius < 1e9:
            raise InputError(
                "radius", f"radius {self.radius:g}", remedy="give a positive number below 1e9, in m"
            )
        max_overlap = MAX_OVERLAP_IN_RADII * self.radius
        max_force = float(self.laws[0].normal_force(max_overlap, self.radius / 2))
        max_stress = 2 * sqrt(2) * max_force / (2 * self.radius - max_overlap) ** 2
        if not 0 < self.stress < max_stress:
            raise InputError(
                "stress",
                f"stress {self.stress:g} Pa",
                f"outside 0 to {max_stress:.3g} Pa, where spheres of "
                f"this material overlap by {MAX_OVERLAP_IN_RADII:g} of the radius",
                "give it in Pa",
            )

    @property
    def laws(self) -> tuple[ContactLaw, ContactLaw]:
        """Return the contact law between spheres, and with a wall."""
        return laws_of(self.material)

    @property
    def overlap(self) -> float:
        """Return the overlap of two spheres, m, that balances the stress at d = 2R - overlap.

        Isotropic stress = 2 sqrt(2) F / d^2; the spacing depends on the overlap, so a fixed
        point (contraction factor 4/3 overlap / d) is iterated to machine precision.
        """
        law = self.laws[0]
        overlap = 0.0
        last = -1.0
        while abs(overlap - last) > 1e-15 * self.radius:
            last = overlap
            force = self.stress * (2 * self.radius - overlap) ** 2 / (2 * sqrt(2))
            overlap = float(law.overlap_of_force(force, self.radius / 2))
        return overlap

    @property
    def spacing(self) -> float:
        """Return the contact distance d, m."""
        return 2 * self.radius - self.overlap

    @property
    def layer_distance(self) -> float:
        """Return the distance of neighbouring layers along z, l = d / sqrt(2), m."""
        return self.spacing / sqrt(2)

    @property
    def wall_overlap(self) -> float:
        """Return the overlap of a sphere with a flat wall, m, under the force stress times d^2."""
        force = self.stress * self.spacing**2
        return float(self.laws[1].overlap_of_force(force, self.radius))

    @property
    def mass(self) -> float:
        """Return the mass of a sphere, kg."""
        return float(self.material.sphere(self.radius)[0])

    @property
    def kn(self) -> float:
        """Return the normal contact stiffness, N/m."""
        return float(self.laws[0].stiffness_normal(self.overlap, self.radius / 2))

    @property
    def kt(self) -> float:
        """Return the tangential contact stiffness, N/m."""
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
    """Return a crystal of equal glass spheres between two flat walls under isotropic pressure.

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
        Radius of a sphere, m.
    material : Material, default glass
        60 GPa, Poisson's ratio 0.2, 2,230 kg/m^3.
    periodic_z : bool, default False
        Whether z is periodic, without walls; this needs an even number of layers.

    Returns
    -------
    Network
        The crystal at rest.

    Raises
    ------
    InputError
        If a number is impossible, such as a stress at which the spheres overlap too far.

    Examples
    --------
    >>> net = fcc(stress=1e5, cells=(2, 2, 20))
    >>> net.n_particles, net.n_contacts
    (80, 472)
    """
    if len(cells) != 3 or any(number < 1 or number % 1 != 0 for number in cells):
        raise InputError(
            "cells", f"cells {cells}", remedy="give three whole numbers, along x and y, and layers"
        )
    nx, ny, layers = (int(number) for number in cells)
    if periodic_z and layers % 2:
        raise InputError(
            "layers", f"{layers} layers", "a crystal periodic along z has an even number of them"
        )
    refuse_above_memory(
        BYTES_PER_SPHERE * nx * ny * layers,
        f"a crystal of {nx} x {ny} x {layers} spheres",
        "take fewer; `tile` repeats a packing",
    )
    crystal = FccPacking(stress, radius, material)
    if not periodic_z and crystal.wall_overlap > MAX_OVERLAP_IN_RADII * radius:
        raise InputError(
            "stress",
            f"stress {stress:g} Pa",
            "spheres of this material overlap with the walls by more than "
            f"{MAX_OVERLAP_IN_RADII:g} of the radius",
            "take less",
        )
    d = crystal.spacing
    layer_distance = crystal.layer_distance
    z_first = radius - crystal.wall_overlap
    if periodic_z:
        z_first = layer_distance / 2
    height = 2 * z_first + (layers - 1) * layer_distance
    # Indices (n, 3) of each sphere: its layer, and its place along y and x.
    index: Ints = np.indices((layers, ny, nx)).reshape(3, -1).T
    layer = index[:, 0]
    n = len(index)
    offset = 0.5 * (layer % 2)
    x = (index[:, 2] + offset) * d
    y = (index[:, 1] + offset) * d
    position = np.column_stack([x, y, z_first + layer * layer_distance])
    neighbour = index[:, None] + STEPS
    neighbour[:, 2:, 1:] += (layer % 2 - 1)[:, None, None]
    shift, inside = np.divmod(neighbour, (layers, ny, nx))
    partner = (inside[..., 0] * ny + inside[..., 1]) * nx + inside[..., 2]
    # Each sphere has six contacts with neighbours, and one with either wall, if they exist.
    exists = np.ones((n, 8), bool)
    exists[:, 6:] = False
    if not periodic_z:
        exists[:, 2:6] = (layer + 1 < layers)[:, None]
        exists[:, 6] = layer == 0
        exists[:, 7] = layer == layers - 1
    sphere, kind = np.nonzero(exists)
    walls = np.broadcast_to([SOURCE_WALL, RECEIVER_WALL], (n, 2))
    contact = ContactList(
        sphere,
        np.column_stack([partner, walls])[exists],
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
        provenance=PROVENANCE,
    ).sphere_network(contact)


def column(particles: int = 3, force: float = 0.5, radius: float = RADIUS) -> Network:
    """Return a column of glass spheres between two flat walls under `force`, N."""
    pair, wall = laws_of(GLASS)
    overlap = float(pair.overlap_of_force(force, radius / 2))
    wall_overlap = float(wall.overlap_of_force(force, radius))
    k: Ints = np.arange(particles)
    z = radius - wall_overlap + k * (2 * radius - overlap)
    normal = np.zeros((particles + 1, 3))
    normal[:, 2] = [-1.0, *np.ones(particles)]
    contact = ContactList(
        np.array([0, *k]),
        np.array([SOURCE_WALL, *k[1:], RECEIVER_WALL]),
        np.zeros((particles + 1, 3), int),
        normal,
        np.array([wall_overlap, *np.full(particles - 1, overlap), wall_overlap]),
    )
    return Sample(
        np.column_stack([np.zeros(particles), np.zeros(particles), z]),
        np.full(2, 4 * radius),
        np.array([0.0, z[-1] + radius - wall_overlap]),
        friction=np.inf,
        radius=radius,
        periodic_sides=(False, False),
        study={"case": "column"},
        provenance=PROVENANCE,
    ).sphere_network(contact)
