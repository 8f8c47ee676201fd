"""What little changes of the springs, or little damping, do to modes: first order, phi . dK phi.

A mode phi, mass-normalised, of K phi = omega^2 M phi moves by d(omega^2) = phi . dK phi where dK is
added to K, and decays at phi . C phi / 2 where dashpots are. What is left out is of second order,
and larger only between modes nearer to each other than their shifts: of equal frequencies the modes
may be listed in another mixture than dK would have, but their sum is right. Another program's law
of contact has a tangent that is not symmetric, which Lanczos needs; modes are those of the springs,
whose left and right vectors are the same.
"""

import numpy as np

from modal.modes.mode_set import ModeSet
from modal.packing.network import Network
from modal.system.damping import ContactDamping
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
    square = (2 * np.pi * modes.frequency) ** 2
    square += _projected(modes, ContactOperator(network, pre_stress="law"))
    square -= _projected(modes, ContactOperator(network))
    shifted: Floats = np.sqrt(np.maximum(square, 0)) / (2 * np.pi)
    return shifted - modes.frequency


def decay_rates(modes: ModeSet, network: Network, damping: ContactDamping) -> Floats:
    """Shape (k,), 1/s: decay of the amplitude of elastic modes, for modes it does not mix.

    Parameters
    ----------
    modes : ModeSet
        k elastic modes with their shapes.
    network : Network
        The packing that they are of.
    damping : ContactDamping
        Ratios of the dashpots, normal and tangential.

    Returns
    -------
    ndarray (k,)
        1/s; half the rate at which energy is lost.

    Raises
    ------
    InputError
        Where the mode shapes were not kept, or are of another packing.

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
    return _projected(modes, ContactOperator(damping.dashpots(network))) / 2


def _projected(modes: ModeSet, operator: ContactOperator) -> Floats:
    """Shape (k,): phi . K phi of each mode shape."""
    phi = np.ascontiguousarray(modes.shapes().reshape(len(modes.frequency), -1).T)
    return np.einsum("ik,ik->k", phi, operator.apply(phi))
