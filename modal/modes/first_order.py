"""Perturb modes to first order: small changes of the springs, or small damping.

A mass-normalised mode phi of K phi = omega^2 M phi moves by d(omega^2) = phi . dK phi if dK is
added to K, and decays at the rate phi . C phi / 2 with dashpots. The terms that are left out are of
second order, except between modes that are nearer to each other than their shifts: modes of equal
frequency may be mixed otherwise than dK would mix them, but the sum of their shifts is right. The
contact law of another program has a tangent that is not symmetric, which Lanczos' method does not
take; the modes here are those of the springs, whose left and right eigenvectors are equal.
"""

import numpy as np

from modal.modes.mode_set import ModeSet
from modal.packing.network import Network
from modal.system.damping import ContactDamping
from modal.system.operator import ContactOperator
from modal.tools.arrays import Floats


def shift_by_law(network: Network, modes: ModeSet) -> Floats | None:
    """Compute what the law of an imported packing adds to the frequencies of its springs.

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
    """Compute the decay rates of elastic modes whose shapes the damping does not change.

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
    """Return phi . K phi of each mode shape, (k,)."""
    phi = np.ascontiguousarray(modes.shapes().reshape(len(modes.frequency), -1).T)
    return np.einsum("ik,ik->k", phi, operator.apply(phi))
