"""Elastic moduli, from the springs' static response, and how they lie to the contacts."""

from collections.abc import Callable

from analysis.caveats import Caveat
from analysis.packing_data import PackingData
from analysis.quantities.registry import on_request, quantity
from analysis.value import Value, unknown
from modal.elasticity.moduli import ElasticModuli
from modal.elasticity.plane_waves import isotropic_mean
from modal.packing.rattlers import force_bearing
from modal.packing.state import coordination_without_rattlers

ALONG_Z, OVER_AFFINE = (0, 0, 1), "over that of spheres that follow the mean strain"
SOFT = 1e-5
"""Of the fastest wave's velocity: a slower one has no stiffness beyond round-off, 1e-10 of it."""
POWER = {"Pa": 1.0, "1": 1.0, "m/s": 0.5}
"""Of the moduli that a number goes as, by its unit."""


def _over_affine(m: ElasticModuli) -> tuple[float, float]:
    bulk, shear = isotropic_mean(m.affine)
    return m.bulk_modulus / bulk, m.shear_modulus / shear


OF_MODULI: dict[str, tuple[str, Callable[[ElasticModuli], float], str]] = {
    "bulk_modulus": ("Pa", lambda m: m.bulk_modulus, "bulk modulus, mean over directions"),
    "shear_modulus": ("Pa", lambda m: m.shear_modulus, "shear modulus, mean over directions"),
    "poisson": ("1", lambda m: m.poisson, "Poisson's ratio of the isotropic solid nearest"),
    "anisotropy": ("1", lambda m: m.anisotropy, "how far from isotropic it is, 0 to 1"),
    "c_axial": ("Pa", lambda m: m.stiffness[2, 2], "stiffness of strain along z alone, C_zz"),
    "c_lateral": ("Pa", lambda m: m.stiffness.diagonal()[:2].mean(), "the same, mean of x and y"),
    "g_axial": ("Pa", lambda m: m.stiffness.diagonal()[3:5].mean(), "shear, mean of yz and zx"),
    "g_lateral": ("Pa", lambda m: m.stiffness[5, 5], "shear modulus in the plane across z, xy"),
    "v_p_moduli": ("m/s", lambda m: m.velocities(ALONG_Z)[0], "V_P along z by the moduli"),
    "v_s_moduli": ("m/s", lambda m: m.velocities(ALONG_Z)[1:].mean(), "V_S, mean of both waves"),
    "bulk_over_affine": ("1", lambda m: _over_affine(m)[0], f"bulk modulus {OVER_AFFINE}"),
    "shear_over_affine": ("1", lambda m: _over_affine(m)[1], f"shear modulus {OVER_AFFINE}"),
}
"""By name: unit, what it is of the moduli, in words.

Of the bulk, where walls bound the packing; anisotropy as `modal.elasticity.plane_waves` has it.
"""


def of_moduli(
    unit: str, number: Callable[[ElasticModuli], float]
) -> Callable[[PackingData], Value]:
    """A number of the moduli, with what the solver has left of them."""

    def measured(m: PackingData) -> Value:
        value = float(number(m.moduli))
        if unit == "m/s" and not value > SOFT * m.moduli.velocities(ALONG_Z)[0]:
            return unknown(unit, Caveat("no_stiffness"))
        remarks = [Caveat("moduli", {"text": remark}) for remark in m.moduli.remarks()]
        caveats = (*remarks, *m.of_one_sample)
        size = POWER[unit] * abs(value)
        # Of slabs cut from repeated cells twice the asymmetry is what their stiffness was off by.
        parts = {"fit": size * m.moduli.error, "length": 2 * size * m.moduli.asymmetry}
        return Value(value, unit, parts, caveats)

    return measured


for _name, (_unit, _number, _definition) in OF_MODULI.items():
    _on_request = _name not in ("bulk_modulus", "shear_modulus")
    quantity(_unit, name=_name, definition=_definition, on_request=_on_request)(
        of_moduli(_unit, _number)
    )


@on_request("1", definition="(G D / k) / (h D^3), level in poorly coordinated packings")
def shear_over_indeterminacy(packing: PackingData) -> Value:
    """(G D / k) / (h D^3), level in poorly coordinated packings.

    Shear modulus in units of mean contact stiffness k over diameter D, over indeterminacy.

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
    return of_moduli("1", lambda m: m.shear_modulus * diameter / k / loose)(packing)
