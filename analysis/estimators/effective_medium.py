"""Effective medium theory: stiffness and velocities if every sphere followed the mean strain.

Exact for the FCC crystal along [001]; an upper bound for a random packing, whose spheres relax from
the mean strain (Otsubo et al. 2017, section 2, refs. 16 and 22).
"""

import numpy as np

from modal.packing.contact_law import GLASS, Elasticity, Moduli
from modal.packing.contact_models.hertz_mindlin import HertzMindlin
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.packing.state import affine_stiffness
from modal.tools.errors import InputError

MARGIN = 5.0
"""Mean diameters next to each wall that do not count."""


def velocity_of_contacts(network: Network) -> float:
    """V_P, m/s: mean strain imposed on the very contacts, `MARGIN` diameters from the walls.

    With spheres that neither relax nor turn, M is the sum of `affine_stiffness` over the volume, a
    contact counting by the part of its branch that lies inside. The density is that of the
    force-bearing spheres, from the slope of their number over z, which a crystal's layers do not
    disturb. InputError if nothing is inside.
    """
    zone = MARGIN * 2 * float(network.radius.mean())
    low, high = network.wall_position + np.array([zone, -zone])
    bearing = force_bearing(network)
    z = np.sort(network.position[bearing, 2])
    inside = (z > low) & (z < high)
    pair = ~network.with_wall
    branch = network.branch[pair]
    start = network.position[network.particle_i[pair], 2]
    ends = np.sort(np.column_stack([start, start + branch[:, 2]]), axis=1)
    span = np.maximum(ends[:, 1] - ends[:, 0], 1e-12 * network.radius.mean())
    part = np.clip(np.minimum(ends[:, 1], high) - np.maximum(ends[:, 0], low), 0, None) / span
    if inside.sum() < 2 or not part.any():
        raise InputError(
            f"the packing is {network.length / (zone / MARGIN):.1f} diameters long: it has no bulk "
            f"{MARGIN:g} diameters away from both walls; take one of more than {2 * MARGIN:g}"
        )
    per_length = np.polyfit(z[inside], np.flatnonzero(inside), 1)[0]
    density = float(network.mass.mean()) * per_length / network.area
    modulus = part @ affine_stiffness(network) / (network.area * (high - low))
    return float(np.sqrt(modulus / density))


HERTZ = 1e-2
"""Largest relative scatter of E* over contacts of one material: overlaps of few digits have it."""


def moduli_of(network: Network) -> Moduli:
    """E* and G*, Pa, of Hertz contacts between spheres: kn^3 = 6 E*^2 R* F, kt / kn = 4 G* / E*.

    NaN without contact forces, and where the contacts are of several materials or another law.
    """
    pair, force = ~network.with_wall, network.force_normal
    if force is None or not pair.any() or not (force[pair] > 0).all():
        return Moduli(np.nan, np.nan)
    ends = network.particle_i[pair], network.particle_j[pair]
    first, second = (network.radius[each] for each in ends)
    kn, kt = network.stiffness_normal[pair], network.stiffness_tangential[pair]
    young = np.sqrt(kn**3 / (6 * first * second / (first + second) * force[pair]))
    if young.std() > HERTZ * young.mean():
        return Moduli(np.nan, np.nan)
    return Moduli(float(young.mean()), float(young.mean() * kt.mean() / kn.mean() / 4))


def velocity_of_means(
    void_ratio: float,
    coordination: float,
    stress: float,
    radius: float,
    material: Elasticity | Moduli = GLASS,
    density: float = GLASS.density,
) -> float:
    """V_P, m/s, of a random isotropic packing of equal spheres, by its means alone, stress in Pa.

    Every contact carries the mean force N = 4 pi R^2 (1 + e) stress / Z; then
    M = Z (3 kn + 2 kt) / (10 pi R (1 + e)), the P-wave modulus of the isotropic average
    (<n_z^4> = 1/5, <n_z^2> - <n_z^4> = 2/15). `density` of a sphere, kg/m^3.
    """
    force = 4 * np.pi * radius**2 * (1 + void_ratio) * stress / coordination
    law = HertzMindlin(material.effective_young, material.effective_shear)
    overlap = law.overlap_of_force(force, radius / 2)
    kn, kt = (of(overlap, radius / 2) for of in (law.stiffness_normal, law.stiffness_tangential))
    modulus = coordination * (3 * kn + 2 * kt) / (10 * np.pi * radius * (1 + void_ratio))
    return float(np.sqrt(modulus / (density / (1 + void_ratio))))
