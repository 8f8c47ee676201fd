"""Numbers in the steps of an explanation beside the value, its error and its frequencies."""

from dataclasses import replace

import numpy as np
import pytest
from changes import mirrored
from packings import slender, slim

import analysis
import modal
from analysis.__main__ import main
from analysis.case import Case
from analysis.estimators.resonances import MIN_SHARE
from analysis.estimators.structure_factor import structure_factor, write_structure
from analysis.mean import mean_of_values
from analysis.packing_data import PackingData
from analysis.quantities import QUANTITIES
from analysis.quantities.case_files import HIGH_MODES_START_IN_F_MAX, LOW_MODES_END_IN_F_MAX
from analysis.value import Value
from modal.modes.density import density_of_states, write_density
from modal.modes.mode_set import write_modes
from modal.packing.network import write_network
from modal.packing.precision import OVERLAP_ERROR
from modal.waves.response import frequency_response, write_response


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    """Return a random packing with files of all its modes and of its spectra, as a case has."""
    network = slim()
    modes = modal.eigenmodes(network, all=True)
    highest = float(modes.frequency[-1])
    structure = structure_factor(network, np.arange(1, 13), 0.02 * highest, 0.5 * highest)
    folder = tmp_path_factory.mktemp("case")
    write_network(folder / "case01.network.h5", network)
    write_modes(folder / "case01.modes.h5", modes)
    write_structure(folder / "case01.structure.h5", structure)
    write_density(folder / "case01.density.h5", density_of_states(network))
    response = frequency_response(network, resolution=0.01 * highest)
    write_response(folder / "case01.response.h5", response)
    return PackingData(network, case=Case("case01", folder))


def measure(packing, name):
    """Measure a quantity of a packing by its name; it must be known."""
    value = QUANTITIES[name].measured(packing)
    assert value.known
    return value


def numbers_of(value, row=-1):
    """Return the numbers of a step of a value, by default of the last one."""
    return value.steps[row].numbers


def test_gain_is_read_over_its_frequencies_and_at_its_first_maximum(packing):
    """Find the summit of a parabola at or above the highest of its three points."""
    gain = measure(packing, "gain")
    numbers = numbers_of(gain)
    assert numbers["frequencies"] == len(gain.value)
    assert [numbers["lowest"], numbers["highest"]] == gain.at[[0, -1]].tolist()
    first = np.argmin(abs(gain.at - numbers["first_gain_frequency"]))
    top = gain.value[first]
    assert top == gain.value[first - 1 : first + 2].max()
    assert top <= numbers["first_gain"]


def test_lines_of_the_gain_have_the_width_of_its_step(packing):
    resolution = measure(packing, "gain_resolution")
    assert numbers_of(resolution)["resolution"] == resolution.value


def test_resonances_end_at_a_wave_that_belongs_to_no_mode(packing):
    resonances = measure(packing, "resonances")
    in_list, search = resonances.steps
    assert in_list.outcome == "complete"
    assert search.numbers["waves"] == len(resonances.value)
    assert (search.outcome, search.numbers["limit"]) == ("fallen_short", MIN_SHARE)
    assert 0 < search.numbers["share"] < MIN_SHARE


def test_chi_z_has_a_number_for_each_mode_of_its_list(packing):
    chi_z = measure(packing, "chi_z")
    (step,) = chi_z.steps
    assert step.numbers["modes"] == step.numbers["all_modes"] == len(chi_z.value)
    assert [step.numbers["lowest"], step.numbers["highest"]] == chi_z.at[[0, -1]].tolist()


def test_list_of_few_modes_ends_early():
    value = analysis.measure(slim(), quantities="chi_z")["chi_z"]
    (step,) = value.steps
    assert step.outcome == "ends_early"
    assert step.numbers["modes"] == len(value.value) < step.numbers["all_modes"]


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("chi_z_low", 0.0, LOW_MODES_END_IN_F_MAX),
        ("chi_z_high_mean", HIGH_MODES_START_IN_F_MAX, np.inf),
    ],
)
def test_chi_z_of_an_interval_counts_its_modes(name, low, high, packing):
    frequency = packing.case.read("modes").frequency
    inside = frequency[(frequency > low * frequency[-1]) & (frequency < high * frequency[-1])]
    numbers = numbers_of(measure(packing, name))
    assert numbers["modes"] == len(inside)
    assert (numbers["lowest"], numbers["highest"]) == (inside[0], inside[-1])


