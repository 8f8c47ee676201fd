"""Saturate a packing with a fluid: Gassmann's moduli, the added mass, and their limits.

**Low frequencies.** The fluid moves with the grains and is compressed with the pores. With the
moduli K and G of the dry packing, K_s of the grains, K_f of the fluid and the porosity phi
(F. Gassmann, Vierteljahrsschr. Naturforsch. Ges. Zurich 96, 1, 1951),

    K_sat = K + (1 - K/K_s)^2 / (phi/K_f + (1 - phi)/K_s - K/K_s^2),   G_sat = G,

and the density is that of grains and fluid together. This holds well below Biot's frequency
f_B = eta phi / (2 pi rho_f k) (M. A. Biot, J. Acoust. Soc. Am. 28, 168, 1956), where the fluid
begins to slip past the grains. The permeability k is that of Kozeny and Carman,
k = phi^3 D^2 / (180 (1 - phi)^2), with D the mean diameter by volume over surface.

**High frequencies.** A fluid without viscosity adds half the mass of displaced fluid to the mass of
a sphere (H. Lamb, Hydrodynamics, article 92), and nothing to its moment of inertia. The model
neglects neighbours, which raise the added mass, and the pore pressure.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modal.packing.contact_law import Elasticity, sphere_volume
from modal.packing.network import Network
from modal.packing.state import void_ratio, volume_between_walls
from modal.theory.effective_medium import IsotropicModuli
from modal.tools.errors import InputError, refuse_unknown

ADDED_MASS_SHARE = 0.5
"""Mass that a sphere in an endless fluid carries along, divided by the mass that it displaces."""
KOZENY_CARMAN = 180.0
"""Kozeny and Carman's constant for packings of spheres."""


class Fluid(NamedTuple):
    """A fluid: bulk_modulus, Pa; density, kg/m^3; viscosity, Pa s."""

    bulk_modulus: float
    density: float
    viscosity: float


FLUIDS = {
    "air": Fluid(1.42e5, 1.2, 1.8e-5),
    "water": Fluid(2.2e9, 1000.0, 1.0e-3),
    "glycerol": Fluid(4.35e9, 1260.0, 1.4),
}
"""Fluids by name, near 20 degrees Celsius."""


class SaturatedPacking(NamedTuple):
    """A saturated packing at low frequencies.

    moduli: Gassmann's moduli, Pa. density: density of grains and fluid together, kg/m^3.
    permeability, m^2. biot_frequency, Hz: the moduli hold well below this frequency.
    """

    moduli: IsotropicModuli
    density: float
    permeability: float
    biot_frequency: float

    @property
    def velocities(self) -> tuple[float, float]:
        """V_P and V_S, m/s."""
        return self.moduli.velocities(self.density)


def named_fluid(name: str) -> Fluid:
    """Return a fluid of `FLUIDS`; raise InputError if there is none of this name."""
    refuse_unknown("fluid", name, FLUIDS)
    return FLUIDS[name]


def gassmann(
    dry: IsotropicModuli, porosity: float, grain_modulus: float, fluid_modulus: float
) -> IsotropicModuli:
    """Return the moduli, Pa, of a packing whose pores a fluid fills, at low frequencies.

    `dry` are the moduli of the frame, `grain_modulus` and `fluid_modulus` bulk moduli, all in Pa.
    Raises InputError unless 0 < porosity < 1 and 0 <= K < `grain_modulus`.

    >>> soft = IsotropicModuli(0.0, 0.0)
    >>> round(gassmann(soft, 0.4, 3e10, 2e9).bulk / 1e9, 3) == round(1 / (0.4 / 2 + 0.6 / 30), 3)
    True
    """
    if not (0 < porosity < 1 and 0 <= dry.bulk < grain_modulus and fluid_modulus > 0):
        raise InputError(
            "saturation",
            f"porosity {porosity:g}, bulk moduli {dry.bulk:g} (frame), {grain_modulus:g} (grains), "
            f"{fluid_modulus:g} Pa (fluid)",
            "the frame is softer than its grains, and the porosity lies between 0 and 1",
            "give the moduli of a dry packing",
        )
    softening = 1 - dry.bulk / grain_modulus
    compliance = porosity / fluid_modulus + (1 - porosity) / grain_modulus
    compliance -= dry.bulk / grain_modulus**2
    return IsotropicModuli(dry.bulk + softening**2 / compliance, dry.shear)


def grain_bulk_modulus(material: Elasticity) -> float:
    """Return the bulk modulus E / (3 (1 - 2 nu)), Pa, of the solid grains."""
    return material.young / (3 * (1 - 2 * material.poisson))


def permeability(network: Network) -> float:
    """Return the permeability, m^2, of a packing by Kozeny and Carman."""
    porosity = _porosity(network)
    radius = network.radius
    diameter = 2 * float((radius**3).sum() / (radius**2).sum())
    return porosity**3 * diameter**2 / (KOZENY_CARMAN * (1 - porosity) ** 2)


def saturate(
    network: Network, dry: IsotropicModuli, material: Elasticity, fluid: Fluid
) -> SaturatedPacking:
    """Return the moduli and the density of a packing whose pores a fluid fills.

    At low frequencies the fluid carries rattlers along: all spheres count in the density.

    Parameters
    ----------
    network : Network
        The packing, for its porosity and the size of its pores.
    dry : IsotropicModuli
        Moduli of the dry packing.
    material : Elasticity
        Elastic constants of the grains.
    fluid : Fluid
        The fluid in the pores.

    Raises
    ------
    InputError
        If the packing has no pores, or is stiffer than its grains.
    """
    porosity = _porosity(network)
    moduli = gassmann(dry, porosity, grain_bulk_modulus(material), fluid.bulk_modulus)
    flow = permeability(network)
    biot_frequency = fluid.viscosity * porosity / (2 * np.pi * fluid.density * flow)
    density = float(network.mass.sum()) / volume_between_walls(network)
    density += porosity * fluid.density
    return SaturatedPacking(moduli, density, flow, float(biot_frequency))


def with_added_mass(network: Network, fluid: str) -> Network:
    """Return a packing of spheres that carry along half the mass of the fluid that they displace.

    The name of the `fluid` is added to the notes. Raises InputError for an unknown fluid, for
    bodies that are not spheres, and for a packing that already has an added mass.

    >>> import modal
    >>> dry = modal.fcc(cells=(1, 1, 4))
    >>> bool(with_added_mass(dry, "water").mass[0] > dry.mass[0])
    True
    """
    if network.inertia_tensor is not None:
        raise InputError(
            "added_mass_of_bodies",
            "bodies that are no spheres",
            "their added mass depends on their shape and direction",
            "leave the fluid out",
        )
    if "fluid" in network.study:
        raise InputError(
            "fluid_twice",
            f"the packing carries {network.study['fluid']} along already",
            remedy="leave the fluid out",
        )
    displaced = named_fluid(fluid).density * sphere_volume(network.radius)
    return replace(
        network,
        mass=network.mass + ADDED_MASS_SHARE * displaced,
        study=network.study | {"fluid": fluid},
    )


def _porosity(network: Network) -> float:
    """Return the share of pores in the volume, from wall to wall."""
    ratio = void_ratio(network)
    return ratio / (1 + ratio)
