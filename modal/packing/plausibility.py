"""What a reader should look at before believing a network, where no check can refuse.

Nothing here is refused. Laws of contact that this project does not know are sound, packings under
gravity are not in balance without it, and bodies of several densities exist; but a permuted column
of stiffnesses, or a mass in another unit, shows in these numbers and nowhere else.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.linalg import norm

from modal.packing.checks import density_of, force_ratio, stiffness_ratio
from modal.packing.missing_contacts import (
    least_overlap,
    missing_contacts,
    overlaps_by_places,
)
from modal.packing.network import Network
from modal.packing.occupied import occupied_part
from modal.packing.precision import MAX_OVERLAP_ERROR_OF_MODES, overlap_error
from modal.packing.state import unevenness
from modal.packing.summary import crystalline_shares
from modal.packing.weight import gravity_of, unbalanced_forces
from modal.tools.arrays import Floats
from modal.tools.display import quantity

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
BALANCED = 2e-3
"""Mean net over mean contact force: twice what a compression leaves that has settled."""
CRYSTALLINE, CRYSTAL = 0.05, 0.99
"""Share of the bulk from which order is remarked on, and of all that a lattice has."""
MANY = 200_000
"""Spheres up to which a packing is looked through for order, which takes 10 s of a million."""
WIDE = 8.0
"""Diameters: periods from which a packing hardly feels its own images; of friction 0.4 the
coordination number is then 0.05 off."""
LONG_FOR_VELOCITY, LONG_FOR_LOW_PASS = 25.0, 50.0
"""Diameters of length. In packings of 16 to 25 the longest waves read up to 3 % too high, in longer
ones less than samples differ. At 0.4, 0.5 and 0.6 of the length, friction 0.4 shows low-pass
frequencies of 33, 20 and 16 kHz at 100 kPa where it is 41 long, 11.5, 10.3 and 9.4 where it is 87,
8.7, 8.1 and 7.6 where it is 143 as in the study."""
UNEVEN, TOLD = 0.1, 15.0
"""Part by which waves are faster in one third of the length than in another from which it is said,
0.05 at most in 23 random packings of 300 to 35,201 spheres, some of two sizes (3 D wide 0.09 in one
of three); and diameters of length below which the walls' order makes them differ."""
DEEP = 0.15
"""Overlap over the smaller radius from which it is said: sound packings show up to 0.11."""
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
    remarks = [*_of_digits(network), *_of_densities(density)]
    remarks += [*_of_free_ends(network), *_of_shape(network, waves)]
    if network.n_contacts:
        told |= {"missing_contacts": 0, "missing_wall_contacts": 0}
        if network.inertia_tensor is None:
            remarks += _of_depth(network)
            if not sought:
                remarks += _of_places(network, told)
        remarks += [*_of_stiffnesses(network, told), *_of_forces(network, told)]
    return told | {"remarks": [text for unusual, text in remarks if unusual]}


Remarks = Iterator[tuple[Any, str]]
"""One after the other: whether it is so, and what is said then."""


def _of_digits(network: Network) -> Remarks:
    """Overlaps that are known to few digits."""
    error = overlap_error(network)
    words = (
        f"overlaps are known to {error:.2g} of the median one by the digits of positions: "
        "velocities and moduli have an error for it, single modes are "
    )
    words += "not listed" if error > MAX_OVERLAP_ERROR_OF_MODES else "off by up to 2 %"
    yield error > 0, words


def _of_densities(density: Floats) -> Remarks:
    """Those of no solid, or of several."""
    low, median, high = _spread(density)
    no_solid = f"density of no solid, {median:.4g} kg/m^3: mass in kg, radius in m?"
    yield not is_of_a_solid(median), no_solid
    yield _differ(density), f"densities from {low:.4g} to {high:.4g} kg/m^3"


def is_of_a_solid(density: float) -> bool:
    """Return whether a solid has this density, kg/m^3: in grams and centimetres none has.

    >>> is_of_a_solid(2500.0), is_of_a_solid(2.5)
    (True, False)
    """
    return SOLIDS[0] < density < SOLIDS[1]


