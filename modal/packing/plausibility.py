"""Report unusual but possible features of a network, which no check can refuse.

Nothing is refused here. Contact laws that this project does not know may be sound, contact forces
of packings under gravity do not balance, and bodies may have several densities. But only these
numbers show a permuted column of stiffnesses or a mass in another unit.
"""

from typing import Any

import numpy as np
from numpy.linalg import norm

from modal.packing.checks import density_of
from modal.packing.contact_checks import force_ratio, stiffness_ratio
from modal.packing.missing_contacts import (
    least_overlap,
    missing_contacts,
    overlaps_by_places,
)
from modal.packing.network import Network
from modal.packing.precision import MAX_OVERLAP_ERROR_OF_MODES, is_scanned, overlap_error
from modal.packing.remark import Findings, Remark
from modal.packing.shape_remarks import MAX_UNIFORM_SPREAD, remark_on_free_ends, remark_on_shape
from modal.packing.weight import gravity_of, noted_gravity, unbalanced_forces
from modal.tools.arrays import Bools, Floats
from modal.tools.display import quantity

FORCE_RATIOS = {"Hertz": 2 / 3, "linear": 1.0}
"""Force / (stiffness times overlap) in each contact law."""
MAX_LAW_ERROR = 1e-2
"""Largest relative error with which contacts follow a law, for nine contacts in ten: forces and
overlaps of 4 digits still show the law."""
OUTLIER_ERROR = 0.1
"""Relative deviation from the law from which on single contacts are reported."""
MAX_NET_FORCE = 0.05
"""Largest net force divided by the mean contact force that is not reported: at rest it is 1e-8 to
1e-6, with permuted forces 1 or more."""
MAX_MEAN_NET_FORCE = 2e-3
"""Largest mean net force divided by the mean contact force that is not reported: twice that of a
compression that has settled."""
MAX_OVERLAP_OF_THEORY = 0.15
"""Largest overlap divided by the smaller radius for which the theory of contacts holds; sound
packings have up to 0.11."""
DENSITY_RANGE_KG_PER_M3 = (100.0, 25_000.0)
"""Densities of solids, from foam to osmium."""


def plausibility(network: Network, *, sought: bool = False, waves: bool = False) -> dict[str, Any]:
    """Return numbers that show whether a network is plausible, and remarks on unusual features.

    The numbers are: absent data, number of contacts in tension, contact law, balance of forces,
    densities. A list of three numbers holds the smallest, the median and the largest value. Numbers
    whose data are absent are left out; the balance needs shear forces. `remarks` is a list of
    texts, one for each unusual observation. `sought` says that the contacts were found from
    positions, as those of a sample are, so that none can be missing. With `waves` the length of the
    packing is checked, too.
    """
    findings = examine(network, sought=sought, waves=waves)
    texts = [remark.text for remark in findings.remarks]
    return findings.numbers | {"remarks": texts}


def examine(network: Network, *, sought: bool = False, waves: bool = False) -> Findings:
    """Return the numbers of `plausibility`, and the remarks that apply with their codes."""
    density = density_of(network)
    numbers: dict[str, Any] = {"absent": network.absent, "density_kg_per_m3": _spread(density)}
    remarks = [
        _remark_on_digits(network),
        *_remark_on_densities(density),
        *remark_on_free_ends(network),
        *remark_on_shape(network, waves),
    ]
    parts = []
    if network.n_contacts:
        numbers |= {"missing_contacts": 0, "missing_wall_contacts": 0}
        if network.inertia_tensor is None:
            remarks.append(_remark_on_depth(network))
            if not sought:
                parts.append(_examine_geometry(network))
        parts += [_examine_stiffnesses(network), _examine_forces(network)]
    for part in parts:
        numbers |= part.numbers
        remarks += part.remarks
    return Findings(numbers, [remark for remark in remarks if remark.applies])


def _remark_on_digits(network: Network) -> Remark:
    """Remark on overlaps that are known to few digits, or not at all."""
    if is_scanned(network):
        text = (
            "contacts follow from a tolerance of gaps, their stiffnesses from the stress: "
            "velocities and moduli have an error for it, single modes are not listed"
        )
        return Remark("scanned_packing", True, text)
    error = overlap_error(network)
    consequence = "off by up to 2 %"
    if error > MAX_OVERLAP_ERROR_OF_MODES:
        consequence = "not listed"
    text = (
        f"overlaps are known to {error:.2g} of the median one by the digits of positions: "
        f"velocities and moduli have an error for it, single modes are {consequence}"
    )
    return Remark("few_digits", error > 0, text, error)


