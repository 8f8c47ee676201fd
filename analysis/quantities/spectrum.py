"""What the natural frequencies are: the highest, standing waves among the lowest, their density."""

from typing import NamedTuple

import numpy as np

from analysis.case import AbsentError
from analysis.caveats import Caveat
from analysis.estimators import resonances as resonant
from analysis.estimators.damped_transform import Dispersion, mode_dispersion
from analysis.packing_data import PackingData, cached_on_packing
from analysis.prepare import as_read, kept_file, made
from analysis.quantities.registry import on_request, quantity
from analysis.quantities.velocity import LOW_ORDER, longest
from analysis.value import Value, estimate, hertz, unknown
from modal.modes.collective import every_floppy
from modal.modes.eigenmodes import eigenmodes
from modal.modes.mode_set import ModeSet, read_z_shapes
from modal.packing.precision import taken_as_exact
from modal.packing.rattlers import force_bearing
from modal.packing.state import contacts_per_particle
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError

LOWEST = 40
"""Modes that are searched for where no file has any."""
FEWEST = 30
"""Modes below a peak of D(f) / f^2: from fewer each single one is a peak."""
FIRST_LINES = 10
"""Steps between the frequencies of a density below which modes of zero frequency are seen: 2.5
widths of a single mode's line, as four frequencies stand in a width (`modal.modes.density`)."""
TENTH = 0.1
"""Part of the highest frequency at which packings are compared."""
SAME = 1e-6
"""Relative difference of two frequencies that are one mode's, of two searches."""


@cached_on_packing
def density(m: PackingData) -> tuple[Floats, Floats, Floats]:
    """Frequency, Hz, modes per Hz and modes below, of the whole spectrum."""
    if (kept := kept_file(m, "density")) is not None:
        return kept
    return as_read("density", made(m, "density"))


@cached_on_packing
def highest(m: PackingData) -> ModeSet:
    """The highest modes of a file, with their shapes; else the highest mode without."""
    if m.case.has("highest.modes"):
        return m.case.read("highest.modes")
    return eigenmodes(taken_as_exact(m.network), highest=1, certify=False, shapes=False)


@cached_on_packing
def z_shapes(m: PackingData) -> Floats | None:
    """Shape (k, n), kg^-1/2: how each mode of the file moves the particles along z."""
    return read_z_shapes(m.case.product("modes")) if m.case.has("modes") else None


@cached_on_packing
def lowest_modes(m: PackingData) -> tuple[ModeSet, Floats, list[Caveat]]:
    """The lowest modes, how they move the spheres along z (k, n), and what they lack.

    Of a file where there is one with shapes, else some that are searched for.
    """
    n = 6 * m.network.n_particles
    modes, along_z = m.case.read("modes"), z_shapes(m)
    if modes is None or along_z is None:
        network = taken_as_exact(m.network)
        beside_zero_modes = n - every_floppy(LinearSystem.of(network)).held
        modes = eigenmodes(network, lowest=min(LOWEST, beside_zero_modes))
        if modes.mode_shape is None:
            raise UnavailableError(
                "the modes' shapes take too much memory; give a file of modes", code="too_large"
            )
        along_z = modes.mode_shape[:, :, 2]
    count = len(modes.frequency)
    lacks = []
    if count + modes.floppy_modes < n:
        part = {
            "count": count,
            "all": n,
            "frequency": hertz(modes.frequency[-1]),
        }
        lacks.append(Caveat("incomplete_list", part))
    if modes.missing:
        lacks.append(Caveat("missing_modes", {"missing": modes.missing}))
    return modes, along_z, lacks


@cached_on_packing
def standing(m: PackingData) -> resonant.Standing | None:
    """Modes of a file that bear the standing waves of a random packing; None without shapes."""
    if m.crystal or z_shapes(m) is None:
        return None
    return resonant.standing_modes(m.case.read("modes").frequency, z_shapes(m), m.network)


@cached_on_packing
def standing_waves(m: PackingData) -> tuple[Floats, Floats]:
    """f_r (Hz), kappa_r (1/m, Eq. 4): pure modes of a crystal, else those that bear the waves.

    Of files: beyond the modes that can be told, and without their shapes, the structure factor's
    ridge.
    """
    modes, structure, bearers = m.case.read("modes"), m.case.read("structure"), standing(m)
    if modes is not None and modes.resonance_frequency is not None and m.crystal:
        return modes.resonance_frequency, modes.resonance_wavenumber
    own: Floats = np.empty(0) if bearers is None else bearers.frequency
    if structure is not None:
        f = structure.ridge()[0]
        known = structure.order <= len(own)
        f[known] = own[structure.order[known] - 1]
        return f, structure.wavenumber
    kappa: Floats = np.pi * np.arange(1.0, len(own) + 1) / m.network.length
    return own, kappa


@cached_on_packing
def modal_dispersion(m: PackingData) -> Dispersion:
    """The dispersion of a crystal's pure modes."""
    lattice, modes = m.lattice, m.case.needed("modes")
    if modes.resonance_shape is None:
        raise AbsentError
    return mode_dispersion(modes.resonance_frequency, modes.resonance_shape, lattice.distance)