def median_density(network: Network) -> float:
    """Return the density of the median sphere, kg/m^3."""
    return float(np.median(density_of(network)))


def _of_shape(network: Network, waves: bool) -> Remarks:
    """Crystalline order, and a cell that is too narrow, or for `waves` too short.

    A lattice, all of whose contacts are alike, may be of any width: its periods are its own.
    """
    diameter, few = 2 * float(network.radius.mean()), network.n_particles <= MANY
    shares, lattice = {}, False
    if network.length > 0 and network.cell_size[:2].all():
        if few:  # of many spheres alike springs alone tell a lattice
            shares = crystalline_shares(network)
        springs = network.stiffness_normal[~network.with_wall]
        alike = springs.size > 0 and springs.std() <= UNIFORM * springs.mean()
        lattice = bool(alike) and shares.get("crystalline_share", 1.0 - few) > CRYSTAL
    share = shares.get("crystalline_share_of_bulk", shares.get("crystalline_share", 0.0))
    words = (
        f"crystalline share of the bulk {100 * share:.0f} %: of a random packing it is below "
        f"{100 * CRYSTALLINE:.0f} %; take a wider cell, more spheres or another seed"
    )
    yield share > CRYSTALLINE and not lattice, words
    width = float(network.cell_size[network.cell_periodic].min(initial=np.inf)) / diameter
    words = (
        f"{width:.1f} diameters wide: below {WIDE:g} spheres feel their own images; take "
        "more spheres or a smaller length over width"
    )
    yield width < WIDE and not lattice, words
    length = network.length / diameter
    walls = waves and not network.cell_periodic[2]
    words = (
        f"{length:.1f} diameters long: below {LONG_FOR_LOW_PASS:g} a low-pass frequency reads too "
        f"high, below {LONG_FOR_VELOCITY:g} a velocity too; take more spheres"
    )
    yield walls and length < LONG_FOR_LOW_PASS, words
    yield from differing_thirds(network)


def differing_thirds(network: Network) -> Remarks:
    """Springs or masses that change along z: no number is then that of all of the packing."""
    diameter = 2 * float(network.radius.mean())
    part = unevenness(network) if network.length > TOLD * diameter else 0.0
    words = (
        f"uneven: P-waves are {part:.0%} faster in one third of the length than in another; "
        "velocities, moduli and attenuation are of a part of it, or a mean"
    )
    yield UNEVEN < part < np.inf, words


def _of_depth(network: Network) -> Remarks:
    """Spheres so soft that the theory of contacts ends."""
    i, j, pair = network.particle_i, network.partner, ~network.with_wall
    reach = network.radius[i] + np.where(pair, network.radius[j], 0.0)
    overlap = reach - norm(network.branch, axis=1)
    smaller = np.minimum(network.radius[i], np.where(pair, network.radius[j], np.inf))
    deepest = float((overlap / smaller).max())
    words = (
        f"very soft: overlaps up to {deepest:.2g} of the smaller radius; theory takes contacts as "
        f"small against spheres and as independent of each other (overlaps below {DEEP:g})"
    )
    yield deepest > DEEP, words


def _of_free_ends(network: Network) -> Remarks:
    """Which ends are free surfaces, and what the void ratio is then of."""
    occupied = occupied_part(network)
    if occupied is None:
        return
    where = f"its {occupied.cubes} cubes away from walls and surfaces"
    if not occupied.cubes:
        where = "the space up to the outermost spheres, too few for a core"
    yield (
        True,
        f"free surface at {', '.join(occupied.free_names)}: the void ratio, "
        f"{occupied.void_ratio:.3f} ± {occupied.void_ratio_error:.3f}, is of {where}",
    )


def _of_places(network: Network, told: dict[str, Any]) -> Remarks:
    """Overlaps, levers and the list of contacts against positions and radii."""
    pair, branch = ~network.with_wall, network.branch
    overlap = overlaps_by_places(network)
    least = least_overlap(network, overlap)
    stated = overlap if network.overlap is None else network.overlap
    too_few = "overlaps differ from those of positions and radii: too few digits?"
    yield abs(stated - overlap).mean() > least, too_few
    missed = norm(network.lever_i - network.lever_j - branch, axis=1)[pair]
    too_long = "levers do not end in one point: are they as long as the radii?"
    yield pair.any() and missed.mean() > least, too_long
    missing = missing_contacts(network)
    told["missing_contacts"] = missing.pairs
    told["missing_wall_contacts"] = missing.with_wall
    yield missing.pairs, missing.describe_pairs(network)
    yield missing.with_wall, missing.describe_walls(network)