def _remark_on_densities(density: Floats) -> list[Remark]:
    """Remark on densities that no solid has, and on several densities."""
    low, median, high = _spread(density)
    return [
        Remark(
            "no_solid",
            not is_of_a_solid(median),
            f"density of no solid, {median:.4g} kg/m^3: mass in kg, radius in m?",
            median,
        ),
        Remark(
            "densities_differ",
            _differ(density),
            f"densities from {low:.4g} to {high:.4g} kg/m^3",
        ),
    ]


def is_of_a_solid(density: float) -> bool:
    """Return whether a density, kg/m^3, is one of solids; values in g/cm^3 are not.

    >>> is_of_a_solid(2500.0), is_of_a_solid(2.5)
    (True, False)
    """
    low, high = DENSITY_RANGE_KG_PER_M3
    return low < density < high


def median_density(network: Network) -> float:
    """Return the median of the spheres' densities, kg/m^3."""
    return float(np.median(density_of(network)))


def _remark_on_depth(network: Network) -> Remark:
    """Remark on overlaps that are too large for the theory of contacts."""
    radius_i = network.radius[network.particle_i]
    radius_j = network.radius[network.partner]
    pair = ~network.with_wall
    reach = radius_i + np.where(pair, radius_j, 0.0)
    overlap = reach - norm(network.branch, axis=1)
    smaller = np.minimum(radius_i, np.where(pair, radius_j, np.inf))
    deepest = float((overlap / smaller).max())
    text = (
        f"very soft: overlaps up to {deepest:.2g} of the smaller radius; theory takes contacts as "
        "small against spheres and as independent of each other (overlaps below "
        f"{MAX_OVERLAP_OF_THEORY:g})"
    )
    return Remark("very_soft", deepest > MAX_OVERLAP_OF_THEORY, text, deepest)


def _examine_geometry(network: Network) -> Findings:
    """Compare overlaps, levers and the list of contacts with positions and radii."""
    pair = ~network.with_wall
    overlap = overlaps_by_places(network)
    tolerance = least_overlap(network, overlap)
    stated = overlap if network.overlap is None else network.overlap
    misfit = norm(network.lever_i - network.lever_j - network.branch, axis=1)[pair]
    missing = missing_contacts(network)
    numbers = {
        "missing_contacts": missing.pairs,
        "missing_wall_contacts": missing.with_wall,
    }
    remarks = [
        Remark(
            "overlaps_differ",
            abs(stated - overlap).mean() > tolerance,
            "overlaps differ from those of positions and radii: too few digits?",
        ),
        Remark(
            "levers_too_long",
            pair.any() and misfit.mean() > tolerance,
            "levers do not end in one point: are they as long as the radii?",
        ),
        Remark(
            "contacts_missing",
            missing.pairs,
            missing.describe_pairs(network),
            missing.pairs,
        ),
        Remark(
            "wall_contacts_missing",
            missing.with_wall,
            missing.describe_walls(network),
            missing.with_wall,
        ),
    ]
    return Findings(numbers, remarks)


def _examine_stiffnesses(network: Network) -> Findings:
    """Examine the ratio of stiffnesses, and the law between stiffness, force and overlap."""
    numbers: dict[str, Any] = {}
    remarks = []
    ratio = stiffness_ratio(network)
    if len(ratio):
        numbers["tangential_over_normal_stiffness"] = _spread(ratio)
        remarks += [
            Remark(
                "stiffer_across",
                ratio.max() > 1 + MAX_UNIFORM_SPREAD,
                "contacts stiffer across than along their normal",
            ),
            Remark(
                "stiffness_ratios_differ",
                _differ(ratio),
                "tangential over normal stiffness differs among contacts",
            ),
        ]
    loose = network.n_contacts - len(ratio)
    text = f"{loose} contacts without normal stiffness"
    remarks.append(Remark("no_normal_stiffness", loose, text, loose))
    ratio = force_ratio(network)
    if len(ratio):
        law = _find_law(ratio)
        numbers["force_over_stiffness_times_overlap"] = _spread(ratio)
        numbers["law"] = law
        error = abs(ratio / FORCE_RATIOS.get(law, np.nan) - 1)
        outliers = int((error > OUTLIER_ERROR).sum())
        remarks += [
            Remark(
                "unknown_law",
                law not in FORCE_RATIOS,
                "stiffnesses, forces and overlaps follow no law that is known here",
            ),
            Remark(
                "other_laws",
                outliers,
                f"{outliers} contacts do not follow the law of the others",
                outliers,
            ),
        ]
    return Findings(numbers, remarks)


