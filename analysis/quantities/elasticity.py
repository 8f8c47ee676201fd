"""Measure the elastic moduli by the static response of the contacts."""

from collections.abc import Callable

from analysis.caveats import Caveat
from analysis.packing_data import PackingData
from analysis.quantities.few_digits import part_of_moduli_error
from analysis.quantities.registry import on_request, quantity
from analysis.steps import Step, limit_step
from analysis.value import Value, unknown
from modal.elasticity.moduli import UNEVEN_ASYMMETRY, ElasticModuli
from modal.elasticity.plane_waves import isotropic_mean
from modal.packing.rattlers import force_bearing
from modal.packing.state import coordination_without_rattlers
from modal.theory.effective_medium import assembly_of, walton

ALONG_Z = (0, 0, 1)
MIN_RELATIVE_VELOCITY = 1e-5
"""Least velocity divided by that of the fastest wave. A slower wave has a stiffness below 1e-10 of
that of the fastest, which is round-off."""
MODULUS_POWER = {"Pa": 1.0, "1": 1.0, "m/s": 0.5}
"""Power of the moduli to which a number is proportional, by its unit. The relative error of the
number is the relative error of the moduli times this power."""
MEASURED_BY_DEFAULT = "bulk_modulus", "shear_modulus"
"""Quantities of `OF_MODULI` that are measured without a request."""


def _bulk_over_affine(moduli: ElasticModuli) -> float:
    bulk, _ = isotropic_mean(moduli.affine)
    return moduli.bulk_modulus / bulk


def _shear_over_affine(moduli: ElasticModuli) -> float:
    _, shear = isotropic_mean(moduli.affine)
    return moduli.shear_modulus / shear


_SMOOTH = "of spheres without friction"
_OVER_AFFINE = "over that of spheres that follow the mean strain"
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
    "bulk_over_affine": ("1", _bulk_over_affine, f"bulk modulus {_OVER_AFFINE}"),
    "shear_over_affine": ("1", _shear_over_affine, f"shear modulus {_OVER_AFFINE}"),
}
"""Unit, function of the moduli and definition of each quantity, by name.

The moduli are those of the bulk if walls bound the packing. `modal.elasticity.plane_waves` defines
the anisotropy.
"""


def measure_of_moduli(
    packing: PackingData, unit: str, function: Callable[[ElasticModuli], float]
) -> Value:
    """Measure a number that follows from the moduli; `unit` is a key of `MODULUS_POWER`.

    The error combines that of the solver (`fit`) and that of the ends of the slab in which the
    moduli are measured (`length`): in tests with slabs of repeated cells, whose stiffness is known,
    the error of the stiffness was twice its asymmetry.
    """
    moduli = packing.moduli
    value = float(function(moduli))
    steps = [
        Step("fit", "converged", {"residual": moduli.error}),
        limit_step(
            {"asymmetry": moduli.asymmetry, "limit": UNEVEN_ASYMMETRY}, "asymmetry", "limit"
        ),
    ]
    if unit == "m/s":
        least = MIN_RELATIVE_VELOCITY * moduli.velocities(ALONG_Z)[0]
        numbers = {"velocity": value, "least_velocity": least}
        steps.append(limit_step(numbers, "velocity", "least_velocity", least=True))
        if not value > least:
            return unknown(unit, Caveat("no_stiffness"), steps=tuple(steps))
    caveats = [Caveat(remark.code, {"text": remark.text}) for remark in moduli.remarks()]
    size = MODULUS_POWER[unit] * abs(value)
    parts = {
        part_of_moduli_error(packing.network): size * moduli.error,
        "length": 2 * size * moduli.asymmetry,
    }
    return Value(value, unit, parts, (*caveats, *packing.of_one_sample), steps=tuple(steps))


def _register(
    name: str, unit: str, function: Callable[[ElasticModuli], float], definition: str
) -> None:
    """Register a number of the moduli as a quantity."""

    def measure(packing: PackingData) -> Value:
        return measure_of_moduli(packing, unit, function)

    by_request = name not in MEASURED_BY_DEFAULT
    quantity(unit, name=name, definition=definition, on_request=by_request)(measure)


for _name, (_unit, _function, _definition) in OF_MODULI.items():
    _register(_name, _unit, _function, _definition)


def _register_walton(name: str, rough: bool, modulus: str, definition: str) -> None:
    """Register a modulus divided by that of Walton's theory as a quantity."""

    def measure(packing: PackingData) -> Value:
        expected = getattr(walton(assembly_of(packing.network), rough=rough), modulus)

        def ratio(moduli: ElasticModuli) -> float:
            return float(getattr(moduli, f"{modulus}_modulus")) / expected

        return measure_of_moduli(packing, "1", ratio)

    quantity("1", name=name, definition=definition, on_request=True)(measure)


_OVER_WALTON = "over that of Walton's effective medium of the same z, phi and pressure"
_register_walton("bulk_over_walton", True, "bulk", f"bulk modulus {_OVER_WALTON}")
_register_walton("shear_over_walton", True, "shear", f"shear modulus {_OVER_WALTON}, rough")
_register_walton("shear_over_walton_smooth", False, "shear", f"the same, {_SMOOTH}")


@on_request("1", definition="(G D / k) / (h D^3), level in poorly coordinated packings")
def shear_over_indeterminacy(packing: PackingData) -> Value:
    """Measure the shear modulus in units of k / D, divided by the indeterminacy h D^3.

    k is the mean contact stiffness, D the diameter. I. Agnolin and J.-N. Roux (Phys. Rev. E 76,
    061304, 2007) find that the shear modulus in this unit tends to vary in proportion to the degree
    of force indeterminacy per unit volume, h = n (3 Z / 2 - 6): each contact has three forces, each
    sphere that bears force six equations of balance.
    """
    network = packing.network
    density = packing.moduli.density
    bearing = force_bearing(network)
    inner = ~network.with_wall & bearing[network.particle_i] & bearing[network.partner]
    diameter = 2 * float(network.radius[bearing].mean())
    stiffness = float(network.stiffness_normal[inner].mean())
    number_density = density / float(network.mass[bearing].mean())
    coordination = coordination_without_rattlers(network)[0]
    indeterminacy = number_density * (1.5 * coordination - 6) * diameter**3

    def ratio(moduli: ElasticModuli) -> float:
        return moduli.shear_modulus * diameter / stiffness / indeterminacy

    return measure_of_moduli(packing, "1", ratio)
