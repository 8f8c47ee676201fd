"""Measure natural frequencies: the highest, standing waves among the lowest, their density."""

import numpy as np

from analysis.case import AbsentError
from analysis.caveats import Caveat
from analysis.estimators import resonances as resonant
from analysis.estimators.damped_transform import Dispersion, mode_dispersion
from analysis.estimators.excess import Excess, excess_of
from analysis.estimators.structure_factor import StructureFactor
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.registry import on_request, quantity
from analysis.quantities.velocity import LOW_ORDER
from analysis.spectra_cache import as_read, compute_spectrum, kept_file
from analysis.steps import Step, limit_step
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

DEFAULT_LOWEST_MODES = 40
"""Modes that are computed if no file has any."""
MIN_MODES_BELOW_PEAK = 30
"""Modes below a peak of D(f) / f^2. Among fewer modes each single one makes a peak."""


@cached_on_packing
def density(packing: PackingData) -> tuple[Floats, Floats, Floats]:
    """Return frequencies (n,), Hz, modes per Hz (n,) and modes below each (n,)."""
    kept = kept_file(packing, "density")
    if kept is not None:
        return kept
    return as_read("density", compute_spectrum(packing, "density"))


@cached_on_packing
def highest(packing: PackingData) -> ModeSet:
    """Return the highest modes of a file, with shapes; else the highest mode, without its shape."""
    if packing.case.has("highest.modes"):
        return packing.case.read("highest.modes")
    return eigenmodes(taken_as_exact(packing.network), highest=1, certify=False, shapes=False)


@cached_on_packing
def z_shapes(packing: PackingData) -> Floats | None:
    """Return the displacement along z of the particles in each mode of a file, (k, n), kg^-1/2."""
    if packing.case.has("modes"):
        return read_z_shapes(packing.case.product("modes"))
    return None


def step_of_modes(packing: PackingData, modes: ModeSet) -> Step:
    """Return a step that describes a list of modes: number found, number in all, and limits."""
    count = len(modes.frequency)
    degrees_of_freedom = packing.network.degrees_of_freedom
    outcome = "complete"
    if count + modes.floppy_modes < degrees_of_freedom:
        outcome = "ends_early"
    numbers = {
        "modes": count,
        "all_modes": degrees_of_freedom,
        "lowest": modes.frequency.min(initial=np.inf),
        "highest": modes.frequency.max(initial=-np.inf),
        "residual": modes.residual.max(initial=0.0),
    }
    return Step("window", outcome, numbers)


@cached_on_packing
def lowest_modes(packing: PackingData) -> tuple[ModeSet, Floats, list[Caveat]]:
    """Return the lowest modes, their motion along z (k, n), and caveats on missing modes.

    The modes are those of a file with shapes; without one, some are computed.
    """
    n = packing.network.degrees_of_freedom
    modes = packing.case.read("modes")
    along_z = z_shapes(packing)
    if modes is None or along_z is None:
        network = taken_as_exact(packing.network)
        not_floppy = n - every_floppy(LinearSystem.of(network)).held
        modes = eigenmodes(network, lowest=min(DEFAULT_LOWEST_MODES, not_floppy))
        if modes.mode_shape is None:
            raise UnavailableError(
                "too_large", "the modes' shapes take too much memory", remedy="give a file of modes"
            )
        along_z = modes.mode_shape[:, :, 2]
    count = len(modes.frequency)
    caveats = []
    if count + modes.floppy_modes < n:
        values = {"count": count, "all": n, "frequency": hertz(modes.frequency[-1])}
        caveats.append(Caveat("incomplete_list", values))
    if modes.missing:
        caveats.append(Caveat("missing_modes", {"missing": modes.missing}))
    return modes, along_z, caveats


@cached_on_packing
def standing(packing: PackingData) -> resonant.Standing | None:
    """Find, in a random packing, the mode with the largest share of each standing wave.

    The result is None for a crystal and if there are no mode shapes.
    """
    shapes = z_shapes(packing)
    if packing.crystal or shapes is None:
        return None
    frequency = packing.case.read("modes").frequency
    return resonant.standing_modes(frequency, shapes, packing.network)


@cached_on_packing
def standing_waves(packing: PackingData) -> tuple[Floats, Floats]:
    """Return f_r, Hz, and kappa_r, 1/m, (Eq. 4) of the standing P-waves r in the files.

    They are the pure modes of a crystal, else the modes with the largest share of each wave. Beyond
    the last such mode, and without shapes of modes, they come from the ridge of the structure
    factor.
    """
    modes = packing.case.read("modes")
    structure = packing.case.read("structure")
    bearers = standing(packing)
    if packing.crystal and modes is not None and modes.resonance_frequency is not None:
        return modes.resonance_frequency, modes.resonance_wavenumber
    of_modes: Floats = np.empty(0)
    if bearers is not None:
        of_modes = bearers.frequency
    if structure is not None:
        frequency = structure.ridge()[0]
        known = structure.order <= len(of_modes)
        frequency[known] = of_modes[structure.order[known] - 1]
        return frequency, structure.wavenumber
    order = np.arange(1.0, len(of_modes) + 1)
    wavenumber: Floats = np.pi * order / packing.network.length
    return of_modes, wavenumber


