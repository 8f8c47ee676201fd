"""Which networks are refused: numbers, indices and periods, then what they mean together."""

from __future__ import annotations

import numpy as np

from modal.formats.hdf5 import InputError
from modal.packing.consistency import check_consistency, refuse
from modal.packing.network import CONTACTS, PARTICLES, RECEIVER_WALL, Network


def validate(network: Network, name: str = "network") -> None:
    """Refuse a network that no packing can have; InputError names the first contact at fault.

    Shapes of numbers and indices here, what they mean together in `modal.packing.consistency`.
    """
    n = network.n_particles
    if n == 0:
        raise InputError(f"{name}: it has no particles; export a packing with at least one")
    for group, fields in (("particles", PARTICLES), ("contacts", CONTACTS)):
        for field_name, (kind, _, _) in fields.items():
            data = getattr(network, field_name)
            if kind == "f" and data is not None and not np.isfinite(data).all():
                row = int(np.argwhere(~np.isfinite(data))[0, 0])
                raise InputError(
                    f"{name}: {group}/{field_name} is not finite in row {row}; mend the export"
                )
    for field_name in ("radius", "mass", "inertia"):
        refuse(getattr(network, field_name) <= 0, name, "particle", f"has {field_name} <= 0")
    for field_name in ("stiffness_normal", "stiffness_tangential"):
        refuse(getattr(network, field_name) < 0, name, "contact", f"has negative {field_name}")
    i, j = network.particle_i, network.particle_j
    refuse((i < 0) | (i >= n), name, "contact", f"has particle_i outside 0 to {n - 1}")
    refuse((j < RECEIVER_WALL) | (j >= n), name, "contact", f"has particle_j outside -2 to {n - 1}")
    size = np.sqrt(np.einsum("ck,ck->c", network.normal, network.normal))
    refuse(abs(size - 1) > 1e-6, name, "contact", "has a normal that is not a unit vector")
    cell, axes = network.cell_size, network.cell_periodic
    if not (np.isfinite(cell).all() and (cell[axes] > 0).all() and (cell >= 0).all()):
        raise InputError(
            f"{name}: cell/size must be positive along the periodic axes, and 0 or the width of "
            "the packing along the others; mend the export"
        )
    if network.cell_shift is not None:
        own = (i == j) & ~network.cell_shift.any(axis=1)
        refuse(
            own,
            name,
            "contact",
            "joins a particle to itself without a period (cell_shift is zero)",
        )
        shifted = network.cell_shift.any(axis=0) & ~axes
        if shifted.any():
            axis = "xyz"[int(np.argmax(shifted))]
            raise InputError(
                f"{name}: cell_shift along {axis}, which is not periodic; mend the export"
            )
    check_consistency(network, name)