def modal_fitted(m: PackingData) -> Value:
    """V_P, m/s, of wave numbers that are fitted to the modes' shapes."""
    if m.crystal:
        return estimate(modal_dispersion(m).velocity)
    bearers = standing(m)
    if bearers is None:
        raise AbsentError
    bearing = force_bearing(m.network)
    depth = m.network.position[bearing, 2] - m.network.wall_position[0]
    rows = bearers.row[:LOW_ORDER]
    kappa = resonant.fitted_wavenumbers(z_shapes(m)[rows][:, bearing], depth, m.network.length)
    return estimate(*resonant.long_wave_velocity(bearers.frequency[:LOW_ORDER], kappa))


@cached_on_packing
def f_max(m: PackingData) -> float:
    """Highest natural frequency, Hz: of a list of all, else of the highest modes."""
    modes = m.case.read("modes")
    complete = modes is not None and len(modes.frequency) == 6 * m.network.n_particles
    return float((modes if complete else highest(m)).frequency[-1])


def highest_seat(m: PackingData) -> tuple[float, float]:
    """How many spheres move in the highest mode (participation), contacts of the first."""
    found = m.case.needed("highest.modes")
    if found.mode_shape is None:
        raise AbsentError
    moved = (found.mode_shape[-1] ** 2)[:, :3].sum(axis=1)
    contacts = contacts_per_particle(m.network)[int(np.argmax(moved))]
    return float(moved.sum() ** 2 / (moved**2).sum()), float(contacts)


def natural_frequency(frequency: float, *lists: ModeSet | None) -> Value:
    """A natural frequency, Hz; its error from the residual in the list that holds it.

    |A v - omega^2 v| of a unit vector bounds the distance of omega^2 from an eigenvalue, for A is
    symmetric: half the relative residual is that of the frequency.
    """
    for modes in lists:
        if modes is not None and frequency in modes.frequency:
            at = int(np.argmax(modes.frequency == frequency))
            return estimate(frequency, 0.5 * frequency * float(modes.residual[at]))
    return estimate(frequency)


@cached_on_packing
def chi_lists(m: PackingData) -> list[tuple[Floats, Floats, Floats]]:
    """Frequency (k,) Hz, chi_z of all particles and of the chain (k,), of each list of modes.

    Lists are complete in their intervals: of a later one only what lies beyond the one before.
    """
    lists = [s for s in map(m.case.read, ("modes", "band.modes")) if s and len(s.frequency)]
    found: list[tuple[Floats, Floats, Floats]] = []
    end = -np.inf
    for modes in sorted(lists, key=lambda s: float(s.frequency[0])):
        new = modes.frequency > end * (1 + SAME)
        if new.any():
            found.append((modes.frequency[new], modes.chi_z[new], modes.chi_z_chain[new]))
            end = float(modes.frequency[-1])
    return found


def chi_between(m: PackingData, low: float, high: float, chain: bool) -> tuple[Floats, Floats]:
    """Natural frequencies (k,) between two Hz, and chi_z of each (k,).

    Of the chain, as in the paper, or of all particles; empty where no mode is at hand.
    """
    if not (lists := chi_lists(m)):
        return np.empty(0), np.empty(0)
    f, every, along = (np.concatenate(part) for part in zip(*lists, strict=True))
    inside = (f > low) & (f < high)
    return f[inside], (along if chain else every)[inside]


def largest_chi(m: PackingData, low: float, high: float, chain: bool = True) -> tuple[float, str]:
    """Largest chi_z between two Hz, and of which modes."""
    f, chi = chi_between(m, low, high, chain)
    if not len(f):
        return np.nan, ""
    return float(chi.max()), f"{len(f)} modes, {f.min() / 1e3:.2f}-{f.max() / 1e3:.2f} kHz"


def mean_chi(m: PackingData, low: float, high: float) -> Value:
    """Mean chi_z of the chain between two Hz, 1/3 where motion has no direction.

    Its error is the standard error of as many independent modes.
    """
    chi = chi_between(m, low, high, chain=True)[1]
    if len(chi) < 2:
        raise AbsentError
    return estimate(float(chi.mean()), float(chi.std(ddof=1) / len(chi) ** 0.5))


PURE = 0.9
"""Least chi_z of a mode that is a P-wave, in the paper."""


def last_pure(m: PackingData) -> Value:
    """Highest frequency, Hz, of a mode of the chain with chi_z above 0.9.

    There is one such mode a resonance, so that their distance is the error. Unknown where the list
    of modes ends less than two of them above.
    """
    f, chi = chi_between(m, 0, np.inf, chain=True)
    last = max(f[chi > PURE], default=np.inf)
    apart = 0.5 * longest(m, "linear").value / m.network.length
    if not last + 2 * apart <= max(f, default=0):
        raise AbsentError
    return estimate(last, apart)


class Excess(NamedTuple):
    """D f_max^3 / f^2, D a share of all modes, at a tenth of the highest frequency; its largest.

    The largest at `peak_frequency`, Hz; NaN where it is at the lowest frequency that is known.
    """

    at_a_tenth: float
    peak: float
    peak_frequency: float


