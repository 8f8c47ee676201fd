"""Describe the state of a packing: its stress, its friction, whether it is at rest."""

import numpy as np

from analysis.caveats import Caveat
from analysis.same_state import note
from modal.packing import state
from modal.packing.missing_contacts import missing_contacts
from modal.packing.network import Network
from modal.packing.plausibility import MAX_MEAN_NET_FORCE
from modal.packing.shape_remarks import MIN_CRYSTALLINE_SHARE, remark_on_thirds
from modal.packing.summary import crystalline_shares
from modal.packing.weight import unbalanced_forces
from modal.preparation.protocol import SETTLED

MIN_SLIDING_SHARE = 0.01
"""Share of sliding contacts from which on a caveat is told. Without their tangential springs V_S of
2,000 grains is 4 to 28 % lower where 2 to 10 % slide."""


def target_stress(network: Network) -> float:
    """Return the target stress, Pa, that the network's notes state.

    Without this note it is the mean stress in the contacts, to three digits; NaN without contact
    forces.
    """
    target = note(network, "stress")
    if np.isfinite(target) or not state.has_forces(network):
        return target
    return float(f"{np.trace(state.stress_tensor(network)) / 3:.3g}")


def friction_of_compression(network: Network) -> float:
    """Return the friction of the compression, NaN if unknown.

    The friction of the wave is larger by 0.1 (Otsubo et al. 2017, section 2).
    """
    friction = note(network, "mu_comp")
    if np.isnan(friction):
        friction = note(network, "mu_wave") - 0.1
    return round(friction, 6)


def caveats_of_state(network: Network, unsettled: str) -> tuple[Caveat, ...]:
    """Return the caveats that apply to every quantity of one random packing.

    `unsettled` is the text of `why_unsettled`.
    """
    caveats = [Caveat("one_sample")]
    missing = missing_contacts(network)
    if any(missing):
        caveats.append(Caveat("contacts_missing", missing._asdict()))
    if unsettled:
        caveats.append(Caveat("unsettled", {"excess": unsettled}))
    shares = crystalline_shares(network)
    share = shares.get("crystalline_share_of_bulk", shares.get("crystalline_share", 0.0))
    if share > MIN_CRYSTALLINE_SHARE:
        caveats.append(Caveat("crystalline", {"share": share}))
    sliding = network.sliding
    if sliding is not None and np.mean(sliding) > MIN_SLIDING_SHARE:
        caveats.append(Caveat("sliding", {"share": float(np.mean(sliding))}))
    thirds = remark_on_thirds(network)
    if thirds.applies:
        caveats.append(Caveat("uneven", {"text": thirds.text, "excess": thirds.number}))
    return tuple(caveats)


def why_unsettled(network: Network, stress: float = np.nan) -> str:
    """Return which limits of a packing at rest are exceeded; empty if none, or without forces.

    Stresses may differ from their target by the tolerance of a preparation (`SETTLED`). Net forces
    may be twice as large as this tolerance: a preparation stops just below its limit, and forces
    that are computed from positions are a little larger. A state whose preparation stopped earlier
    is marked wherever one of its numbers is shown.

    Parameters
    ----------
    network : Network
        The packing.
    stress : float, Pa
        Target of the three principal stresses; NaN if there is none, or only an axial target, as
        for a crystal. If a limit is exceeded, the text includes the error of the walls' pressures.
    """
    if network.n_contacts == 0 or not state.has_forces(network):
        return ""
    if not stress > 0:
        stress = np.nan
    max_stress_error, _ = SETTLED
    residual = unbalanced_forces(network).mean()
    stress_error = float(abs(np.diag(state.stress_tensor(network)) / stress - 1).max())
    reasons = []
    if residual > MAX_MEAN_NET_FORCE:
        reasons.append(f"residual {residual:.1e} over {MAX_MEAN_NET_FORCE:g}")
    if stress_error > max_stress_error:
        percent = 100 * stress_error
        reasons.append(f"stress {percent:.2f} % off, over {100 * max_stress_error:g} %")
    if reasons and np.isfinite(stress) and not network.cell_periodic[2]:
        errors = 100 * (state.wall_stress(network) / stress - 1)
        reasons.append("walls " + ", ".join(f"{error:+.1f} %" for error in errors))
    return "; ".join(reasons)
