"""Describe viscous contacts: a dashpot in parallel with each spring.

A contact whose ends separate at the velocity v resists with cn v along its normal and ct v across
it. Each coefficient is a share beta of the critical damping of two free spheres: c = 2 beta sqrt(k
m*), m* = m_i m_j / (m_i + m_j); at a wall m* is the mass of the sphere. These are the coefficients
of DEM codes (Y. Tsuji, T. Tanaka and T. Ishida, Powder Technology 71, 239, 1992; in YADE betan and
betas).
"""

from dataclasses import dataclass

import numpy as np

from modal.packing.network import Network
from modal.tools.arguments import refuse_other_kinds
from modal.tools.errors import InputError

MAX_DAMPING_RATIO = 1e4
"""Largest damping ratio. An overdamped contact creeps and stops at two rates whose quotient is four
times the square of its ratio. Double precision still holds both rates side by side up to this
ratio."""


@dataclass(frozen=True)
class ContactDamping:
    """Damping ratios of contacts with a dashpot in parallel with each spring.

    Parameters
    ----------
    normal, tangential : float
        Damping along the normal and across it, divided by the critical damping; 0 for none.

    Raises
    ------
    InputError
        If a ratio is negative or above `MAX_DAMPING_RATIO`.

    Examples
    --------
    >>> ContactDamping(0.02, 0.02)
    ContactDamping(normal=0.02, tangential=0.02)
    """

    normal: float
    tangential: float

    def __post_init__(self) -> None:
        refuse_other_kinds(ContactDamping, "ContactDamping", vars(self))
        for name, ratio in vars(self).items():
            if not 0 <= ratio <= MAX_DAMPING_RATIO:
                raise InputError(
                    "damping_ratio",
                    f"{name} damping {ratio:g}",
                    "a contact takes energy, it gives none",
                    f"give a ratio from 0 to {MAX_DAMPING_RATIO:g}, in parts of the critical "
                    "damping",
                )

    @property
    def none(self) -> bool:
        """Tell whether the contacts are elastic."""
        return self.normal == 0 and self.tangential == 0

    def dashpots(self, network: Network) -> Network:
        """Return the network with coefficients of dashpots, N s/m, instead of its springs.

        Its stiffness matrix is the matrix C of the viscous forces.
        """
        m_i = network.mass[network.particle_i]
        m_j = network.mass[network.partner]
        mass = np.where(network.with_wall, m_i, m_i * m_j / (m_i + m_j))
        if network.fixed is not None:
            # A held body is as heavy as a wall; where both ends are held, nothing moves.
            held = network.held
            mass = np.where(held[network.partner] & ~network.with_wall, m_i, mass)
            mass = np.where(held[network.particle_i], m_j, mass)
        return network.unchecked(
            stiffness_normal=2 * self.normal * np.sqrt(network.stiffness_normal * mass),
            stiffness_tangential=2 * self.tangential * np.sqrt(network.stiffness_tangential * mass),
            stiffness_rolling=None,
            stiffness_twisting=None,
        )
