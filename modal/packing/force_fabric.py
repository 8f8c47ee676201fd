"""Measure the anisotropy of contacts and forces, and the stress that follows from both.

L. Rothenburg and R. J. Bathurst, Geotechnique 39, 601 (1989), in three dimensions as by N. Guo and
J. Zhao, Comput. Geotech. 47, 1 (2013). With the unit normals n of m contacts, their normal forces f
and shear forces t, all to second order in n, the distribution of contacts and the mean forces vary
with direction as

    E(n) = (1 + n . a_c n) / (4 pi)
    f(n) = f_0 (1 + n . a_n n)
    t(n) = f_0 (a_t n - n (n . a_t n))

with three deviatoric tensors. For equal branches and small anisotropy the deviatoric stress divided
by the mean stress is 2/5 (a_c + a_n + 3/2 a_t): the stress-force-fabric identity.
"""

from typing import NamedTuple

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Floats


class ForceFabric(NamedTuple):
    """Tensors (3, 3) of the anisotropy of contacts, normal forces and shear forces.

    mean_force: f_0, N.
    """

    contacts: Floats
    normal_forces: Floats
    shear_forces: Floats
    mean_force: float

    @property
    def stress_ratio(self) -> Floats:
        """Deviatoric stress (3, 3) divided by mean stress, by the stress-force-fabric identity."""
        total: Floats = self.contacts + self.normal_forces + 1.5 * self.shear_forces
        return 0.4 * total


def force_fabric(network: Network) -> ForceFabric:
    """Return the anisotropy of the contacts between spheres and of their forces.

    UnavailableError if forces are absent.
    """
    pair = ~network.with_wall
    purpose = "anisotropy of forces"
    normal_force = network.require("force_normal", purpose)[pair]
    # The shear force on i; that on j, which the normal points to, is opposite.
    shear = -network.require("force_tangential", purpose)[pair]
    return fabric_of_forces(network.normal[pair], normal_force, shear)


def fabric_of_forces(normal: Floats, normal_force: Floats, shear: Floats) -> ForceFabric:
    """Return the anisotropy of contacts with normals (m, 3), and forces (m,) and (m, 3), N.

    Forces act on the body to which the normal points; compression is positive.
    """
    count = max(len(normal), 1)
    contacts = 7.5 * _deviator(normal.T @ normal / count)
    # Directions with more contacts do not count more than others.
    weight = 1 / (1 + np.einsum("ci,ij,cj->c", normal, contacts, normal)) / count
    of_normal = np.einsum("c,ci,cj->ij", weight * normal_force, normal, normal)
    of_shear = np.einsum("c,ci,cj->ij", weight, shear, normal)
    mean_force = float(np.trace(of_normal))
    return ForceFabric(
        contacts,
        7.5 * _deviator(of_normal) / mean_force,
        5.0 * _deviator((of_shear + of_shear.T) / 2) / mean_force,
        mean_force,
    )


def size_of(anisotropy: Floats) -> float:
    """Return sqrt(3/2 a : a) of a tensor (3, 3), with the sign of its component zz.

    For a tensor symmetric about z this is a_zz - a_xx; for a deviatoric stress divided by the mean
    stress it is q / p.
    """
    size = float(np.sqrt(1.5 * (anisotropy**2).sum()))
    return float(np.copysign(size, anisotropy[2, 2]))


def _deviator(tensor: Floats) -> Floats:
    """Return the deviator of a tensor (3, 3): the tensor minus the mean of its diagonal."""
    deviator: Floats = tensor - np.trace(tensor) / 3 * np.eye(3)
    return deviator
