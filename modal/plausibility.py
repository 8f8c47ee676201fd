"""What a reader should look at before believing a network: no check can tell it for him.

Nothing here is refused. Laws of contact that this project does not know are sound, packings under
gravity are not in balance without it, and bodies of several densities exist; but a permuted column
of stiffnesses, or a mass in another unit, shows in these numbers and nowhere else.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.consistency import density_of, force_ratio
from modal.equilibrium import net_forces
from modal.network import Network

LAWS = {"Hertz": 2 / 3, "linear": 1.0}
"""Force over stiffness times overlap."""
LAW_TOLERANCE = 1e-2
"""Relative, of nine contacts in ten: forces and overlaps of 4 digits still tell the law."""


def plausibility(network: Network) -> dict[str, Any]:
    """Absent data, contacts that pull, law, balance, densities: plain numbers, spreads as lists.

    Spreads are the least, the median and the largest. Numbers whose data are absent are left out;
    with shear forces absent there is no balance to look at.
    """
    told: dict[str, Any] = {
        "absent": network.absent,
        "density_kg_per_m3": _spread(density_of(network)),
    }
    if network.n_contacts == 0:
        return told
    stiff = network.stiffness_normal > 0
    if stiff.any():
        ratio = network.stiffness_tangential[stiff] / network.stiffness_normal[stiff]
        told["tangential_over_normal_stiffness"] = _spread(ratio)
    if network.force_normal is not None:
        told["pulling_contacts"] = int((network.force_normal < 0).sum())
    ratio = force_ratio(network)
    if len(ratio):
        told["force_over_stiffness_times_overlap"] = _spread(ratio)
        told["law"] = _law(ratio)
    if network.force_normal is not None and network.force_tangential is not None:
        mean = float(np.hypot(network.force_normal, _size(network.force_tangential)).mean())
        if mean > 0:
            net = _size(net_forces(network)[:, :3]).mean()
            told["net_force_over_contact_force"] = float(net / mean)
    return told


def _law(ratio: np.ndarray) -> str:
    low, high = np.percentile(ratio, [5, 95])
    for law, wanted in LAWS.items():
        if wanted * (1 - LAW_TOLERANCE) < low and high < wanted * (1 + LAW_TOLERANCE):
            return law
    return "none that is known; check stiffnesses, forces and overlaps"


def _size(vector: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vector, axis=1)


def _spread(values: np.ndarray) -> list[float]:
    return [float(values.min()), float(np.median(values)), float(values.max())]