def _of_stiffnesses(network: Network, told: dict[str, Any]) -> Remarks:
    """Ratio of stiffnesses, and the law that stiffness, force and overlap follow."""
    ratio = stiffness_ratio(network)
    if len(ratio):
        told["tangential_over_normal_stiffness"] = _spread(ratio)
        yield ratio.max() > 1 + UNIFORM, "contacts stiffer across than along their normal"
        yield _differ(ratio), "tangential over normal stiffness differs among contacts"
    loose = network.n_contacts - len(ratio)
    yield loose, f"{loose} contacts without normal stiffness"
    ratio = force_ratio(network)
    if len(ratio):
        told["force_over_stiffness_times_overlap"] = _spread(ratio)
        law = told["law"] = _law(ratio)
        unknown = "stiffnesses, forces and overlaps follow no law that is known here"
        yield law not in LAWS, unknown
        others = int((abs(ratio / LAWS.get(law, np.nan) - 1) > OUTLIER).sum())
        yield others, f"{others} contacts do not follow the law of the others"


def _of_forces(network: Network, told: dict[str, Any]) -> Remarks:
    """Which contacts pull or slide, and whether the particles are in balance."""
    force, shear, sliding = network.force_normal, network.force_tangential, network.sliding
    if force is None:
        return
    pulling = told["pulling_contacts"] = int((force < 0).sum())
    yield pulling, f"{pulling} contacts pull"
    if network.overlap is not None:
        idle = int(((force == 0) & (network.overlap > 0)).sum())
        yield idle, f"{idle} contacts overlap without a force"
    if shear is None:
        return
    if force.any():
        net, gravity = unbalanced_forces(network), gravity_of(network)
        if gravity is not None:
            told["gravity_m_per_s2"] = gravity.tolist()
            size = float(norm(gravity))
            along = ", ".join(f"{part / size:.2f}" for part in gravity)
            yield (
                True,
                f"net forces are weights: gravity {quantity(size, 'm/s^2')} along ({along}); "
                "stress, stiffness and velocities grow with depth",
            )
        told["net_force_over_contact_force"] = float(net.mean())
        told["largest_net_force_over_contact_force"] = float(net.max())
        words = (
            "particles not in balance under their contacts: net forces are "
            f"{net.mean():.1e} of contact forces, the largest {net.max():.1e}; still in motion?"
        )
        yield net.max() > BALANCE or net.mean() > BALANCED, words
    if sliding is None or not sliding.any():
        return
    _, median, most = told.get("tangential_over_normal_stiffness", (0, 0, 0))
    if most > 0:
        told["springs_of_sliding_contacts"] = (
            f"tangential too, {median:.3g} of the normal ones: modes, moduli and waves "
            "take a friction of the wave that holds these contacts, whatever that of the packing "
            "was; --sliding slip leaves these springs out"
        )
    share = norm(shear, axis=1) / np.where(force > 0, force, np.inf)
    most = share[sliding].max()
    unequal = _differ(share[sliding]) or share[~sliding].max(initial=0.0) > most
    yield unequal, "sliding contacts use unequal shares of friction, or less than others"


def _law(ratio: Floats) -> str:
    low, high = np.percentile(ratio, [5, 95])
    for law, wanted in LAWS.items():
        if wanted * (1 - LAW_TOLERANCE) < low and high < wanted * (1 + LAW_TOLERANCE):
            return law
    return "unknown"


def _differ(values: Floats) -> bool:
    """Whether these are more than one number."""
    return bool(np.ptp(values) > UNIFORM * values.max())


def _spread(values: Floats) -> list[float]:
    return [float(values.min()), float(np.median(values)), float(values.max())]
