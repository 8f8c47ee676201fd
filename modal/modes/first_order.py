"""Perturb modes to first order: small changes of the springs, or small damping.

A mass-normalised mode phi of K phi = omega^2 M phi moves by d(omega^2) = phi . dK phi if dK is
added to K, and decays at the rate phi . C phi / 2 with dashpots. The neglected terms are of second
order, except between modes that are nearer to each other than their shifts. The shifts of modes of
equal frequency may be wrong singly, because dK mixes these modes, but their sum is right. The
tangent of another program's contact law is not symmetric, so that Lanczos' method does not apply.
The modes here are those of the springs, whose left and right eigenvectors are equal.
"""

import numpy as np

from modal.modes.mode_set import ModeSet
from modal.packing.network import Network
from modal.system.damping import ContactDamping
from modal.system.operator import ContactOperator
from modal.tools.arrays import Floats


def shift_by_law(network: Network, modes: ModeSet) -> Floats | None:
    """Compute the shift of frequencies by the terms of an imported packing's law beyond springs.

    Returns the shifts (k,), Hz; None if the network does not know its law or its shear forces, or
    the modes have no shapes.
    """
    shapes = modes.mode_shape
    if network.shear_growth is None or network.force_tangential is None:
        return None
    if shapes is None or shapes.shape[1:] != (network.n_particles, 6):
        return None
    square = (2 * np.pi * modes.frequency) ** 2
    square += _project(modes, ContactOperator(network, pre_stress="law"))
    square -= _project(modes, ContactOperator(network))
    shifted: Floats = np.sqrt(np.maximum(square, 0)) / (2 * np.pi)
    return shifted - modes.frequency


def decay_rates(modes: ModeSet, network: Network, damping: ContactDamping) -> Floats:
    """Compute the decay rates of elastic modes, for damping too small to change their shapes.

    Parameters
    ----------
    modes : ModeSet
        k elastic modes with their shapes.
    network : Network
        The packing of these modes.
    damping : ContactDamping
        Ratios of the dashpots, normal and tangential.

    Returns
    -------
    ndarray (k,)
        Decay of the amplitude, 1/s; half the rate at which energy is lost.

    Raises
    ------
    InputError
        If the mode shapes were not kept, or belong to another packing.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 20))
    >>> modes = modal.eigenmodes(crystal, lowest=4)
    >>> rates = decay_rates(modes, crystal, modal.system.damping.ContactDamping(0.02, 0.02))
    >>> bool((rates > 0).all()), rates.shape
    (True, (4,))
    """
    modes.shapes(network)
    return _project(modes, ContactOperator(damping.dashpots(network))) / 2


def _project(modes: ModeSet, operator: ContactOperator) -> Floats:
    """Return phi . B phi, (k,), for each mode shape phi and the matrix B of an operator."""
    phi = np.ascontiguousarray(modes.shapes().reshape(len(modes.frequency), -1).T)
    return np.einsum("ik,ik->k", phi, operator.apply(phi))
