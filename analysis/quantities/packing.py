"""What the packing is: densities, contacts, order, forces at rest."""

from __future__ import annotations

import numpy as np

from analysis.estimators.settled import residual_of
from analysis.measuring import Measuring
from analysis.quantities.registry import on_request, without_signal
from analysis.value import Value, unknown
from modal.packing.rattlers import force_bearing
from modal.packing.state import (
    contacts_per_particle,
    coordination_without_rattlers,
    fabric_tensor,
    profile,
    stress_tensor,
    void_ratio,
)
from modal.packing.summary import crystalline_shares


@without_signal("void_ratio", "1", "volume of voids over that of spheres, from wall to wall")
def of_voids(packing: Measuring) -> Value:
    """Exact for the packing."""
    return Value(void_ratio(packing.network), "1")


@without_signal(
    "coordination",
    "1",
    "contacts of a sphere, rattlers and contacts with walls included",
)
def coordination(packing: Measuring) -> Value:
    """Exact for the packing."""
    return Value(float(contacts_per_particle(packing.network).mean()), "1")


@without_signal("crystalline_share", "1", "share of spheres in crystalline surroundings")
def crystalline_share(packing: Measuring) -> Value:
    """Of all spheres; a random packing has few."""
    network = packing.network
    shares = crystalline_shares(network, profile(network))
    if "crystalline_share" not in shares:
        equal = np.ptp(network.radius) <= 1e-9 * network.radius.mean()
        why = "the cell has no periods along x and y" if equal else "spheres are not equal"
        return unknown("1", f"{why}: order is not told")
    return Value(shares["crystalline_share"], "1")


@on_request("void_ratio_of_bulk", "1", "void ratio away from the walls")
def of_voids_in_bulk(packing: Measuring) -> Value:
    """Mean over the layers that no wall orders."""
    layers = profile(packing.network)
    if not layers.bulk.any():
        return unknown("1", "too short: no layer is far from both walls")
    return Value(float(1 / (1 / (1 + layers.void_ratio[layers.bulk])).mean() - 1), "1")


@on_request(
    "coordination_of_bearing",
    "1",
    "contacts among force-bearing spheres, of one",
)
def coordination_of_bearing(packing: Measuring) -> Value:
    """Without rattlers and without contacts with them."""
    return Value(coordination_without_rattlers(packing.network)[0], "1")


@on_request("rattlers", "1", "share of spheres that bear no force")
def rattlers(packing: Measuring) -> Value:
    """Exact for the packing."""
    return Value(float(1 - force_bearing(packing.network).mean()), "1")


@on_request(
    "fabric_zz",
    "1",
    "mean n_z^2 of contact normals; 1/3 where none is preferred",
)
def fabric_zz(packing: Measuring) -> Value:
    """Exact for the packing."""
    return Value(float(fabric_tensor(packing.network)[2, 2]), "1")


def _forces(packing: Measuring, purpose: str) -> np.ndarray:
    """Normal forces (m,), N, between spheres."""
    network = packing.network
    return np.asarray(network.require("force_normal", purpose)[~network.with_wall])


@on_request("force_squared", "1", "mean squared normal force over squared mean")
def force_squared(packing: Measuring) -> Value:
    """Between spheres."""
    force = _forces(packing, "distribution of forces")
    return Value(float((force**2).mean() / force.mean() ** 2), "1")


@on_request("weak_forces", "1", "share of normal forces below half the mean")
def weak_forces(packing: Measuring) -> Value:
    """Between spheres."""
    force = _forces(packing, "distribution of forces")
    return Value(float((force < 0.5 * force.mean()).mean()), "1")


@on_request(
    "residual",
    "1",
    "mean net force of a sphere over mean contact force",
)
def residual(packing: Measuring) -> Value:
    """How far from equilibrium the packing is."""
    return Value(residual_of(packing.network), "1")


@on_request(
    "stress_error",
    "1",
    "largest deviation of a principal stress from its target",
)
def stress_error(packing: Measuring) -> Value:
    """Of the stress that the packing says it was made for."""
    target = float(packing.network.study.get("stress", np.nan))
    if not target > 0:
        return unknown("1", "the packing does not say for which stress it was made")
    return Value(float(abs(np.diag(stress_tensor(packing.network)) / target - 1).max()), "1")
