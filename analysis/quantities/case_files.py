"""Measure what the files of a case give: modes, theory, gain, structure factor, density of states.

These quantities are measured on request, because most packings lack the files that they need.
"""

import numpy as np

from analysis.estimators.excess import Excess
from analysis.packing_data import PackingData
from analysis.quantities import gain, polarisation, scattering, spectrum, velocity
from analysis.quantities.case_quantity import case_quantity
from analysis.steps import Step
from analysis.value import Value, estimate

LOW_MODES_END_IN_F_MAX = 0.05
"""Share of the highest frequency below which modes move the spheres along z together; in the paper
10 of 216 kHz."""
HIGH_MODES_START_IN_F_MAX = 0.07
"""Share of the highest frequency above which modes no longer move the spheres along z together; in
the paper 15 of 216 kHz."""
LAST_RESONANCE_OF_CRYSTAL = 200
"""Order of the last P resonance of the paper's crystals, which have 200 layers."""


@case_quantity("1", "spheres")
def particles(packing: PackingData) -> float:
    """Return the number of spheres."""
    return packing.network.n_particles


@case_quantity("1", "length, D")
def length_over_d(packing: PackingData) -> float:
    """Return the length in mean diameters."""
    return packing.network.length / packing.diameter


@case_quantity("1", "width, D")
def width_over_d(packing: PackingData) -> float:
    """Return the width along x in mean diameters."""
    return packing.network.cell_size[0] / packing.diameter


@case_quantity("m/s", "V_P of first peaks, mean of columns and their scatter")
def v_p_first_peaks_columns(packing: PackingData) -> Value:
    """Measure V_P of first peaks along all columns of the linear wave."""
    mean, scatter = velocity.columns(packing, "linear")
    step = Step("fit", "fitted", {"velocity": mean, "scatter": scatter})
    return estimate(mean, scatter, steps=(step,))


@case_quantity("m/s", "2 L f_1 of the first resonance (Eqs. 3, 4)")
def v_p_modes_first(packing: PackingData) -> Value:
    """Measure V_P by the frequency of the first P resonance."""
    resonance = spectrum.resonance(packing, 1)
    length = packing.network.length
    velocity = 2 * length * resonance.value
    numbers = {"frequency": resonance.value, "packing_length": length, "velocity": velocity}
    return estimate(velocity, steps=(*resonance.steps, Step("window", "read", numbers)))


@case_quantity("m/s", "V_P of modes, kappa = pi r / L, by omega = V kappa (1 + b kappa^2)")
def v_p_modes_eq_4(packing: PackingData) -> Value:
    """Measure V_P by the standing waves among the modes, with their wave numbers by Eq. 4."""
    return spectrum.velocity_of_standing_waves(*spectrum.standing_waves(packing))


case_quantity("m/s", "V_P of modes, kappa fitted", "v_p_modes_fitted")(spectrum.modal_fitted)


@case_quantity("m/s", "V_P of even strains")
def v_p_emt_contacts(packing: PackingData) -> float:
    """Return V_P, m/s, if the mean strain is imposed on all contacts."""
    return packing.affine_velocity


@case_quantity("m/s", "V_P of the lattice")
def v_p_theory(packing: PackingData) -> float:
    """Return V_P, m/s, of the lattice of layers of a crystal."""
    return packing.lattice.velocity


@case_quantity("Hz", "highest natural frequency, of a list where there is one")
def f_max(packing: PackingData) -> Value:
    """Measure the highest natural frequency; a mode from a file has a residual as error."""
    lists = packing.case.read("highest.modes"), packing.case.read("modes")
    return spectrum.natural_frequency(spectrum.f_max(packing), *lists)


@case_quantity("1", "spheres that move there")
def f_max_spheres(packing: PackingData) -> float:
    """Count the spheres that take part in the highest mode."""
    return spectrum.highest_seat(packing)[0]


@case_quantity("1", "contacts of the first")
def f_max_contacts(packing: PackingData) -> float:
    """Count the contacts of the sphere that moves most in the highest mode."""
    return spectrum.highest_seat(packing)[1]


@case_quantity("Hz", "lowest natural frequency")
def f_min(packing: PackingData) -> Value:
    """Measure the lowest natural frequency of a file with modes."""
    modes = packing.case.needed("modes")
    return spectrum.natural_frequency(modes.frequency[0], modes)


@case_quantity("Hz", "first P resonance")
def f_1(packing: PackingData) -> Value:
    """Measure the frequency of the first P resonance."""
    return spectrum.resonance(packing, 1)


@case_quantity("Hz", "200th P resonance of a crystal")
def f_200(packing: PackingData) -> Value:
    """Measure the frequency of the last P resonance of a crystal."""
    packing.require_crystal()
    return spectrum.resonance(packing, LAST_RESONANCE_OF_CRYSTAL)


@case_quantity("1", "number of P resonances")
def resonances_found(packing: PackingData) -> float:
    """Count the P resonances of a file with modes."""
    packing.case.needed("modes")
    return len(spectrum.standing_waves(packing)[0])