def excess_of(frequency: Floats, density: Floats, modes: float, highest: float) -> Excess:
    """From modes per Hz (n,) at evenly spaced frequencies (n,) Hz, `modes` in all.

    In a solid of plane waves alone D grows as f^2 (Debye), and the ratio is 3. A packing near its
    loss of rigidity has modes at low frequency beside the waves: the ratio has a maximum, the
    higher and the lower in frequency the fewer contacts hold a sphere.

    >>> f = np.linspace(0, 1e5, 1001)
    >>> float(round(excess_of(f, 3 * f**2 / 1e5**3 * 600, 600, 1e5).at_a_tenth, 12))
    3.0
    """
    first = FIRST_LINES * (frequency[1] - frequency[0])
    keep = (frequency > first) & (frequency < highest)
    f = frequency[keep] / highest
    reduced = density[keep] / modes * highest / f**2
    tenth = float(np.interp(TENTH, f, reduced, np.nan, np.nan)) if len(f) > 1 else np.nan
    top = int(np.argmax(reduced)) if len(f) else 0
    return Excess(tenth, *((reduced[top], f[top] * highest) if top else (np.nan, np.nan)))


@cached_on_packing
def excess(m: PackingData) -> Excess:
    """Density of states over that of plane waves."""
    frequency, per_hertz, _ = density(m)
    return excess_of(frequency, per_hertz, 6 * m.network.n_particles, f_max(m))


HIGHEST_BRANCH = 0.15
"""Of the highest frequency: the modes of a narrow cell are not listed beyond."""


@quantity("Hz", definition="highest natural frequency")
def highest_frequency(m: PackingData) -> Value:
    """Highest natural frequency.

    Of the mode that products with K find at the top; its residual bounds its error.
    """
    modes = highest(m)
    value, residual = float(modes.frequency[-1]), float(modes.residual[-1])
    return Value(value, "Hz", {"fit": residual * value / 2})


@quantity("Hz", definition="frequency at which D(f) / f^2 is largest: where soft modes are")
def excess_peak(m: PackingData) -> Value:
    """Frequency at which D(f) / f^2 is largest: where soft modes are.

    The boson peak; its error is half the width of a line of the density.
    """
    if m.crystal:
        return unknown("Hz", Caveat("no_soft_modes"))
    frequency, _, below = density(m)
    found = excess(m)
    line = 4 * float(frequency[1] - frequency[0])
    if not np.isfinite(found.peak_frequency):
        caveat = Caveat("no_peak", {"frequency": hertz(2.5 * line)})
        return unknown("Hz", caveat, *m.of_one_sample)
    first, count = np.interp([2.5 * line, found.peak_frequency], frequency, below)
    if count - first < FEWEST:
        values = {
            "needed": FEWEST,
            "frequency": hertz(found.peak_frequency),
        }
        return unknown("Hz", Caveat("few_modes", values), *m.of_one_sample)
    return Value(found.peak_frequency, "Hz", {"resolution": line / 2}, m.of_one_sample)


@on_request("Hz", definition="of standing P-waves r = 1, 2, ... among the lowest modes")
def resonances(m: PackingData) -> Value:
    """Of standing P-waves r = 1, 2, ... among the lowest modes.

    Of a crystal its pure modes, else the modes that bear the largest share of each wave.
    """
    modes, along_z, lacks = lowest_modes(m)
    f = modes.resonance_frequency
    if not m.crystal or f is None:
        f = resonant.standing_modes(modes.frequency, along_z, m.network).frequency
    if not len(f):
        return unknown("Hz", Caveat("no_standing_wave"), *lacks)
    return Value(np.asarray(f), "Hz", {}).with_caveats(*m.of_waves, *lacks)


@on_request("1", definition="share of a mode's motion that is along z, over frequency (Eq. 2)")
def chi_z(m: PackingData) -> Value:
    """Share of a mode's motion that is along z, over frequency (Eq. 2).

    Of all spheres, of each of the lowest modes.
    """
    modes, _, lacks = lowest_modes(m)
    caveats = (*m.of_one_sample, *lacks)
    return Value(modes.chi_z, "1", {}, caveats, modes.frequency)


@on_request("1", definition="chi_z of every mode up to 1.5 V_P / W, W the cell's width")
def chi_z_of_branches(packing: PackingData) -> Value:
    """chi_z of every mode up to 1.5 V_P / W, W the cell's width.

    Of all spheres. V_S / W and V_P / W are where further waves set in along a cell W wide.
    """
    width = packing.width * packing.diameter
    limit = 1.5 * float(packing.moduli.velocities((0, 0, 1))[0]) / width
    top = min(limit, HIGHEST_BRANCH * highest(packing).frequency[-1])
    modes = eigenmodes(taken_as_exact(packing.network), below=top, shapes=False)
    lacks = (Caveat("missing_modes", {"missing": modes.missing}),) if modes.missing else ()
    return Value(modes.chi_z, "1", {}, packing.of_one_sample + lacks, modes.frequency)