@pytest.mark.parametrize("name", ["f_max", "f_min", "f_1"])
def test_error_of_a_natural_frequency_is_half_of_its_residual(name, packing):
    frequency = measure(packing, name)
    expected = 0.5 * numbers_of(frequency)["residual"] * frequency.value
    # A soft mode may be unstable by round-off: its frequency is negative, its error is not.
    assert frequency.error == pytest.approx(abs(expected))


def test_velocity_of_the_first_resonance_is_twice_length_times_frequency(packing):
    velocity = measure(packing, "v_p_modes_first")
    numbers = numbers_of(velocity)
    product = 2 * numbers["packing_length"] * numbers["frequency"]
    assert velocity.value == pytest.approx(product)


def test_velocity_of_standing_waves_is_that_of_its_fit(packing):
    velocity = measure(packing, "v_p_modes_eq_4")
    numbers = numbers_of(velocity)
    assert (numbers["velocity"], numbers["error"]) == (velocity.value, velocity.error)
    assert numbers["frequencies"] >= numbers["needed"]


def test_largest_excess_is_unknown_if_it_is_at_the_lowest_frequency(packing):
    """Read no frequency below 2.5 widths of a line."""
    at_a_tenth = measure(packing, "excess_at_a_tenth")
    (step,) = at_a_tenth.steps
    assert step.outcome == "no_maximum"
    assert step.numbers["lowest"] == 2.5 * step.numbers["resolution"]
    largest = QUANTITIES["excess_largest_at"].measured(packing)
    assert not largest.known
    assert largest.explain().as_json()["steps"] == [step.as_json()]


@pytest.fixture(scope="module")
def crystal():
    """Return a crystal that is long enough for the paper's rule."""
    return PackingData(modal.fcc(cells=(1, 1, 100)))


def test_threshold_of_a_crystal_lies_above_its_band_where_no_wave_travels(crystal):
    """Show the upward bias of the 2 % rule in the frequency and in both ends of its interval."""
    edge = measure(crystal, "f_low_pass_2_linear")
    wavelength = QUANTITIES["lambda_2_linear_over_d"].measured(crystal)
    assert not wavelength.known
    assert wavelength.steps[: len(edge.steps)] == edge.steps
    *_, main, low, high = wavelength.steps
    assert main.outcome == "does_not_travel"
    assert main.numbers["frequency"] == edge.value > measure(crystal, "band_edge_linear").value
    assert high.numbers["frequency"] - low.numbers["frequency"] == pytest.approx(2 * edge.error)


def test_band_edge_of_a_record_is_that_of_its_fit(crystal):
    edge = measure(crystal, "band_edge_linear")
    assert numbers_of(edge)["band_edge"] == edge.value


def test_wavelength_at_a_band_edge_is_that_of_its_fit(crystal):
    wavelength = measure(crystal, "lambda_edge_linear_over_d")
    numbers = numbers_of(wavelength)
    assert numbers["edge_wavelength"] / numbers["diameter"] == pytest.approx(wavelength.value)
    # The edge of the ridge lies within the resolution of the record, 1 / T, of the fitted one.
    resolution = 1 / crystal.linear.time[-1]
    fitted_edge = measure(crystal, "band_edge_linear").value
    assert numbers["frequency"] == pytest.approx(fitted_edge, abs=resolution)


def test_wavelength_of_a_record_without_an_edge_says_so(crystal):
    """Measure a record of noise, in which no wave travels forward."""
    random = np.random.default_rng(1)
    motion = random.standard_normal(crystal.linear.chain_displacement.shape)
    noise = replace(crystal.linear, chain_displacement=motion)
    packing = PackingData(crystal.network, linear_record=noise)
    value = QUANTITIES["lambda_edge_linear_over_d"].measured(packing)
    assert not value.known
    assert value.steps[-1].outcome == "no_reversal"


