"""Summarise a packing as plain numbers by name."""

from contextlib import suppress
from typing import Any

import numpy as np

from modal.packing import state
from modal.packing.grading import PERCENTILES, finer_diameters
from modal.packing.network import Network
from modal.packing.noted_laws import friction_bearing_force
from modal.packing.occupied import occupied_part
from modal.packing.order import crystalline
from modal.tools.errors import UnavailableError


def summary(network: Network, friction: float | None = None) -> dict[str, Any]:
    """Return stresses, densities, coordination, fabric and order of a packing by name.

    The numbers are used for the `study` attributes and by the command line. With `friction`, the
    coefficient of the contacts, they include the largest share of it that a contact uses.
    Deviations along z are standard deviations over the layers of the bulk, divided by their mean.
    Numbers that need forces are left out if forces are absent, and those that need a volume if the
    cell has none.
    """
    bearing, rattlers = state.coordination_without_rattlers(network)
    result = {
        "coordination_number": network.coordination_number,
        "coordination_number_without_rattlers": bearing,
        "rattlers": rattlers,
        "fabric_diagonal": np.diag(state.fabric_tensor(network)).tolist(),
    }
    diameter = 2 * network.radius
    if np.ptp(diameter) > 0:
        finer = finer_diameters(diameter, network.mass)
        for percent, size in zip(PERCENTILES, finer.tolist(), strict=True):
            result[f"d{percent}_m"] = size
    if network.sliding is not None:
        mobilised = state.mobilised_per_particle(network)
        result["sliding_contacts"] = int(network.sliding.sum())
        result["mobilised_contacts_per_particle"] = mobilised
        result["isostatic_coordination_number"] = state.isostatic_coordination(mobilised)
    # A contact without friction, or one that nothing presses together, has no friction limit.
    knows_limit = bool(friction) and network.n_contacts > 0 and state.has_forces(network)
    if friction and knows_limit and friction_bearing_force(network).min() > 0:
        result["largest_share_of_friction"] = float(state.friction_used(network, friction).max())
    with suppress(UnavailableError):
        result |= _summarise_volume(network)
    return result


def _summarise_volume(network: Network) -> dict[str, Any]:
    """Return void ratio, stresses and deviations along z; UnavailableError without a volume."""
    result: dict[str, Any] = {"void_ratio": state.void_ratio(network)}
    occupied = occupied_part(network)
    if occupied:
        result["void_ratio_error"] = occupied.void_ratio_error
        result["free_ends"] = occupied.free_names
    if state.has_forces(network):
        stress = state.stress_tensor(network)
        diagonal = np.diag(stress)
        result["stress_pa"] = diagonal.tolist()
        result["largest_off_diagonal_stress_pa"] = float(abs(stress - np.diag(diagonal)).max())
    sides_are_free = occupied is not None and bool(occupied.free[:2].any())
    is_rough = network.fixed is not None and not network.with_wall.any()
    has_walls = not network.cell_periodic[2] and not is_rough
    if network.force_normal is not None and has_walls and not sides_are_free:
        result["wall_stress_pa"] = state.wall_stress(network).tolist()
    return result | _summarise_layers(network)


def crystalline_shares(network: Network) -> dict[str, float]:
    """Return the share of crystalline spheres, of all and of the bulk if there is one.

    The result is empty unless all spheres are equal and the cell is rectangular and periodic along
    x and y.
    """
    periodic = bool(network.cell_periodic[0] and network.cell_periodic[1])
    if (
        not periodic
        or network.cell_vectors is not None
        or np.ptp(network.radius) > 1e-9 * network.radius.mean()
    ):
        return {}
    ordered = crystalline(network)
    edges, bulk = state.layer_edges(network)
    shares = {"crystalline_share": float(ordered.mean())}
    if bulk.any():
        z = network.position[:, 2]
        inner = np.flatnonzero(bulk)
        inside = (z >= edges[inner[0]]) & (z < edges[inner[-1] + 1])
        if inside.any():
            shares["crystalline_share_of_bulk"] = float(ordered[inside].mean())
    return shares


def _summarise_layers(network: Network) -> dict[str, Any]:
    """Return the share of crystalline spheres, and how the layers of the bulk differ."""
    layers = state.profile(network)
    result: dict[str, Any] = dict(crystalline_shares(network))
    occupied = occupied_part(network)
    if occupied and occupied.free[:2].any():
        return result  # layers of a heap are as wide as it is at each height
    if layers.bulk.any():
        density = 1 / (1 + layers.void_ratio[layers.bulk])
        particles = layers.particles[layers.bulk]
        coordination = layers.coordination[layers.bulk]
        mean_coordination = coordination @ particles / max(particles.sum(), 1)
        result["coordination_number_of_bulk"] = float(mean_coordination)
        with np.errstate(divide="ignore", invalid="ignore"):  # a bulk without spheres or contacts
            result["void_ratio_of_bulk"] = float(1 / density.mean() - 1)
            result["solid_fraction_deviation_along_z"] = float(density.std() / density.mean())
            relative_deviation = coordination.std() / coordination.mean()
            result["coordination_number_deviation_along_z"] = float(relative_deviation)
        if layers.stress is not None:
            stress = layers.stress[layers.bulk]
            scale = np.maximum(abs(stress.mean(axis=0)), np.finfo(float).tiny)
            result["stress_deviation_along_z"] = (stress.std(axis=0) / scale).tolist()
    return {name: value for name, value in result.items() if np.isfinite(value).all()}
