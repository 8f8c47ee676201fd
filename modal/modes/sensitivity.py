"""Compute how each contact's stiffness changes the natural frequencies."""

import numpy as np

from modal.modes.mode_set import ModeSet
from modal.packing.network import Network
from modal.system.contacts import motion_of_contacts, slip
from modal.tools.arguments import checked
from modal.tools.arrays import Floats


@checked
def frequency_sensitivity(network: Network, modes: ModeSet) -> Floats:
    """Compute the derivatives of natural frequencies with respect to each contact's stiffnesses.

    A mode phi with phi . M phi = 1 stores in a contact the energy of its slip d along the normal n
    and across it, so that d(omega^2)/dkn = (n . d)^2 and d(omega^2)/dkt = |d|^2 - (n . d)^2. For
    modes of equal frequency only the sum of these values is a derivative.

    Parameters
    ----------
    network : Network
        The packing of n bodies and m contacts.
    modes : ModeSet
        k elastic modes with their shapes.

    Returns
    -------
    ndarray (k, m, 2)
        Change of each frequency, Hz, per N/m of kn and of kt.

    Raises
    ------
    InputError
        If the mode shapes were not kept, or belong to another packing.

    Examples -------- If all stiffnesses change by the same small share, each frequency changes by
    half of it: f is proportional to sqrt(k).

    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 8))
    >>> modes = modal.eigenmodes(crystal, lowest=2)
    >>> per_stiffness = frequency_sensitivity(crystal, modes)
    >>> of_normal = per_stiffness[:, :, 0] @ crystal.stiffness_normal
    >>> of_tangential = per_stiffness[:, :, 1] @ crystal.stiffness_tangential
    >>> bool(np.allclose(2 * (of_normal + of_tangential), modes.frequency))
    True
    """
    shapes = modes.shapes(network)
    to_slip = slip(network)
    derivative = np.empty((len(modes.frequency), network.n_contacts, 2))
    for k, shape in enumerate(shapes):
        gap = np.einsum("cij,cj->ci", to_slip, motion_of_contacts(network, shape))
        along = np.einsum("ci,ci->c", gap, network.normal)
        derivative[k, :, 0] = along**2
        derivative[k, :, 1] = (gap**2).sum(axis=1) - along**2
    return derivative / (8 * np.pi**2 * modes.frequency[:, None, None])