def test_stress_error_is_the_largest_of_three_deviations():
    network = slim()
    network = replace(network, study={**network.study, "stress": 1.1e5})
    value = analysis.measure(network, quantities="stress_error")["stress_error"]
    numbers = numbers_of(value)
    stresses = np.array([numbers[f"stress_{axis}"] for axis in "xyz"])
    assert numbers["stated_stress"] == 1.1e5
    assert value.value == pytest.approx(abs(stresses / 1.1e5 - 1).max())


def test_first_resonance_of_a_ridge_is_the_summit_of_three_powers(packing):
    """Read a packing that has a structure factor and no modes."""
    structure = packing.case.read("structure")
    case = Case("case01", packing.case.folder, {}, contents={"structure": structure})
    value = QUANTITIES["f_1"].measured(PackingData(packing.network, case=case))
    numbers = numbers_of(value)
    assert numbers["standing_wave"] == 1
    before = np.log(numbers["power_before"])
    behind = np.log(numbers["power_behind"])
    shift = (before - behind) / (before + behind) / 2
    expected = numbers["grid_frequency"] + shift * numbers["grid_step"]
    assert value.value == pytest.approx(expected)
    # A mode makes each line, so that one lies within the width of the line.
    assert abs(value.value - packing.case.read("modes").frequency).min() < numbers["resolution"]


def test_mean_and_its_error_follow_from_the_samples():
    """Compute both from the numbers that are printed of each sample, by the rule of means."""
    values = [
        Value(500.0, "m/s", {"fit": 6.0, "length": 2.0}),
        Value(520.0, "m/s", {"fit": 8.0, "length": 3.0}),
        Value(507.0, "m/s", {"fit": 5.0}),
    ]
    mean = mean_of_values(values)
    *samples, of_mean = mean.steps
    speeds, errors, shared = np.transpose(
        [
            [step.numbers[name] for name in ("sample_value", "sample_error", "shared_error")]
            for step in samples
        ]
    )
    assert mean.value == pytest.approx(speeds.mean())
    assert of_mean.numbers["averaged_samples"] == len(values)
    assert of_mean.numbers["sample_scatter"] == pytest.approx(np.std(speeds, ddof=1))
    independent = np.sqrt((errors**2).sum()) / len(values)
    between_samples = np.std(speeds, ddof=1) / np.sqrt(len(values))
    by_rule = max(np.hypot(independent, shared.max()), between_samples)
    assert mean.error == pytest.approx(by_rule)
    assert {step.units["sample_value"] for step in samples} == {"m/s"}


def test_mean_over_frequency_says_which_frequencies_its_samples_have():
    first = Value(np.array([1.0, 2.0]), "1/m", {}, at=np.array([1e3, 2e3]))
    second = Value(np.array([1.0, 2.0, np.nan]), "1/m", {}, at=np.array([5e2, 1e3, 3e3]))
    steps = mean_of_values([first, second]).steps
    assert [step.numbers.get("values") for step in steps] == [2, 2, None]
    assert [step.numbers.get("highest") for step in steps] == [2e3, 3e3, None]


def test_explained_mean_of_two_files_is_printed_with_them(tmp_path, printed, capsys):
    network = slender()
    paths = []
    for number, sample in enumerate([network, mirrored(network)]):
        paths.append(str(tmp_path / f"sample{number}.network.h5"))
        write_network(paths[-1], sample)
    command = ["measure", *paths, "--explain", "coordination"]
    explained = printed(*command, main=main)
    assert list(explained) == [*paths, "mean"]
    *samples, _ = explained["mean"]["coordination"]["steps"]
    values = [explained[path]["coordination"]["value"] for path in paths]
    assert [step["numbers"]["sample_value"] for step in samples] == values
    assert main(command) == 0
    assert "\nmean\ncoordination: " in capsys.readouterr().out


def test_digits_of_a_packing_are_the_last_step():
    network = slim()
    rounded = replace(network, study={**network.study, OVERLAP_ERROR: 0.05})
    value = analysis.measure(rounded, quantities="coordination")["coordination"]
    numbers = numbers_of(value)
    assert numbers["overlap_error"] == 0.05
    assert value.parts["digits"] == pytest.approx(numbers["relative_error"] * value.value)
