"""What another program's law of contact does to the frequencies that its springs alone give.

Its tangent is not symmetric, which Lanczos needs; modes are those of the springs. To first order in
the difference of the two tangents a mode phi, mass-normalised, moves by d(omega^2) = phi . dK phi:
left and right vectors of the springs are the same. What is left out is of second order, and larger
only between modes nearer to each other than their shifts.
"""

from __future__ import annotations

import numpy as np

from modal.modes.mode_set import ModeSet
from modal.packing.network import Network
from modal.system.operator import ContactOperator
from modal.tools.arrays import Floats


def shift_by_law(network: Network, modes: ModeSet) -> Floats | None:
    """Shape (k,), Hz: what the law of an imported packing adds to the frequencies of its springs.

    None where the network does not know its law or its shear forces, or the modes have no shapes.
    """
    shapes = modes.mode_shape
    unknown = network.shear_growth is None or network.force_tangential is None
    if unknown or shapes is None or shapes.shape[1:] != (network.n_particles, 6):
        return None
    phi = np.ascontiguousarray(shapes.reshape(len(shapes), -1).T)
    change = ContactOperator(network, pre_stress="law").apply(phi)
    change -= ContactOperator(network).apply(phi)
    omega = 2 * np.pi * modes.frequency
    square = omega**2 + np.einsum("ik,ik->k", phi, change)
    shifted: Floats = np.sqrt(np.maximum(square, 0)) / (2 * np.pi)
    return shifted - modes.frequency
