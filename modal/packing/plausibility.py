"""What a reader should look at before believing a network, where no check can refuse.

Nothing here is refused. Laws of contact that this project does not know are sound, packings under
gravity are not in balance without it, and bodies of several densities exist; but a permuted column
of stiffnesses, or a mass in another unit, shows in these numbers and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from modal.formats.arrays import Floats
from modal.packing.consistency import branches, density_of, force_ratio
from modal.packing.neighbours import periodic_pairs
from modal.packing.network import Network
from modal.packing.reading import is_sample, read_packing
from modal.packing.state import net_forces

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
TOUCH = 0.1
"""Of the mean overlap: what two descriptions of it may differ by."""
SIMILAR = 5.0
"""Ratio of radii up to which overlapping pairs are sought among all neighbours."""
SOLIDS = (100.0, 25_000.0)
"""kg/m^3, of a median sphere: foam to osmium."""


def plausibility(network: Network, *, sought: bool = False) -> dict[str, Any]:
    """Numbers that show whether a network is plausible, and remarks on what is unusual.

    The numbers: which data are absent, how many contacts pull, the contact law, the balance of
    forces, the densities. A list of three numbers holds the least, the median and the largest
    value. Numbers whose data are absent are left out; the balance needs shear forces. `remarks` is
    a list of texts, one for each unusual observation. `sought` says that the contacts were sought
    among the positions just now, as those of a sample are: then they are not sought once more.
    """
    density = density_of(network)
    told: dict[str, Any] = {"absent": network.absent, "density_kg_per_m3": _spread(density)}
    remarks = of_densities(density)
    if network.n_contacts:
        if not sought:
            _touching(network, remarks)
        told |= _stiffnesses(network, remarks) | _forces(network, remarks)
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


def read_remarked(path: str | Path, say: Callable[[str], None]) -> Network:
    """The packing of a file, as `modal.packing.reading.read_packing`; `say` is told each remark."""
    network = read_packing(path)
    for remark in plausibility(network, sought=is_sample(path))["remarks"]:
        say(f"{path}: {remark}")
    return network


def _touching(network: Network, remarks: list[str]) -> None:
    """Compare overlaps, levers and the list of contacts with positions and radii."""
    i, j, pair = network.particle_i, network.partner, ~network.with_wall
    branch = branches(network)
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
    periodic = network.cell_periodic
    if radius.max() > SIMILAR * radius.min() or not (periodic[:2].all() and not periodic[2]):
        return 0
    side = network.cell_size[:2]
    position[:, :2] %= side
    i, j, shift = periodic_pairs(position, side, 2 * float(radius.max()))
    branch = position[j] + shift * np.array([*side, 0.0]) - position[i]
    found = int((radius[i] + radius[j] - _size(branch) > depth).sum())
    if network.length > 0:
        low, high = network.wall_position
        found += int((radius - (position[:, 2] - low) > depth).sum())
        found += int((radius - (high - position[:, 2]) > depth).sum())
    return found


def _stiffnesses(network: Network, remarks: list[str]) -> dict[str, Any]:
    """Ratio of stiffnesses, and the law that stiffness, force and overlap follow."""
    told: dict[str, Any] = {}
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
    return told


def _forces(network: Network, remarks: list[str]) -> dict[str, Any]:
    """Which contacts pull or slide, and whether the particles are in balance."""
    told: dict[str, Any] = {}
    force, shear = network.force_normal, network.force_tangential
    if force is None:
        return told
    pulling = told["pulling_contacts"] = int((force < 0).sum())
    if pulling:
        remarks.append(f"{pulling} contacts pull")
    if network.overlap is not None and (idle := int(((force == 0) & (network.overlap > 0)).sum())):
        remarks.append(f"{idle} contacts overlap without a force")
    if shear is None:
        return told
    across = _size(shear)
    mean = float(np.hypot(force, across).mean())
    if mean > 0:
        net = _size(net_forces(network)[:, :3]) / mean
        told["net_force_over_contact_force"] = float(net.mean())
        told["largest_net_force_over_contact_force"] = float(net.max())
        if net.max() > BALANCE:
            remarks.append("particles not in balance under their contacts: weight, or motion?")
    if network.sliding is not None and network.sliding.any():
        share = across / np.where(force > 0, force, np.inf)
        sliding, others = share[network.sliding], share[~network.sliding]
        if np.ptp(sliding) > UNIFORM * sliding.max() or others.max(initial=0.0) > sliding.max():
            remarks.append("sliding contacts use unequal shares of friction, or less than others")
    return told


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