def _examine_forces(network: Network) -> Findings:
    """Examine contacts in tension, sliding contacts, and the balance of forces on particles."""
    force = network.force_normal
    if force is None:
        return Findings({}, [])
    pulling = int((force < 0).sum())
    numbers: dict[str, Any] = {"pulling_contacts": pulling}
    remarks = [Remark("contacts_pull", pulling, f"{pulling} contacts pull", pulling)]
    if network.overlap is not None:
        idle = int(((force == 0) & (network.overlap > 0)).sum())
        remarks.append(
            Remark("overlap_without_force", idle, f"{idle} contacts overlap without a force", idle)
        )
    if network.force_tangential is None:
        return Findings(numbers, remarks)
    parts = []
    if force.any():
        parts.append(_examine_balance(network))
    if network.sliding is not None and network.sliding.any():
        parts.append(_examine_sliding(network, force, network.force_tangential, network.sliding))
    for part in parts:
        numbers |= part.numbers
        remarks += part.remarks
    return Findings(numbers, remarks)


def _examine_balance(network: Network) -> Findings:
    """Examine whether the contact forces on each particle add up to zero or to its weight."""
    numbers: dict[str, Any] = {}
    remarks = []
    net = unbalanced_forces(network)
    gravity = gravity_of(network)
    if gravity is not None:
        numbers["gravity_m_per_s2"] = gravity.tolist()
        size = float(norm(gravity))
        direction = ", ".join(f"{component / size:.2f}" for component in gravity)
        source = "net forces are weights"
        if noted_gravity(network) is not None:
            source = "under its weight, as noted"
        remarks.append(
            Remark(
                "gravity",
                True,
                f"{source}: gravity {quantity(size, 'm/s^2')} along ({direction}); "
                "stress, stiffness and velocities grow with depth",
                size,
            )
        )
    mean = float(net.mean())
    largest = float(net.max())
    numbers["net_force_over_contact_force"] = mean
    numbers["largest_net_force_over_contact_force"] = largest
    remarks.append(
        Remark(
            "not_in_balance",
            largest > MAX_NET_FORCE or mean > MAX_MEAN_NET_FORCE,
            "particles not in balance under their contacts: net forces are "
            f"{mean:.1e} of contact forces, the largest {largest:.1e}; still in motion?",
            mean,
        )
    )
    return Findings(numbers, remarks)


def _examine_sliding(network: Network, force: Floats, shear: Floats, sliding: Bools) -> Findings:
    """Examine the springs of sliding contacts, and the shares of friction that contacts use."""
    numbers: dict[str, Any] = {}
    ratio = stiffness_ratio(network)
    if len(ratio) and ratio.max() > 0:
        numbers["springs_of_sliding_contacts"] = (
            f"tangential too, {np.median(ratio):.3g} of the normal ones: modes, moduli and waves "
            "take a friction of the wave that holds these contacts, whatever that of the packing "
            "was; --sliding slip leaves these springs out"
        )
    share = norm(shear, axis=1) / np.where(force > 0, force, np.inf)
    largest_other = share[~sliding].max(initial=0.0)
    unequal = _differ(share[sliding]) or largest_other > share[sliding].max()
    text = "sliding contacts use unequal shares of friction, or less than others"
    return Findings(numbers, [Remark("unequal_friction", unequal, text)])


def _find_law(ratio: Floats) -> str:
    """Return the name of the law that nine contacts in ten follow, or "unknown"."""
    low, high = np.percentile(ratio, [5, 95])
    for law, value in FORCE_RATIOS.items():
        if value * (1 - MAX_LAW_ERROR) < low and high < value * (1 + MAX_LAW_ERROR):
            return law
    return "unknown"


def _differ(values: Floats) -> bool:
    """Return whether the values differ by more than round-off."""
    return bool(np.ptp(values) > MAX_UNIFORM_SPREAD * values.max())


def _spread(values: Floats) -> list[float]:
    """Return the smallest, the median and the largest of the values."""
    return [float(values.min()), float(np.median(values)), float(values.max())]
