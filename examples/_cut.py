"""Cut a part out of a packing, for the examples that need a specimen of another shape."""

import numpy as np

from modal.packing.network import Network

SPHERE_COLUMNS = ("position", "radius", "mass", "inertia")
CONTACT_COLUMNS = (
    "cell_shift",
    "normal",
    "lever_i",
    "lever_j",
    "stiffness_normal",
    "stiffness_tangential",
)


def spheres_inside(packing, inside, *, free_sides=False):
    """Return the spheres of a packing in the mask `inside` (n,), with the contacts among them.

    Contacts with walls stay. With `free_sides` the contacts through periods of the cell go, and the
    cell keeps its size without periods.
    """
    number = np.cumsum(inside) - 1
    joined = inside[packing.particle_i] & (packing.with_wall | inside[packing.partner])
    periodic = packing.cell_periodic
    if free_sides:
        joined &= (packing.cell_shift == 0).all(axis=1)
        periodic = np.zeros(3, bool)
    columns = {name: getattr(packing, name)[inside] for name in SPHERE_COLUMNS}
    columns |= {name: getattr(packing, name)[joined] for name in CONTACT_COLUMNS}
    partner = packing.particle_j[joined]
    return Network(
        **columns,
        particle_i=number[packing.particle_i[joined]],
        particle_j=np.where(partner < 0, partner, number[partner]),
        cell_size=packing.cell_size,
        cell_periodic=periodic,
        wall_position=packing.wall_position,
    )


def segment(packing, low, high):
    """Return the spheres of a packing between two heights, m, with the contacts among them."""
    height = packing.position[:, 2]
    return spheres_inside(packing, (height > low) & (height < high))


def cylinder(packing):
    """Return the spheres of a packing within a cylinder as wide as its cell, with free sides."""
    across = packing.position[:, :2] - packing.cell_size[:2] / 2
    radius = packing.cell_size[:2].min() / 2
    return spheres_inside(packing, np.hypot(*across.T) < radius, free_sides=True)
