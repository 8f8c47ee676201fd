"""Provide a page with modes: shapes of all spheres, and means over layers.

Keys are those that `packing.js` and `player.js` read.
"""

from typing import Any

import numpy as np

from analysis.watch.coding import code_displacements, round_numbers
from analysis.watch.shown_wave import MAX_MOTION_BYTES
from modal.modes.mode_set import ModeSet
from modal.packing.layers import Layers
from modal.packing.network import Network
from modal.tools.errors import InputError

BYTES_A_SPHERE = 6
"""Bytes of a sphere in one mode: a page shows three components."""


def describe_modes(
    network: Network, modes: ModeSet, moved: np.ndarray, numbers: list[int]
) -> dict[str, Any]:
    """Return the shapes of modes by number from 1; `moved` has the motions of all modes.

    Raises InputError for more modes than a page can hold.
    """
    max_modes = max(1, MAX_MOTION_BYTES // (BYTES_A_SPHERE * network.n_particles))
    if len(numbers) > max_modes:
        raise InputError(
            "too_many_modes",
            f"{len(numbers)} modes of {network.n_particles} spheres make too large a page",
            remedy=f"choose up to {max_modes} with --modes",
        )
    index = np.array(numbers) - 1
    shapes = moved[index][:, :, :3]
    largest = np.linalg.norm(shapes, axis=2).max(axis=1)
    largest = np.maximum(largest, np.finfo(float).tiny)
    main_axis = (shapes**2).sum(axis=1).argmax(axis=1)
    layers = Layers(network)
    shown_modes = []
    for k, number in enumerate(numbers):
        axis = main_axis[k]
        frequency = modes.frequency[index[k]]
        shown_modes.append(
            {
                "name": f"{number}: {frequency / 1e3:.6g} kHz",
                "frequency": float(frequency) / 1e3,
                "chi_z": float(modes.chi_z[index[k]]),
                "along": "xyz"[axis],
                "layers": round_numbers(layers.means(shapes[k][:, axis]) / largest[k]),
            }
        )
    completeness = "complete" if modes.certified else "not complete"
    return {
        "kind": "modes",
        "contrast": 0.0,
        "told": (
            f"{network.n_particles:,} spheres; {len(index)} of {len(modes.frequency)} modes, "
            f"{completeness} by an exact count. Amplitudes are arbitrary."
        ),
        "displacement": code_displacements(shapes / largest[:, None, None], 1.0),
        "layer_z": round_numbers(1e3 * layers.position),
        "modes": shown_modes,
    }
