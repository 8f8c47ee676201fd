"""Elastic moduli, from the springs' static response, and how they lie to the contacts."""

from __future__ import annotations

from analysis.measuring import Measuring
from analysis.quantities.registry import on_request, without_signal
from analysis.value import Value
from modal.elasticity.plane_waves import isotropic_mean
from modal.packing.rattlers import force_bearing
from modal.packing.state import coordination_without_rattlers


def _of(packing: Measuring, value: float, unit: str = "1", power: float = 1.0) -> Value:
    """A number that goes as some power of the moduli, with what the solver has left of them."""
    moduli = packing.moduli
    caveats = (*moduli.remarks(), *packing.of_one_sample)
    return Value(value, unit, {"fit": power * abs(value) * moduli.error}, caveats)


@without_signal("bulk_modulus", "Pa", "bulk modulus of the packing, mean over directions")
def bulk_modulus(packing: Measuring) -> Value:
    """Of the bulk, where walls bound the packing."""
    return _of(packing, packing.moduli.bulk_modulus, "Pa")


@without_signal("shear_modulus", "Pa", "shear modulus of the packing, mean over directions")
def shear_modulus(packing: Measuring) -> Value:
    """Of the bulk, where walls bound the packing."""
    return _of(packing, packing.moduli.shear_modulus, "Pa")


@on_request("poisson", "1", "Poisson's ratio of the packing")
def poisson(packing: Measuring) -> Value:
    """Of the isotropic solid that is nearest."""
    return _of(packing, packing.moduli.poisson)


@on_request(
    "anisotropy",
    "1",
    "how far the stiffness is from an isotropic one, 0 to 1",
)
def anisotropy(packing: Measuring) -> Value:
    """Of the whole stiffness tensor, as `modal.elasticity.plane_waves` has it."""
    return _of(packing, packing.moduli.anisotropy)


@on_request(
    "v_p_moduli",
    "m/s",
    "velocity of P-waves along z by the elastic moduli",
)
def v_p_moduli(packing: Measuring) -> Value:
    """From no wave."""
    return _of(packing, float(packing.moduli.velocities((0, 0, 1))[0]), "m/s", 0.5)


@on_request(
    "v_s_moduli",
    "m/s",
    "velocity of S-waves along z by the elastic moduli",
)
def v_s_moduli(packing: Measuring) -> Value:
    """Mean of both polarisations."""
    return _of(packing, float(packing.moduli.velocities((0, 0, 1))[1:].mean()), "m/s", 0.5)


@on_request(
    "bulk_over_affine",
    "1",
    "bulk modulus over that of spheres that follow the mean strain",
)
def bulk_over_affine(packing: Measuring) -> Value:
    """What the motion of single spheres leaves of it."""
    return _of(packing, packing.moduli.bulk_modulus / isotropic_mean(packing.moduli.affine)[0])


@on_request(
    "shear_over_affine",
    "1",
    "shear modulus over that of spheres that follow the mean strain",
)
def shear_over_affine(packing: Measuring) -> Value:
    """What the motion of single spheres leaves of it."""
    return _of(packing, packing.moduli.shear_modulus / isotropic_mean(packing.moduli.affine)[1])


@on_request(
    "shear_over_indeterminacy",
    "1",
    "(G D / k) / (h D^3), level in poorly coordinated packings",
)
def shear_over_indeterminacy(packing: Measuring) -> Value:
    """Shear modulus in units of mean contact stiffness k over diameter D, over indeterminacy.

    I. Agnolin and J.-N. Roux (Phys. Rev. E 76, 061304, 2007) find that G so normalised tends to
    vary in proportion to the degree of force indeterminacy per unit volume, h = n (3 Z / 2 - 6):
    forces, three a contact, less equations of balance, six a sphere that bears force.
    """
    network, moduli = packing.network, packing.moduli
    bearing = force_bearing(network)
    inner = ~network.with_wall & bearing[network.particle_i] & bearing[network.partner]
    diameter = 2 * float(network.radius[bearing].mean())
    k = float(network.stiffness_normal[inner].mean())
    spheres = moduli.density / float(network.mass[bearing].mean())
    loose = spheres * (1.5 * coordination_without_rattlers(network)[0] - 6) * diameter**3
    return _of(packing, moduli.shear_modulus * diameter / k / loose)
