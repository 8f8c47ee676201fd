"""Compute how strongly each contact's stiffness affects the elastic moduli."""

from typing import NamedTuple

import numpy as np

from modal.elasticity.plane_waves import isotropic_means
from modal.elasticity.static_response import TOLERANCE, elastic_moduli
from modal.elasticity.strain import UNIT_STRAINS
from modal.packing.network import Network
from modal.packing.state import volume_between_walls
from modal.system.contacts import motion_of_contacts, slip
from modal.tools.arguments import checked
from modal.tools.arrays import Floats


class ModuliSensitivity(NamedTuple):
    """Derivatives of the moduli with respect to the stiffnesses of m contacts, 1/m.

    stiffness (m, 2, 6, 6): derivatives with respect to kn and kt of the stiffness tensor of the
    whole packing, walls included. bulk, shear (m, 2): those of the bulk and shear modulus of the
    nearest isotropic solid.
    """

    stiffness: Floats
    bulk: Floats
    shear: Floats


@checked
def moduli_sensitivity(network: Network, *, tolerance: float = TOLERANCE) -> ModuliSensitivity:
    """Compute the derivatives of the elastic moduli with respect to each contact's stiffnesses.

    In static equilibrium a small change of one stiffness changes the energy of a strain only by the
    energy in this spring; the motion of the spheres has no first-order effect: V dC_ab/dkn = (n .
    d_a)(n . d_b), with the slip d_a of the contact under strain a, non-affine motion included. The
    moduli are homogeneous in the stiffnesses: the sum of k dC/dk is C.

    Parameters
    ----------
    network : Network
        The packing, as `modal.elastic_moduli` takes it.
    tolerance : float, default 1e-6
        Relative error of the moduli; the derivatives have its square root as error.

    Returns
    -------
    ModuliSensitivity
        `stiffness` (m, 2, 6, 6), `bulk` and `shear` (m, 2), in Pa per N/m.

    Raises
    ------
    InputError
        If the packing has no moduli.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(2, 2, 4), periodic_z=True)
    >>> shear = moduli_sensitivity(crystal).shear
    >>> total = shear[:, 0] @ crystal.stiffness_normal + shear[:, 1] @ crystal.stiffness_tangential
    >>> bool(np.isclose(total, modal.elastic_moduli(crystal).shear_modulus))
    True
    """
    moduli = elastic_moduli(network, tolerance=tolerance, non_affine=True)
    assert moduli.non_affine is not None  # it was requested
    strained = UNIT_STRAINS.on(network)
    to_slip = slip(network)
    along = np.empty((network.n_contacts, 6))
    across = np.empty((network.n_contacts, 6, 3))
    for strain, beyond in enumerate(moduli.non_affine):
        motion = strained[strain] + motion_of_contacts(network, beyond)
        gap = np.einsum("cij,cj->ci", to_slip, motion)
        along[:, strain] = np.einsum("ci,ci->c", gap, network.normal)
        across[:, strain] = gap - along[:, strain, None] * network.normal
    stiffness = np.empty((network.n_contacts, 2, 6, 6))
    stiffness[:, 0] = along[:, :, None] * along[:, None, :]
    stiffness[:, 1] = np.einsum("cai,cbi->cab", across, across)
    stiffness /= volume_between_walls(network)
    bulk, shear = isotropic_means(stiffness)
    return ModuliSensitivity(stiffness, bulk, shear)
