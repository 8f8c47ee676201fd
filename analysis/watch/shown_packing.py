"""Provide a page with the packing: spheres, contacts, the box, and forces.

Keys are those that `packing.js` and `player.js` read.
"""

from typing import Any

import numpy as np

from analysis.watch.coding import STEPS, code_numbers, code_shades
from modal.exchange.picture import MAX_SHOWN_DISPLACEMENT_IN_RADII, sphere_stress
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.tools.display import quantity

POSITION_STEPS = 65535
"""Number of steps of a position from the lowest to the highest: 16 bits."""


def describe_packing(network: Network) -> dict[str, Any]:
    """Return positions and radii of the spheres, the box, contacts and forces on spheres."""
    lowest = network.position.min(axis=0)
    extent = np.maximum(np.ptp(network.position, axis=0), network.radius.max())
    step = extent / POSITION_STEPS
    mean_radius = float(network.radius.mean())
    shown: dict[str, Any] = {
        "spheres": network.n_particles,
        "origin": lowest.tolist(),
        "step": step.tolist(),
        "position": code_numbers(np.round((network.position - lowest) / step), "<u2"),
        "radius": code_numbers(network.radius, "<f4"),
        "mean_radius": mean_radius,
        "visible": MAX_SHOWN_DISPLACEMENT_IN_RADII * mean_radius,
        "cell": _describe_cell(network),
        "walls": _list_walls(network),
    }
    if network.force_normal is None:
        return shown
    shown["contacts"] = _describe_contacts(network, network.force_normal)
    if network.force_tangential is not None:
        pressure = sphere_stress(network)[:, :3].mean(axis=1)
        shown["pressure"], top = code_shades(pressure)
        shown["pressure_ends"] = ["0", quantity(top, "Pa", 3)]
    return shown


def _list_walls(network: Network) -> list[float | None]:
    """Return the height, m, of the lower and the upper wall; None for an absent wall."""
    heights: list[float | None] = []
    walls = (SOURCE_WALL, RECEIVER_WALL)
    for height, wall in zip(network.wall_position, walls, strict=True):
        has_contacts = (network.particle_j == wall).any()
        heights.append(float(height) if has_contacts else None)
    return heights


def _describe_cell(network: Network) -> dict[str, list[float]]:
    """Return two corners of the box of the packing: walls, periods, or outermost spheres."""
    radius = network.radius[:, None]
    low = (network.position - radius).min(axis=0)
    high = (network.position + radius).max(axis=0)
    middle = (low + high) / 2
    low = np.where(network.cell_periodic, middle - network.cell_size / 2, low)
    high = np.where(network.cell_periodic, middle + network.cell_size / 2, high)
    low[2], high[2] = network.wall_position
    return {"low": low.tolist(), "high": high.tolist()}


def _describe_contacts(network: Network, force: np.ndarray) -> dict[str, Any]:
    """Return contacts from sphere to sphere, or to a wall (-1), and their normal forces (m,), N."""
    step = float(abs(network.branch).max(initial=0.0)) / STEPS or 1.0
    return {
        "first": code_numbers(network.particle_i, "<i4"),
        "second": code_numbers(np.maximum(network.particle_j, -1), "<i4"),
        "across": code_numbers(np.round(network.branch / step), "<i2"),
        "step": step,
        "force": code_shades(force)[0],
    }
