"""Viscous contacts: a dashpot beside each spring.

A contact that parts at the velocity v resists with cn along its normal and ct across it, each a
share of what would damp two free spheres critically: c = 2 beta sqrt(k m*), m* = m_i m_j / (m_i +
m_j), at a wall the sphere's own mass. These are the coefficients of DEM codes (Y. Tsuji, T. Tanaka
and T. Ishida, Powder Technology 71, 239, 1992; in YADE betan and betas).
"""

from dataclasses import dataclass

import numpy as np

from modal.packing.network import Network
from modal.tools.arguments import refuse_other_kinds
from modal.tools.errors import InputError

LARGEST = 1e4
"""Of the ratios: an overdamped contact creeps and stops at rates four times its square apart, which
arithmetic still holds side by side."""


@dataclass(frozen=True)
class ContactDamping:
    """Damping ratios of contacts: a dashpot beside each spring.

    Parameters
    ----------
    normal, tangential : float
        Along the normal and across it, in parts of the critical damping; 0 for none.

    Raises
    ------
    InputError
        For a ratio that is negative or above what any contact has.

    Examples
    --------
    >>> ContactDamping(0.02, 0.02)
    ContactDamping(normal=0.02, tangential=0.02)
    """

    normal: float
    tangential: float

    def __post_init__(self) -> None:
        refuse_other_kinds(ContactDamping, "ContactDamping", vars(self))
        for name, value in vars(self).items():
            if not 0 <= value <= LARGEST:
                raise InputError(
                    "input",
                    f"{name} damping {value:g}",
                    "a contact takes energy, it gives none",
                    f"give a ratio from 0 to {LARGEST:g}, in parts of the critical damping",
                )

    @property
    def none(self) -> bool:
        """Whether the contacts are elastic."""
        return self.normal == 0 and self.tangential == 0

    def dashpots(self, network: Network) -> Network:
        """The network with coefficients of dashpots, N s/m, in the place of its springs.

        The matrix C of the viscous forces is then made as K is.
        """
        m_i, m_j = network.mass[network.particle_i], network.mass[network.partner]
        mass = np.where(network.with_wall, m_i, m_i * m_j / (m_i + m_j))
        return network.unchecked(
            stiffness_normal=2 * self.normal * np.sqrt(network.stiffness_normal * mass),
            stiffness_tangential=2 * self.tangential * np.sqrt(network.stiffness_tangential * mass),
            stiffness_rolling=None,
            stiffness_twisting=None,
        )