@cached_on_packing
def modal_dispersion(packing: PackingData) -> Dispersion:
    """Measure the dispersion relation of a crystal's pure modes."""
    lattice = packing.lattice
    modes = packing.case.needed("modes")
    if modes.resonance_shape is None:
        raise AbsentError
    return mode_dispersion(modes.resonance_frequency, modes.resonance_shape, lattice.distance)


def modal_fitted(packing: PackingData) -> Value:
    """Measure V_P, m/s, with wave numbers that are fitted to the shapes of the modes."""
    if packing.crystal:
        modes = packing.case.needed("modes")
        dispersion = modal_dispersion(packing)
        steps = (step_of_modes(packing, modes), step_of_dispersion(dispersion))
        return estimate(dispersion.velocity, steps=steps)
    bearers = standing(packing)
    shapes = z_shapes(packing)
    if bearers is None or shapes is None:
        raise AbsentError
    network = packing.network
    bearing = force_bearing(network)
    depth = network.position[bearing, 2] - network.wall_position[0]
    rows = bearers.row[:LOW_ORDER]
    wavenumber = resonant.fitted_wavenumbers(shapes[rows][:, bearing], depth, network.length)
    return velocity_of_standing_waves(bearers.frequency[:LOW_ORDER], wavenumber)


def step_of_dispersion(dispersion: Dispersion) -> Step:
    """Return a step that describes the fit of a crystal's dispersion relation."""
    numbers = {
        "order": len(dispersion.coefficients),
        "velocity": dispersion.velocity,
        "band_edge": dispersion.low_pass_frequency,
    }
    return Step("fit", "fitted", numbers)


def velocity_of_standing_waves(frequency: Floats, wavenumber: Floats) -> Value:
    """Measure V_P, m/s, of standing waves from frequencies (R,), Hz, and wave numbers (R,), 1/m."""
    velocity, error = resonant.long_wave_velocity(frequency, wavenumber)
    rows = resonant.FITTED_ROWS
    known = np.isfinite(frequency[rows] / wavenumber[rows])
    numbers = {
        "waves": len(frequency),
        "frequencies": known.sum(),
        "needed": resonant.MIN_FITTED_ORDERS,
        "lowest": frequency[rows][known].min(initial=np.inf),
        "highest": frequency[rows][known].max(initial=-np.inf),
        "velocity": velocity,
        "error": error,
    }
    outcome = "fitted" if np.isfinite(velocity) else "too_few"
    return estimate(velocity, error, steps=(Step("fit", outcome, numbers),))


@cached_on_packing
def f_max(packing: PackingData) -> float:
    """Return the highest natural frequency, Hz, from a complete list or from the highest modes."""
    modes = packing.case.read("modes")
    if modes is not None and len(modes.frequency) == packing.network.degrees_of_freedom:
        return float(modes.frequency[-1])
    return float(highest(packing).frequency[-1])


def highest_seat(packing: PackingData) -> tuple[float, float]:
    """Return the number of spheres that move in the highest mode, and the contacts of its centre.

    The first number is the participation number of the translations. The centre of the mode is the
    sphere that moves most.
    """
    modes = packing.case.needed("highest.modes")
    if modes.mode_shape is None:
        raise AbsentError
    square = (modes.mode_shape[-1] ** 2)[:, :3].sum(axis=1)
    contacts = contacts_per_particle(packing.network)[int(np.argmax(square))]
    return float(square.sum() ** 2 / (square**2).sum()), float(contacts)


def natural_frequency(frequency: float, *lists: ModeSet | None) -> Value:
    """Return a natural frequency, Hz, with the error that its residual bounds.

    The residual is that of the first of the `lists` that contains the frequency.

    A is symmetric, so that |A v - omega^2 v| of a unit vector v bounds the distance of omega^2 from
    an eigenvalue. The relative error of the frequency is half of the relative residual.
    """
    for modes in lists:
        if modes is not None and frequency in modes.frequency:
            row = int(np.argmax(modes.frequency == frequency))
            residual = float(modes.residual[row])
            steps = (Step("fit", "converged", {"residual": residual}),)
            return estimate(frequency, 0.5 * frequency * residual, steps=steps)
    return estimate(frequency)


