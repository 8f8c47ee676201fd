"""What a reader should look at before believing a network, where no check can refuse.

Nothing here is refused. Laws of contact that this project does not know are sound, packings under
gravity are not in balance without it, and bodies of several densities exist; but a permuted column
of stiffnesses, or a mass in another unit, shows in these numbers and nowhere else.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.packing.checks import density_of, force_ratio
from modal.packing.neighbours import touching
from modal.packing.network import Network
from modal.packing.state import net_forces, profile
from modal.packing.summary import crystalline_shares
from modal.tools.arrays import Floats

LAWS = {"Hertz": 2 / 3, "linear": 1.0}
"""Force over stiffness times overlap."""
LAW_TOLERANCE = 1e-2
"""Relative, of nine contacts in ten: forces and overlaps of 4 digits still tell the law."""
OUTLIER = 0.1
"""Relative deviation from the law from which a single contact is remarked on."""
UNIFORM = 1e-2
"""Relative spread up to which densities, or ratios of stiffnesses, count as one."""
BALANCE = 0.05
"""Largest net over mean contact force: 1e-8 to 1e-6 at rest, with permuted forces 1 or more."""
SETTLED = 2e-3
"""Mean net over mean contact force: twice what a compression leaves that has settled."""
CRYSTALLINE, CRYSTAL = 0.05, 0.99
"""Share of the bulk from which order is remarked on, and of all that a lattice has."""
MANY = 200_000
"""Spheres up to which a packing is looked through for order, which takes 10 s of a million."""
WIDE, LONG = 8.0, 50.0
"""Diameters: periods from which a packing hardly feels its own images (of friction 0.4 the
coordination number is then 0.05 off), and lengths from which a wave has a plateau to be read."""
TOUCH = 0.1
"""Of the mean overlap: what two descriptions of it may differ by."""
SIMILAR = 5.0
"""Ratio of radii up to which overlapping pairs are sought among all neighbours."""
SOLIDS = (100.0, 25_000.0)
"""kg/m^3, of a median sphere: foam to osmium."""


def plausibility(network: Network, *, sought: bool = False, waves: bool = False) -> dict[str, Any]:
    """Numbers that show whether a network is plausible, and remarks on what is unusual.

    The numbers: which data are absent, how many contacts pull, the contact law, the balance of
    forces, the densities. A list of three numbers holds the least, the median and the largest
    value. Numbers whose data are absent are left out; the balance needs shear forces. `remarks` is
    a list of texts, one for each unusual observation. `sought` says that the contacts were sought
    among the positions just now, as those of a sample are: then they are not sought once more;
    `waves` that waves will be read along z.
    """
    density = density_of(network)
    told: dict[str, Any] = {"absent": network.absent, "density_kg_per_m3": _spread(density)}
    remarks = of_densities(density) + of_shape(network, waves)
    if network.n_contacts:
        if not sought and network.inertia_tensor is None:
            _touching(network, remarks)
        _stiffnesses(network, told, remarks)
        _forces(network, told, remarks)
    return told | {"remarks": remarks}


def of_densities(density: Floats) -> list[str]:
    """Remarks on densities (n,), kg/m^3, that are those of no solid, or of several."""
    remarks = []
    if not SOLIDS[0] < np.median(density) < SOLIDS[1]:
        remarks.append(
            f"density of no solid, {np.median(density):.4g} kg/m^3: mass in kg, radius in m?"
        )
    if np.ptp(density) > UNIFORM * density.min():
        remarks.append(f"densities from {density.min():.4g} to {density.max():.4g} kg/m^3")
    return remarks


def of_shape(network: Network, waves: bool = False) -> list[str]:
    """Remarks on crystalline order, and on a cell that is too narrow, or for `waves` too short.

    A lattice, all of whose contacts are alike, may be of any width: its periods are its own.
    """
    remarks, diameter = [], 2 * float(network.radius.mean())
    share, lattice = 0.0, False
    if network.length > 0 and network.cell_size[:2].all():
        shares, whole = {}, 1.0  # of many spheres alike springs alone tell a lattice
        if network.n_particles <= MANY:
            shares = crystalline_shares(network, profile(network))
            whole = shares.get("crystalline_share", 0.0)
        springs = network.stiffness_normal[~network.with_wall]
        share = shares.get("crystalline_share_of_bulk", whole if shares else 0.0)
        alike = springs.size > 0 and springs.std() <= UNIFORM * springs.mean()
        lattice = whole > CRYSTAL and bool(alike)
    if share > CRYSTALLINE and not lattice:
        remarks.append(
            f"crystalline share of the bulk {100 * share:.0f} %: of a random packing it is below "
            f"{100 * CRYSTALLINE:.0f} %; take a wider cell, more spheres or another seed"
        )
    width = float(network.cell_size[network.cell_periodic].min(initial=np.inf)) / diameter
    if width < WIDE and not lattice:
        remarks.append(
            f"{width:.1f} diameters wide: below {WIDE:g} its own images order it; take more "
            "spheres or a smaller length over width"
        )
    length = network.length / diameter
    if waves and length < LONG and not network.cell_periodic[2]:
        remarks.append(
            f"{length:.1f} diameters long: below {LONG:g} a velocity or a low-pass frequency "
            "depends on where along the packing it is read; take more spheres"
        )
    return remarks


def _touching(network: Network, remarks: list[str]) -> None:
    """Compare overlaps, levers and the list of contacts with positions and radii."""
    i, j, pair = network.particle_i, network.partner, ~network.with_wall
    branch = network.branch
    reach = network.radius[i] + np.where(pair, network.radius[j], 0.0)
    overlap = reach - _size(branch)
    # Spheres that just touch have overlaps of the round-off of their positions.
    round_off = 8 * float(np.spacing(abs(network.position).max() + reach.max()))
    least = max(TOUCH * float(abs(overlap).mean()), round_off)
    if network.overlap is not None and abs(network.overlap - overlap).mean() > least:
        remarks.append("overlaps differ from those of positions and radii: too few digits?")
    missed = _size(network.lever_i - network.lever_j - branch)[pair]
    if pair.any() and missed.mean() > least:
        remarks.append("levers do not end in one point: are they as long as the radii?")
    missing = _overlapping(network, least) - int((overlap > least).sum())
    if missing > 0:
        remarks.append(f"{missing} places where spheres, or wall, overlap without a contact")


def _overlapping(network: Network, depth: float) -> int:
    """Number of places where spheres, or a sphere and a wall, overlap by more than `depth`, m.

    Only for cells that are periodic along x and y and not along z, and for radii whose largest is
    at most `SIMILAR` times the smallest; 0 for all others.
    """
    radius, position = network.radius, network.position.copy()
    periodic, side = network.cell_periodic, network.cell_size[:2]
    if radius.max() > SIMILAR * radius.min() or not (periodic[:2].all() and not periodic[2]):
        return 0
    position[:, :2] %= side
    found = touching(position, side, network.wall_position, radius)
    walls = network.length > 0
    return int(((found.overlap > depth) & (walls | (found.particle_j >= 0))).sum())


def _stiffnesses(network: Network, told: dict[str, Any], remarks: list[str]) -> None:
    """Ratio of stiffnesses, and the law that stiffness, force and overlap follow."""
    stiff = network.stiffness_normal > 0
    if stiff.any():
        ratio = network.stiffness_tangential[stiff] / network.stiffness_normal[stiff]
        told["tangential_over_normal_stiffness"] = _spread(ratio)
        if ratio.max() > 1 + UNIFORM:
            remarks.append("contacts stiffer across than along their normal")
        if np.ptp(ratio) > UNIFORM * ratio.max():
            remarks.append("tangential over normal stiffness differs among contacts")
    if not stiff.all():
        remarks.append(f"{int((~stiff).sum())} contacts without normal stiffness")
    ratio = force_ratio(network)
    if len(ratio):
        told["force_over_stiffness_times_overlap"] = _spread(ratio)
        law = told["law"] = _law(ratio)
        if law not in LAWS:
            remarks.append("stiffnesses, forces and overlaps follow no law that is known here")
        elif others := int((abs(ratio / LAWS[law] - 1) > OUTLIER).sum()):
            remarks.append(f"{others} contacts do not follow the law of the others")


def _forces(network: Network, told: dict[str, Any], remarks: list[str]) -> None:
    """Which contacts pull or slide, and whether the particles are in balance."""
    force, shear = network.force_normal, network.force_tangential
    if force is None:
        return
    pulling = told["pulling_contacts"] = int((force < 0).sum())
    if pulling:
        remarks.append(f"{pulling} contacts pull")
    if network.overlap is not None and (idle := int(((force == 0) & (network.overlap > 0)).sum())):
        remarks.append(f"{idle} contacts overlap without a force")
    if shear is None:
        return
    across = _size(shear)
    mean = float(np.hypot(force, across).mean())
    if mean > 0:
        net = _size(net_forces(network)[:, :3]) / mean
        told["net_force_over_contact_force"] = float(net.mean())
        told["largest_net_force_over_contact_force"] = float(net.max())
        if net.max() > BALANCE or net.mean() > SETTLED:
            remarks.append(
                "particles not in balance under their contacts: net forces are "
                f"{net.mean():.1e} of contact forces, the largest {net.max():.1e}; weight, or "
                "motion?"
            )
    if network.sliding is not None and network.sliding.any():
        _sliding(network, force, across, told, remarks)


def _sliding(
    network: Network, force: Floats, across: Floats, told: dict[str, Any], remarks: list[str]
) -> None:
    """What springs along sliding contacts mean, and whether shares of friction fit."""
    stiff, sliding = network.stiffness_normal > 0, np.asarray(network.sliding)
    ratio = network.stiffness_tangential[stiff] / network.stiffness_normal[stiff]
    if ratio.any():
        told["springs_of_sliding_contacts"] = (
            f"tangential too, {np.median(ratio):.3g} of the normal ones: modes, moduli and waves "
            "take a friction of the wave that holds these contacts, whatever that of the packing "
            "was; --sliding slip leaves these springs out"
        )
    share = across / np.where(force > 0, force, np.inf)
    most = share[sliding].max()
    if np.ptp(share[sliding]) > UNIFORM * most or share[~sliding].max(initial=0.0) > most:
        remarks.append("sliding contacts use unequal shares of friction, or less than others")


def _law(ratio: Floats) -> str:
    low, high = np.percentile(ratio, [5, 95])
    for law, wanted in LAWS.items():
        if wanted * (1 - LAW_TOLERANCE) < low and high < wanted * (1 + LAW_TOLERANCE):
            return law
    return "unknown"


def _size(vector: Floats) -> Floats:
    size: Floats = np.sqrt(np.einsum("ck,ck->c", vector, vector))
    return size


def _spread(values: Floats) -> list[float]:
    return [float(values.min()), float(np.median(values)), float(values.max())]
