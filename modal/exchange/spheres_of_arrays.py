"""Make a packing of the centres and radii of spheres that stand in arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from modal.exchange.digits import SINGLE_PRECISION_DIGITS, are_rounded_to_single_precision
from modal.exchange.law import SI
from modal.exchange.particles_and_contacts import Cell
from modal.exchange.spheres import FULL_DIGITS, SphereOptions, Spheres, enclosing_cell
from modal.exchange.spheres_to_contacts import import_spheres
from modal.packing.contact_law import GLASS
from modal.packing.network import Network
from modal.tools.arguments import checked
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

GLASS_LAW = "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3"
"""Law of glass beads: Young's modulus 60 GPa, Poisson's ratio 0.2, friction 0.3."""


@checked
def from_spheres(
    position: ArrayLike,
    radius: ArrayLike,
    *,
    cell: ArrayLike | None = None,
    walls: ArrayLike | None = None,
    law: str = GLASS_LAW,
    stress: float | None = None,
    tolerance: float = 0.0,
    density: float = GLASS.density,
) -> Network:
    """Make a packing of the centres and radii of spheres.

    Spheres with overlaps, as a simulation has them, touch where they overlap, and the law gives
    forces and stiffnesses. Spheres without known overlaps, as a scan has them, touch where the gap
    is below `tolerance`, and stiffnesses follow from the mean stress: the mean force of a contact
    is 3 p V / sum(l), with the volume V and the branch lengths l (`modal.packing.scan`). The error
    of velocities and moduli of such a packing includes the change under smaller and larger
    tolerances.

    Parameters
    ----------
    position : ndarray (n, 3)
        Centres, m.
    radius : float or ndarray (n,)
        Radius of all spheres, or of each, m.
    cell : ndarray (3,) or (3, 2), optional
        Periods along x, y and z, m, with 0 for an axis that is not periodic; or bounds of a cell
        that is periodic along all axes except that of the walls. By default no axis is periodic.
    walls : sequence of 2 floats, optional
        Heights z of the flat walls, m; None or NaN for an absent wall.
    law : str
        The contact law, in the words that follow pair_style in LAMMPS; by default that of glass
        beads with friction 0.3. It also holds at the walls.
    stress : float, optional
        Mean stress, Pa, of spheres without known overlaps.
    tolerance : float, default 0
        Largest gap of a contact, m; needs `stress`.
    density : float, default 2230
        Density of the spheres, kg/m^3.

    Returns
    -------
    Network
        The packing.

    Raises
    ------
    InputError
        If no two spheres touch, or if the spheres are invalid.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(3, 3, 4), periodic_z=True)
    >>> law = "hertz/material 60e9 0 0.2 tangential mindlin NULL 0 0.5"
    >>> same = modal.from_spheres(crystal.position, crystal.radius, cell=crystal.cell_size, law=law)
    >>> same.n_contacts == crystal.n_contacts
    True
    """
    centres = np.array(position, float)
    if centres.ndim != 2 or centres.shape[1] != 3:
        raise InputError("shape", f"position {centres.shape}", "it is (n, 3)", "give centres")
    if not np.isfinite(centres).all():
        raise InputError("not_finite", "a position is no finite number", remedy="leave it out")
    try:
        radii = np.broadcast_to(np.asarray(radius, float), len(centres)).copy()
    except ValueError as error:
        problem = f"radius {np.shape(radius)}"
        raise InputError("shape", problem, f"it is one number or ({len(centres)},)") from error
    planes = _read_planes(walls)
    digits = FULL_DIGITS
    if any(are_rounded_to_single_precision(numbers) for numbers in (centres.ravel(), radii)):
        digits = SINGLE_PRECISION_DIGITS
    bounds = _cell_of_sides(centres, radii, cell, planes)
    spheres = Spheres(centres, radii, cell=bounds, digits=digits)
    options = SphereOptions(
        pair=law,
        stress=stress,
        tolerance=tolerance,
        density=density,
        scales=(1.0, 1.0, 1.0),
    )
    return import_spheres("from_spheres", spheres, options).network


def _read_planes(walls: ArrayLike | None) -> Floats | None:
    """Return the heights of two walls, m, NaN for an absent wall; None without any wall."""
    if walls is None:
        return None
    planes = np.array(walls, float)  # None becomes NaN
    if planes.shape != (2,):
        raise InputError("shape", f"walls {planes.shape}", "they are two", "give (low, high)")
    if np.isnan(planes).all():
        return None
    return planes


def _cell_of_sides(
    position: Floats, radius: Floats, cell: ArrayLike | None, walls: Floats | None
) -> Cell:
    """Return the cell with these sides (3,) or bounds (3, 2), m, and with walls at these z, m.

    Sides begin at 0, or at the lowest centre if a cell from 0 does not contain all centres. Along
    an axis without a side the cell reaches to the surfaces of the spheres.
    """
    planes = (np.nan, np.nan)
    if walls is not None:
        planes = (float(walls[0]), float(walls[1]))
    surfaces = enclosing_cell(Spheres(position, radius), SI)
    if cell is None:
        return replace(surfaces, walls=planes)
    size = np.array(cell, float)
    if size.shape == (3, 2):
        low, high = size.T
        return Cell(low, high, np.array([True, True, walls is None]), planes)
    if size.shape != (3,):
        raise InputError("shape", f"cell {size.shape}", "it is (3,)", "give the three periods")
    size = np.nan_to_num(size)
    periodic = size > 0
    if walls is not None:
        periodic[2] = False
    lowest = position.min(axis=0)
    fits_from_zero = (lowest >= 0) & (position.max(axis=0) <= size)
    low = np.where(periodic, np.where(fits_from_zero, 0.0, lowest), surfaces.low)
    high = np.where(periodic, low + size, surfaces.high)
    return Cell(low, high, periodic, planes)
