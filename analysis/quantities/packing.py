"""Measure the state of a packing at rest: its density, contacts, order and forces."""

from collections.abc import Callable

import numpy as np

from analysis.caveats import Caveat
from analysis.packing_data import PackingData
from analysis.quantities.registry import on_request, quantity
from analysis.same_state import note
from analysis.steps import Step, limit_step
from analysis.value import Value, unknown
from modal.packing import state
from modal.packing.network import Network
from modal.packing.occupied import occupied_part
from modal.packing.rattlers import force_bearing
from modal.packing.weight import unbalanced_forces
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError

MAX_RELATIVE_RADIUS_DIFFERENCE = 1e-9
"""Largest relative difference of two radii that count as equal: a file may round them."""


def _measure_coordination(network: Network) -> float:
    return network.coordination_number


def _measure_coordination_of_bearing(network: Network) -> float:
    return float(state.coordination_without_rattlers(network)[0])


def _measure_rattlers(network: Network) -> float:
    return float(1 - force_bearing(network).sum() / max(int((~network.held).sum()), 1))


def _measure_fabric(network: Network) -> float:
    return float(state.fabric_tensor(network)[2, 2])


def _forces_between_spheres(network: Network) -> Floats:
    """Return the normal forces (m,), N, between spheres; UnavailableError if there are none."""
    force: Floats = network.require("force_normal", "distribution of forces")[~network.with_wall]
    if not force.any():
        raise UnavailableError("no_forces", "no force between two spheres")
    return force


def _measure_force_squared(network: Network) -> float:
    force = _forces_between_spheres(network)
    return float((force**2).mean() / force.mean() ** 2)


def _measure_weak_forces(network: Network) -> float:
    force = _forces_between_spheres(network)
    return float((force < 0.5 * force.mean()).mean())


def _measure_lateral_stress(network: Network) -> float:
    stress = np.diag(state.stress_tensor(network))
    if stress[2] == 0:
        raise UnavailableError("no_forces", "no stress along z")
    return float(stress[:2].mean() / stress[2])


def _measure_residual(network: Network) -> float:
    force = network.require("force_normal", "balance")
    if not force.any():
        raise UnavailableError("no_forces", "no contact bears a force")
    return float(unbalanced_forces(network).mean())


def of_free_packing(network: Network) -> Value | None:
    """Return the void ratio in the core of a packing with free ends; None without free ends."""
    occupied = occupied_part(network)
    if occupied is None:
        return None
    ends = ", ".join(occupied.free_names)
    caveat = Caveat("free_surface", {"ends": ends, "cubes": occupied.cubes})
    steps = (Step("window", "read", {"cubes": occupied.cubes}),)
    parts = {"fit": occupied.void_ratio_error}
    return Value(occupied.void_ratio, "1", parts, (caveat,), steps=steps)


EXACT: dict[str, tuple[Callable[[Network], float], str]] = {
    "coordination": (
        _measure_coordination,
        "contacts of a sphere, rattlers and contacts with walls included",
    ),
    "coordination_of_bearing": (
        _measure_coordination_of_bearing,
        "contacts among force-bearing spheres, of one",
    ),
    "mobilised": (
        state.mobilised_per_particle,
        "contacts at the friction limit, of a force-bearing sphere; each counts once",
    ),
    "rattlers": (_measure_rattlers, "share of spheres that bear no force"),
    "fabric_zz": (_measure_fabric, "mean n_z^2 of contact normals"),
    "lateral_stress": (_measure_lateral_stress, "mean lateral stress over that along z"),
    "force_squared": (
        _measure_force_squared,
        "mean squared normal force between spheres over squared mean",
    ),
    "weak_forces": (
        _measure_weak_forces,
        "share of normal forces between spheres below half the mean",
    ),
    "residual": (
        _measure_residual,
        "mean net force of a sphere over mean contact force, its weight left out, torque over the "
        "radius in it",
    ),
}
"""Numbers that follow exactly from the packing: the function of its network, and the definition."""


def _exact(function: Callable[[Network], float]) -> Callable[[PackingData], Value]:
    """Return a function that measures an exact number of a packing's network, without error."""

    def measure(packing: PackingData) -> Value:
        return Value(float(function(packing.network)), "1")

    return measure


@quantity("1", definition="volume of voids over that of spheres")
def void_ratio(packing: PackingData) -> Value:
    """Measure the void ratio from wall to wall.

    If the packing has a free surface, measure it in the core, away from the surface and from walls.
    """
    exact = Value(state.void_ratio(packing.network), "1")
    return of_free_packing(packing.network) or exact


for _name, (_function, _definition) in EXACT.items():
    _on_request = _name not in ("coordination", "mobilised")
    quantity("1", name=_name, definition=_definition, on_request=_on_request)(_exact(_function))


@quantity("1", definition="share of spheres in crystalline surroundings")
def crystalline_share(packing: PackingData) -> Value:
    """Measure the share of all spheres in crystalline surroundings; a random packing has few."""
    if packing.crystalline:
        return Value(packing.crystalline["crystalline_share"], "1")
    radius = packing.network.radius
    numbers = {
        "radius_difference": np.ptp(radius) / radius.mean(),
        "limit": MAX_RELATIVE_RADIUS_DIFFERENCE,
    }
    equal_radii = limit_step(numbers, "radius_difference", "limit")
    reason = "spheres are not equal"
    if equal_radii.outcome == "kept":
        reason = "the cell has no periods along x and y"
    return unknown("1", Caveat("no_order", {"reason": reason}), steps=(equal_radii,))


@on_request("1", definition="void ratio away from the walls")
def void_ratio_of_bulk(packing: PackingData) -> Value:
    """Measure the mean void ratio over the layers away from the walls, which order the spheres.

    If the packing has a free surface, measure it in the core.
    """
    of_core = of_free_packing(packing.network)
    if of_core is not None:
        return of_core
    layers = state.profile(packing.network)
    numbers = {"layers": layers.bulk.sum(), "all_layers": len(layers.bulk)}
    if not layers.bulk.any():
        return unknown("1", Caveat("no_bulk"), steps=(Step("window", "none_left", numbers),))
    solid_fraction = (1 / (1 + layers.void_ratio[layers.bulk])).mean()
    steps = (Step("window", "read", numbers),)
    return Value(float(1 / solid_fraction - 1), "1", steps=steps)


@on_request("1", definition="largest deviation of a principal stress from its target")
def stress_error(packing: PackingData) -> Value:
    """Measure the deviation of the principal stresses from the target in the packing's notes."""
    target = note(packing.network, "stress")
    if not target > 0:
        return unknown("1", Caveat("no_stated_stress"))
    stress = np.diag(state.stress_tensor(packing.network))
    error = abs(stress / target - 1).max()
    along_x, along_y, along_z = stress
    numbers = {
        "stress_x": along_x,
        "stress_y": along_y,
        "stress_z": along_z,
        "stated_stress": target,
    }
    return Value(float(error), "1", steps=(Step("window", "read", numbers),))