@case_quantity("Hz", "end of a crystal's band, modes")
def band_edge_modes(packing: PackingData) -> Value:
    """Measure the frequency at which a crystal's band ends, by its modes."""
    dispersion = spectrum.modal_dispersion(packing)
    step = spectrum.step_of_dispersion(dispersion)
    return estimate(dispersion.low_pass_frequency, steps=(step,))


@case_quantity("Hz", "end of a crystal's band, lattice")
def band_edge_theory(packing: PackingData) -> float:
    """Return the frequency, Hz, at which the band of a crystal's lattice ends."""
    return packing.lattice.low_pass_frequency


@case_quantity("1", "highest mode without rotations over it")
def translations_only_over_edge(packing: PackingData) -> float:
    """Divide the highest frequency without rotations by that of the lattice's band edge."""
    highest = packing.case.needed("translations.modes").frequency[-1]
    return float(highest / packing.lattice.low_pass_frequency)


@case_quantity("1", "largest chi_z of the chain's modes below 0.05 f_max")
def chi_z_low(packing: PackingData) -> Value:
    """Measure the largest chi_z of the chain among low modes."""
    return _largest_chi(packing, 0.0, LOW_MODES_END_IN_F_MAX)


@case_quantity("1", "largest of them above 0.07 f_max")
def chi_z_high(packing: PackingData) -> Value:
    """Measure the largest chi_z of the chain among high modes."""
    return _largest_chi(packing, HIGH_MODES_START_IN_F_MAX, np.inf)


@case_quantity("1", "the same of all spheres")
def chi_z_high_all(packing: PackingData) -> Value:
    """Measure the largest chi_z of all spheres among high modes."""
    return _largest_chi(packing, HIGH_MODES_START_IN_F_MAX, np.inf, chain=False)


@case_quantity("1", "mean chi_z there")
def chi_z_high_mean(packing: PackingData) -> Value:
    """Measure the mean chi_z of the chain among high modes."""
    lowest = HIGH_MODES_START_IN_F_MAX * spectrum.f_max(packing)
    return polarisation.mean_chi(packing, lowest, np.inf)


case_quantity("Hz", "highest frequency of a mode with chi_z above 0.9", "chi_z_pure")(
    polarisation.last_pure
)


@case_quantity("1", "largest gain", spectrum="response")
def gain_maximum(packing: PackingData) -> Value:
    """Measure the largest gain: stress at the receiver wall divided by that at the source wall."""
    response = gain.gain_of(packing)
    return estimate(float(np.max(response.gain)), steps=(gain.step_of_gain(response),))


@case_quantity("Hz", "width of its lines", spectrum="response")
def gain_resolution(packing: PackingData) -> Value:
    """Return the full width of a resonance's line in the gain."""
    response = gain.gain_of(packing)
    return estimate(response.resolution, steps=(gain.step_of_gain(response),))


case_quantity("1", "mean free path there, D", "free_path_at_f_low_pass_over_d")(
    scattering.free_path
)
case_quantity("1", "power of f in the ridge's width there", "ridge_width_power")(
    scattering.width_power
)


@case_quantity("Hz", "the Ioffe-Regel frequency of a kept structure factor")
def ioffe_regel_of_ridge(packing: PackingData) -> Value:
    """Measure the Ioffe-Regel frequency from a file with the structure factor."""
    ridge = scattering.whole_ridge(packing)
    return estimate(ridge.limit, steps=(scattering.step_of_limit(ridge),))


@case_quantity("1", "D f_max^3 / f^2 at 0.1 f_max")
def excess_at_a_tenth(packing: PackingData) -> Value:
    """Measure the density of states at a tenth of the highest frequency."""
    return estimate(_excess(packing).at_a_tenth, steps=_steps_of_density(packing))


@case_quantity("1", "largest D f_max^3 / f^2")
def excess_largest(packing: PackingData) -> Value:
    """Measure the largest ratio of the density of states to that of plane waves."""
    return estimate(_excess(packing).peak, steps=_steps_of_density(packing))


@case_quantity("Hz", "where it is")
def excess_largest_at(packing: PackingData) -> Value:
    """Measure the frequency of the largest ratio of density of states to plane waves."""
    return estimate(_excess(packing).peak_frequency, steps=_steps_of_density(packing))


def _largest_chi(packing: PackingData, low: float, high: float, chain: bool = True) -> Value:
    """Measure the largest chi_z of modes between two shares of the highest frequency."""
    highest = spectrum.f_max(packing)
    return polarisation.measure_largest_chi(packing, low * highest, high * highest, chain)


def _excess(packing: PackingData) -> Excess:
    """Return the excess of a density of states in a file; AbsentError without the file."""
    packing.case.needed("density")
    return spectrum.excess(packing)


def _steps_of_density(packing: PackingData) -> tuple[Step]:
    """Return a step that describes the search for the largest excess in a file's density."""
    return (spectrum.step_of_peak(packing),)
