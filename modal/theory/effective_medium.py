"""Compute effective-medium moduli of random packings: every sphere follows the mean strain.

In an isotropic packing of equal spheres of radius R, with solid fraction phi and z contacts for
each sphere, all of stiffnesses kn and kt,

    K = phi z kn / (6 pi R),    G = phi z (kn + 3/2 kt) / (10 pi R).

Under an isotropic pressure p the normal force is N = 4 pi R^2 p / (phi z), and the contact law
gives the stiffnesses at this force. With Hertz and Mindlin this is the theory of K. Walton (J.
Mech. Phys. Solids 35, 213, 1987) for infinitely rough spheres, and, with kt = 0, for smooth ones.
H. A. Makse, N. Gland, D. L. Johnson, L. M. Schwartz (Phys. Rev. Lett. 83, 5070, 1999; Phys. Rev. E
70, 061302, 2004) compare it with simulations at the z and phi of the packing, as is done here. P.
J. Digby (J. Appl. Mech. 48, 803, 1981) considers spheres that are bonded over a small circle and
smooth around it.

The spheres of real packings relax from the mean strain. The theory is therefore an upper bound, and
for G at low z far too high.
"""

from typing import NamedTuple

import numpy as np

from modal.packing.cementation import CEMENT
from modal.packing.contact_law import Material, sphere_volume
from modal.packing.contact_models import laws_of
from modal.packing.network import Network
from modal.packing.noted_laws import noted_material
from modal.packing.state import stress_tensor, volume_between_walls
from modal.tools.errors import InputError, UnavailableError


class IsotropicModuli(NamedTuple):
    """Bulk modulus K and shear modulus G of an isotropic solid, Pa.

    >>> IsotropicModuli(5e8, 3e8).poisson.__round__(3)
    0.25
    """

    bulk: float
    shear: float

    @property
    def poisson(self) -> float:
        """Poisson's ratio."""
        return (3 * self.bulk - 2 * self.shear) / (2 * (3 * self.bulk + self.shear))

    def velocities(self, density: float) -> tuple[float, float]:
        """Return V_P and V_S, m/s, in a solid of a density in kg/m^3."""
        p_wave = (self.bulk + 4 / 3 * self.shear) / density
        return float(np.sqrt(p_wave)), float(np.sqrt(self.shear / density))


class Assembly(NamedTuple):
    """The properties of a packing that effective-medium theory uses.

    stress: pressure, Pa. coordination: contacts of a sphere, z. solid_fraction: phi. radius: radius
    of the spheres, m. material: their material, with the contact model.
    """

    stress: float
    coordination: float
    solid_fraction: float
    radius: float
    material: Material

    @property
    def contact_force(self) -> float:
        """Mean normal force, N, of a contact under the pressure."""
        contacts = self.coordination * self.solid_fraction
        return 4 * np.pi * self.radius**2 * self.stress / contacts


def affine_moduli(
    normal: float, tangential: float, coordination: float, solid_fraction: float, radius: float
) -> IsotropicModuli:
    """Return the moduli of an isotropic packing whose spheres follow the mean strain.

    `normal` and `tangential` are the stiffnesses of each contact, N/m; `radius` is in m.

    >>> rough = affine_moduli(1e6, 1e6, 6, 0.6, 1e-3)
    >>> round(rough.bulk / rough.shear, 4) == round(5 / 7.5, 4)
    True
    """
    contacts = solid_fraction * coordination / (np.pi * radius)
    bulk = contacts * normal / 6
    shear = contacts * (normal + 1.5 * tangential) / 10
    return IsotropicModuli(float(bulk), float(shear))


def walton(assembly: Assembly, *, rough: bool = True) -> IsotropicModuli:
    """Return Walton's moduli of spheres that do not slip, or that are smooth.

    The stiffnesses are those of the material's contact model under the mean force. `rough` spheres
    do not slip. Raises InputError if the packing has no pressure or no contacts.
    """
    _refuse_loose(assembly)
    law, _ = laws_of(assembly.material)
    effective = assembly.radius / 2
    overlap = law.overlap_of_force(assembly.contact_force, effective)
    tangential = 0.0
    if rough:
        tangential = float(law.stiffness_tangential(overlap, effective))
    normal = float(law.stiffness_normal(overlap, effective))
    return affine_moduli(
        normal, tangential, assembly.coordination, assembly.solid_fraction, assembly.radius
    )


def digby(assembly: Assembly, *, bond_radius: float) -> IsotropicModuli:
    """Return Digby's moduli of spheres that are bonded over circles of `bond_radius` b, m.

    Under the force N = 4/3 E* r (r^2 + 3/2 b^2) / R* the spheres touch over a circle of radius a,
    a^2 = b^2 + r^2; kn = 2 E* a, and only the bonded part resists sliding, kt = 8 G* b. Without
    bonds these are smooth spheres. InputError if the packing has neither pressure nor bonds.
    """
    from scipy.optimize import brentq  # not at import: the command line would load it each time

    if not (bond_radius > 0 and assembly.stress >= 0):
        _refuse_loose(assembly)
    effective = assembly.radius / 2
    young, shear = assembly.material.moduli
    force = assembly.contact_force

    def excess(rise: float) -> float:
        """Return the force of the contact minus that of the pressure, N; `rise`^2 = a^2 - b^2."""
        return 4 / 3 * young * rise * (rise**2 + 1.5 * bond_radius**2) / effective - force

    hertz = (0.75 * force * effective / young) ** (1 / 3)
    rise = brentq(excess, 0.0, 2 * hertz, xtol=1e-16) if force else 0.0
    contact_radius = float(np.hypot(rise, bond_radius))
    return affine_moduli(
        2 * young * contact_radius,
        8 * shear * bond_radius,
        assembly.coordination,
        assembly.solid_fraction,
        assembly.radius,
    )


def assembly_of(network: Network) -> Assembly:
    """Return the properties of a packing that effective-medium theory uses, from wall to wall.

    The coordination number is that of all spheres, the radius is their mean, and the material is
    read from the notes. Raises UnavailableError if forces, a volume or the notes on the material
    are absent, and for contacts with cement, whose stiffness does not follow from their forces.
    """
    if CEMENT in network.study:
        raise UnavailableError(
            "cemented",
            "Walton's theory of contacts with cement",
            "it takes the stiffness of a contact from its force",
            "compare with the affine moduli of the packing's own springs",
        )
    if "young" not in network.study:
        raise UnavailableError(
            "unknown_material",
            "the packing does not say of which material its spheres are",
            "effective-medium theory needs its modulus",
            "note young, poisson and contact_model in its group study",
        )
    volume = volume_between_walls(network)
    solid_volume = float(sphere_volume(network.radius).sum())
    pressure = float(np.trace(stress_tensor(network)) / 3)
    return Assembly(
        stress=pressure,
        coordination=float(network.coordination_number),
        solid_fraction=solid_volume / volume,
        radius=float(network.radius.mean()),
        material=noted_material(network.study),
    )


def _refuse_loose(assembly: Assembly) -> None:
    """Raise InputError if there is no pressure or no contacts."""
    if not (assembly.stress > 0 and assembly.coordination > 0 and assembly.solid_fraction > 0):
        raise InputError(
            "no_pressure",
            f"spheres under {assembly.stress:g} Pa with {assembly.coordination:g} contacts each",
            "effective-medium theory needs a pressure and contacts",
            "compress the packing",
        )
