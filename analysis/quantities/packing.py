"""What the packing is: densities, contacts, order, forces at rest."""

from collections.abc import Callable
from typing import Any

import numpy as np

from analysis.caveats import Caveat
from analysis.packing_data import PackingData
from analysis.quantities.registry import on_request, quantity
from analysis.same_state import note
from analysis.value import Value, unknown
from modal.packing import state
from modal.packing.network import Network
from modal.packing.occupied import occupied_part
from modal.packing.rattlers import force_bearing
from modal.packing.weight import unbalanced_forces
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError


def _forces(network: Network) -> Floats:
    """Normal forces (m,), N, between spheres; refused where there are none."""
    force: Floats = network.require("force_normal", "distribution of forces")[~network.with_wall]
    if not force.any():
        raise UnavailableError("no_forces", "no force between two spheres")
    return force


def _lateral(network: Network) -> float:
    stress = np.diag(state.stress_tensor(network))
    if stress[2] == 0:
        raise UnavailableError("no_forces", "no stress along z")
    return stress[:2].mean() / stress[2]


def _residual(network: Network) -> float:
    force = network.require("force_normal", "balance")
    if not force.any():
        raise UnavailableError("no_forces", "no contact bears a force")
    return float(unbalanced_forces(network).mean())


def of_free_packing(network: Network) -> Value | None:
    """Return the void ratio of a packing with free ends, by its core; None of one without."""
    occupied = occupied_part(network)
    if occupied is None:
        return None
    ends = ", ".join(occupied.free_names)
    caveat = Caveat("free_surface", {"ends": ends, "cubes": occupied.cubes})
    return Value(occupied.void_ratio, "1", {"fit": occupied.void_ratio_error}, (caveat,))


EXACT: dict[str, tuple[Callable[[Network], Any], str]] = {
    "coordination": (
        lambda n: state.contacts_per_particle(n).mean(),
        "contacts of a sphere, rattlers and contacts with walls included",
    ),
    "coordination_of_bearing": (
        lambda n: state.coordination_without_rattlers(n)[0],
        "contacts among force-bearing spheres, of one",
    ),
    "rattlers": (lambda n: 1 - force_bearing(n).mean(), "share of spheres that bear no force"),
    "fabric_zz": (lambda n: state.fabric_tensor(n)[2, 2], "mean n_z^2 of contact normals"),
    "lateral_stress": (_lateral, "mean lateral stress over that along z"),
    "force_squared": (
        lambda n: (_forces(n) ** 2).mean() / _forces(n).mean() ** 2,
        "mean squared normal force between spheres over squared mean",
    ),
    "weak_forces": (
        lambda n: (_forces(n) < 0.5 * _forces(n).mean()).mean(),
        "share of normal forces between spheres below half the mean",
    ),
    "residual": (
        _residual,
        "mean net force of a sphere over mean contact force, its weight left out, torque over the "
        "radius in it",
    ),
}
"""Numbers without an error, exact for the packing, and what they are."""


def _exact(number: Callable[[Network], Any]) -> Callable[[PackingData], Value]:
    return lambda packing: Value(float(number(packing.network)), "1")


@quantity("1", definition="volume of voids over that of spheres")
def void_ratio(packing: PackingData) -> Value:
    """Volume of voids over that of spheres.

    From wall to wall; of a packing with a free surface away from that and from walls.
    """
    exact = Value(state.void_ratio(packing.network), "1")
    return of_free_packing(packing.network) or exact


for _name, (_number, _definition) in EXACT.items():
    _on_request = _name != "coordination"
    quantity("1", name=_name, definition=_definition, on_request=_on_request)(_exact(_number))


@quantity("1", definition="share of spheres in crystalline surroundings")
def crystalline_share(packing: PackingData) -> Value:
    """Share of spheres in crystalline surroundings.

    Of all spheres; a random packing has few.
    """
    if not packing.crystalline:
        radius = packing.network.radius
        equal = np.ptp(radius) <= 1e-9 * radius.mean()
        why = "the cell has no periods along x and y" if equal else "spheres are not equal"
        return unknown("1", Caveat("no_order", {"reason": why}))
    return Value(packing.crystalline["crystalline_share"], "1")


@on_request("1", definition="void ratio away from the walls")
def void_ratio_of_bulk(packing: PackingData) -> Value:
    """Void ratio away from the walls.

    Mean over the layers that no wall orders.
    """
    if free := of_free_packing(packing.network):
        return free
    layers = state.profile(packing.network)
    if not layers.bulk.any():
        return unknown("1", Caveat("no_bulk"))
    return Value(float(1 / (1 / (1 + layers.void_ratio[layers.bulk])).mean() - 1), "1")


@on_request("1", definition="largest deviation of a principal stress from its target")
def stress_error(packing: PackingData) -> Value:
    """Largest deviation of a principal stress from its target.

    Of the stress that the packing says it was made for.
    """
    target = note(packing.network, "stress")
    if not target > 0:
        return unknown("1", Caveat("no_stated_stress"))
    return Value(float(abs(np.diag(state.stress_tensor(packing.network)) / target - 1).max()), "1")
