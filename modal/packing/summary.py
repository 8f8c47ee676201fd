"""A packing in plain numbers by name: what `modal.packing.state` measures."""

from contextlib import suppress
from typing import Any

import numpy as np

from modal.packing import state
from modal.packing.network import Network
from modal.packing.occupied import occupied_part
from modal.packing.order import crystalline
from modal.tools.errors import InputError


def summary(network: Network, friction: float | None = None) -> dict[str, Any]:
    """Stresses, densities, coordination, fabric and order of a packing as plain numbers by name.

    For the `study` attributes and the command line. With the `friction` coefficient of the contacts
    also the largest share of it that a contact uses. Deviations along z are standard deviations
    over the layers of the bulk, relative to their mean. Numbers that need forces are left out where
    forces are absent, and those that need a volume where the cell has none.
    """
    bearing, rattlers = state.coordination_without_rattlers(network)
    result = {
        "coordination_number": network.coordination_number,
        "coordination_number_without_rattlers": bearing,
        "rattlers": rattlers,
        "fabric_diagonal": np.diag(state.fabric_tensor(network)).tolist(),
    }
    if network.sliding is not None:
        result["sliding_contacts"] = int(network.sliding.sum())
    # A contact without friction, or one that pulls, has no limit that its shear could share in.
    force = network.force_normal if state.has_forces(network) else None
    if friction and network.n_contacts > 0 and force is not None and force.min() > 0:
        result["largest_share_of_friction"] = float(state.friction_used(network, friction).max())
    with suppress(InputError):
        result |= _of_volume(network)
    return result


def _of_volume(network: Network) -> dict[str, Any]:
    """Void ratio, stresses, and how the bulk differs along z; InputError without a volume."""
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
    if network.force_normal is not None and not network.cell_periodic[2] and not sides_are_free:
        result["wall_stress_pa"] = state.wall_stress(network).tolist()
    return result | _along_z(network)


def crystalline_shares(network: Network) -> dict[str, float]:
    """The share of crystalline spheres, of all and of the bulk if there is one.

    Empty but for equal spheres in a cell with periods along x and y.
    """
    periodic = bool(network.cell_periodic[0] and network.cell_periodic[1])
    if not periodic or np.ptp(network.radius) > 1e-9 * network.radius.mean():
        return {}
    ordered, (edges, bulk) = crystalline(network), state.layer_edges(network)
    shares = {"crystalline_share": float(ordered.mean())}
    if bulk.any():
        z, inner = network.position[:, 2], np.flatnonzero(bulk)
        inside = (z >= edges[inner[0]]) & (z < edges[inner[-1] + 1])
        if inside.any():
            shares["crystalline_share_of_bulk"] = float(ordered[inside].mean())
    return shares


def _along_z(network: Network) -> dict[str, Any]:
    """The share of crystalline spheres, and how the bulk differs along z."""
    layers = state.profile(network)
    result: dict[str, Any] = dict(crystalline_shares(network))
    occupied = occupied_part(network)
    if occupied and occupied.free[:2].any():
        return result  # layers of a heap are as wide as it is at each height
    if layers.bulk.any():
        density = 1 / (1 + layers.void_ratio[layers.bulk])
        weight, ends = layers.particles[layers.bulk], layers.coordination[layers.bulk]
        result["coordination_number_of_bulk"] = float(ends @ weight / max(weight.sum(), 1))
        with np.errstate(divide="ignore", invalid="ignore"):  # a bulk without spheres or contacts
            result["void_ratio_of_bulk"] = float(1 / density.mean() - 1)
            result["solid_fraction_deviation_along_z"] = float(density.std() / density.mean())
            result["coordination_number_deviation_along_z"] = float(ends.std() / ends.mean())
        if layers.stress is not None:
            along = layers.stress[layers.bulk]
            scale = np.maximum(abs(along.mean(axis=0)), np.finfo(float).tiny)
            result["stress_deviation_along_z"] = (along.std(axis=0) / scale).tolist()
    return {name: value for name, value in result.items() if np.isfinite(value).all()}
