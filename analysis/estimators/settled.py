"""Whether a state counts as settled: measured from its contact forces, whatever it is called.

Stresses may be off by what a preparation allows, net forces by twice that: of a state that was
reached these are just below its limit, and a little more where forces are made from positions. A
state that ran out of patience before is marked wherever one of its numbers is shown.
"""

import numpy as np

from modal.packing.network import Network
from modal.packing.plausibility import BALANCED
from modal.packing.state import has_forces, residual_forces, stress_tensor, wall_stress
from modal.preparation.protocol import SETTLED

MARK = "not settled"


def why_unsettled(network: Network, stress: float = np.nan) -> str:
    """What of a packing's state is beyond `SETTLED`; empty if nothing is, or without forces.

    `stress` is the target of its three stresses, Pa; NaN where it has none or only an axial one, as
    a crystal has. Where anything is beyond, it also says how far the pressures of walls are off.
    """
    if network.n_contacts == 0 or not has_forces(network):
        return ""
    most_off, _ = SETTLED
    residual = residual_forces(network).mean()
    off = float(abs(np.diag(stress_tensor(network)) / stress - 1).max())
    found = []
    if residual > BALANCED:
        found.append(f"residual {residual:.1e} over {BALANCED:g}")
    if off > most_off:
        found.append(f"stress {100 * off:.2f} % off, over {100 * most_off:g} %")
    if found and np.isfinite(stress) and not network.cell_periodic[2]:
        walls = 100 * (wall_stress(network) / stress - 1)
        found.append("walls " + ", ".join(f"{value:+.1f} %" for value in walls))
    return "; ".join(found)