def resonance(packing: PackingData, order: int) -> Value:
    """Measure the P resonance of an order by its mode, or by the ridge of the structure factor, Hz.

    Raises AbsentError if fewer resonances are known.
    """
    frequencies = standing_waves(packing)[0]
    if len(frequencies) < order:
        raise AbsentError
    frequency = float(frequencies[order - 1])
    modes = packing.case.read("modes")
    structure = packing.case.read("structure")
    if structure is None or (modes is not None and frequency in modes.frequency):
        return natural_frequency(frequency, modes)
    return estimate(frequency, steps=(_step_of_ridge(structure, order),))


def _step_of_ridge(structure: StructureFactor, order: int) -> Step:
    """Return the largest power of a standing wave, and the powers beside it, as a step."""
    numbers = {"standing_wave": float(order), "resolution": structure.resolution}
    peak = structure.peak_of_row(order - 1)
    if peak is None:
        return Step("window", "none_left", numbers)
    numbers |= {
        "grid_frequency": peak.grid_frequency,
        "grid_step": peak.step,
        "power_before": peak.before / peak.largest,
        "power_behind": peak.behind / peak.largest,
    }
    return Step("fit", "fitted", numbers)


@cached_on_packing
def excess(packing: PackingData) -> Excess:
    """Compare the density of states of a packing with that of plane waves."""
    frequency, per_hertz, _ = density(packing)
    return excess_of(frequency, per_hertz, packing.network.degrees_of_freedom, f_max(packing))


@quantity("Hz", definition="highest natural frequency")
def highest_frequency(packing: PackingData) -> Value:
    """Measure the highest natural frequency by products with K; the residual bounds the error."""
    modes = highest(packing)
    frequency = float(modes.frequency[-1])
    residual = float(modes.residual[-1])
    steps = (Step("fit", "converged", {"residual": residual}),)
    return Value(frequency, "Hz", {"fit": residual * frequency / 2}, steps=steps)


@quantity(
    "Hz",
    definition="frequency at which D(f) / f^2 is largest: where soft modes are",
    spectrum="density",
)
def excess_peak(packing: PackingData) -> Value:
    """Measure the frequency of the boson peak; the error is half the width of a line."""
    if packing.crystal:
        return unknown("Hz", Caveat("no_soft_modes"))
    frequency, _, modes_below = density(packing)
    search = step_of_peak(packing)
    peak = search.numbers["peak"]
    line = search.numbers["resolution"]
    lowest = search.numbers["lowest"]
    if search.outcome == "no_maximum":
        caveat = Caveat("no_peak", {"frequency": hertz(lowest)})
        return unknown("Hz", caveat, *packing.of_one_sample, steps=(search,))
    first, last = np.interp([lowest, peak], frequency, modes_below)
    mode_numbers = {"modes_below": last - first, "needed": MIN_MODES_BELOW_PEAK}
    enough_modes = limit_step(mode_numbers, "modes_below", "needed", least=True)
    steps = (search, enough_modes)
    if enough_modes.outcome != "kept":
        values = {"needed": MIN_MODES_BELOW_PEAK, "frequency": hertz(peak)}
        return unknown("Hz", Caveat("few_modes", values), *packing.of_one_sample, steps=steps)
    return Value(peak, "Hz", {"resolution": line / 2}, packing.of_one_sample, steps=steps)


def step_of_peak(packing: PackingData) -> Step:
    """Return a step that describes the search for the largest D(f) / f^2."""
    frequency = density(packing)[0]
    peak = excess(packing).peak_frequency
    line = 4 * float(frequency[1] - frequency[0])
    numbers = {"resolution": line, "lowest": 2.5 * line, "peak": peak}
    if not np.isfinite(peak):
        return Step("limit", "no_maximum", numbers)
    return limit_step(numbers, "peak", "lowest", least=True)


@on_request("Hz", definition="of standing P-waves r = 1, 2, ... among the lowest modes")
def resonances(packing: PackingData) -> Value:
    """Find the frequencies of standing P-waves among the lowest modes.

    They are the frequencies of the pure modes of a crystal, else of the modes with the largest
    share of each wave.
    """
    modes, along_z, caveats = lowest_modes(packing)
    frequency = modes.resonance_frequency
    if packing.crystal and frequency is not None:
        search = Step("window", "read", {"waves": len(frequency)})
    else:
        standing_of_list = resonant.standing_modes(modes.frequency, along_z, packing.network)
        frequency = standing_of_list.frequency
        search = _step_of_standing(standing_of_list)
    steps = (step_of_modes(packing, modes), search)
    if not len(frequency):
        return unknown("Hz", Caveat("no_standing_wave"), *caveats, steps=steps)
    value = Value(np.asarray(frequency), "Hz", {}, steps=steps)
    return value.with_caveats(*packing.of_waves, *caveats)


def _step_of_standing(waves: resonant.Standing) -> Step:
    """Return a step that describes the search for standing waves up to the first missing one."""
    numbers = {
        "waves": len(waves.frequency),
        "share": waves.next_share,
        "limit": resonant.MIN_SHARE,
    }
    return limit_step(numbers, "share", "limit", least=True)
