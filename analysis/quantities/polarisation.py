"""Measure the direction of motion in modes: chi_z, the share along z (Eq. 2)."""

import numpy as np

from analysis.case import AbsentError
from analysis.caveats import Caveat
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.registry import on_request
from analysis.quantities.spectrum import highest, lowest_modes, step_of_modes
from analysis.quantities.velocity import longest
from analysis.steps import Step, limit_step
from analysis.value import Value, estimate, unknown
from modal.modes.eigenmodes import eigenmodes
from modal.packing.precision import taken_as_exact
from modal.tools.arrays import Floats

SAME_FREQUENCY = 1e-6
"""Largest relative difference of two frequencies in two lists that count as those of one mode."""
MIN_CHI_OF_P_WAVE = 0.9
"""Least chi_z of a mode that counts as a P-wave, from Otsubo et al. (2017)."""
MAX_BRANCH_SHARE_OF_HIGHEST = 0.15
"""Share of the highest frequency up to which the modes of a narrow cell are listed."""


@cached_on_packing
def chi_lists(packing: PackingData) -> list[tuple[Floats, Floats, Floats]]:
    """Return frequency (k,), Hz, chi_z of all particles and of the chain (k,), for each list.

    Each list is complete in its interval. If two overlap, the second one begins where the first
    ends.
    """
    candidates = [packing.case.read(kind) for kind in ("modes", "band.modes")]
    lists = [modes for modes in candidates if modes and len(modes.frequency)]
    columns: list[tuple[Floats, Floats, Floats]] = []
    end = -np.inf
    for modes in sorted(lists, key=lambda each: float(each.frequency[0])):
        new = modes.frequency > end * (1 + SAME_FREQUENCY)
        if new.any():
            columns.append((modes.frequency[new], modes.chi_z[new], modes.chi_z_chain[new]))
            end = float(modes.frequency[-1])
    return columns


def chi_between(
    packing: PackingData, low: float, high: float, chain: bool
) -> tuple[Floats, Floats]:
    """Return the natural frequencies (k,) from `low` to `high`, Hz, and their chi_z (k,).

    chi_z is that of the chain, as in Otsubo et al. (2017), or that of all particles.
    """
    lists = chi_lists(packing)
    if not lists:
        return np.empty(0), np.empty(0)
    frequency, of_all, of_chain = (np.concatenate(column) for column in zip(*lists, strict=True))
    inside = (frequency > low) & (frequency < high)
    if chain:
        return frequency[inside], of_chain[inside]
    return frequency[inside], of_all[inside]


def largest_chi(
    packing: PackingData, low: float, high: float, chain: bool = True
) -> tuple[float, str]:
    """Return the largest chi_z between two frequencies, Hz, and a text that describes the modes."""
    frequency, chi = chi_between(packing, low, high, chain)
    if not len(frequency):
        return np.nan, ""
    first = frequency.min() / 1e3
    last = frequency.max() / 1e3
    return float(chi.max()), f"{len(frequency)} modes, {first:.2f}-{last:.2f} kHz"


def mean_chi(packing: PackingData, low: float, high: float) -> Value:
    """Measure the mean chi_z of the chain between two frequencies, Hz; 1/3 for random directions.

    The error is the standard error of independent modes.
    """
    frequency, chi = chi_between(packing, low, high, chain=True)
    if len(chi) < 2:
        raise AbsentError
    error = float(chi.std(ddof=1) / len(chi) ** 0.5)
    return estimate(float(chi.mean()), error, steps=(_step_between(frequency),))


def _step_between(frequency: Floats) -> Step:
    """Return a step that describes the modes (k,) between two frequencies, Hz."""
    numbers = {
        "modes": len(frequency),
        "lowest": frequency.min(initial=np.inf),
        "highest": frequency.max(initial=-np.inf),
    }
    outcome = "read" if len(frequency) else "none_left"
    return Step("window", outcome, numbers)


def measure_largest_chi(packing: PackingData, low: float, high: float, chain: bool = True) -> Value:
    """Measure the largest chi_z of the modes between two frequencies, Hz."""
    largest, _ = largest_chi(packing, low, high, chain)
    frequency, _ = chi_between(packing, low, high, chain)
    return estimate(largest, steps=(_step_between(frequency),))


def last_pure(packing: PackingData) -> Value:
    """Measure the highest frequency, Hz, of a mode whose chain has chi_z above 0.9.

    Each resonance has one such mode, so that the distance between two of them is the error. The
    frequency is not known if the list of modes ends less than two such distances above it.
    """
    frequency, chi = chi_between(packing, 0, np.inf, chain=True)
    last = max(frequency[chi > MIN_CHI_OF_P_WAVE], default=np.inf)
    distance = 0.5 * longest(packing, "linear").value / packing.network.length
    list_end = max(frequency, default=0)
    numbers = {
        "last_pure": last,
        "resonance_distance": distance,
        "list_end": list_end,
        "least_list_end": last + 2 * distance,
    }
    step = limit_step(numbers, "list_end", "least_list_end", least=True)
    if step.outcome != "kept":
        return unknown("Hz", Caveat("absent"), steps=(step,))
    return estimate(last, distance, steps=(step,))


@on_request("1", definition="share of a mode's motion that is along z, over frequency (Eq. 2)")
def chi_z(packing: PackingData) -> Value:
    """Measure chi_z (Eq. 2) of all spheres, for each of the lowest modes."""
    modes, _, caveats = lowest_modes(packing)
    all_caveats = (*packing.of_one_sample, *caveats)
    steps = (step_of_modes(packing, modes),)
    return Value(modes.chi_z, "1", {}, all_caveats, modes.frequency, steps=steps)


@on_request("1", definition="chi_z of every mode up to 1.5 V_P / W, W the cell's width")
def chi_z_of_branches(packing: PackingData) -> Value:
    """Measure chi_z of all spheres, for the modes at which new branches begin in a narrow cell.

    In a cell that is W wide further waves begin at V_S / W and V_P / W.
    """
    width = packing.width * packing.diameter
    limit = 1.5 * float(packing.moduli.velocities((0, 0, 1))[0]) / width
    top = min(limit, MAX_BRANCH_SHARE_OF_HIGHEST * highest(packing).frequency[-1])
    modes = eigenmodes(taken_as_exact(packing.network), below=top, shapes=False)
    caveats = packing.of_one_sample
    if modes.missing:
        caveats += (Caveat("missing_modes", {"missing": modes.missing}),)
    velocity_step = Step("fit", "converged", {"residual": packing.moduli.error})
    steps = (velocity_step, step_of_modes(packing, modes))
    return Value(modes.chi_z, "1", {}, caveats, modes.frequency, steps=steps)
