"""`measure` on the command line, and means over packings."""

import json

import numpy as np
import pytest
from packings import slender
from places import ROOT

import analysis
import modal
from analysis.__main__ import main
from analysis.measurement import Measurement, mean_of
from analysis.quantities import QUICK
from analysis.value import Value, unknown
from modal.packing.network import write_network


def test_cell_without_walls_has_velocities_by_its_moduli(printed):
    """Measure by moduli; some quick quantities that are named need walls: status 3."""
    packing = ROOT / "examples/packings/triaxial.network.h5"
    values = printed("measure", packing, "--quick", main=main, status=3)
    assert values["v_p"]["value"] > 0
    assert "no_walls" in values["v_p"]["codes"]
    assert values["low_pass"]["value"] is None
    assert values["low_pass"]["codes"] == ["no_walls"]


SEEDS = 3, 4


@pytest.fixture(scope="module")
def paths(tmp_path_factory) -> list[str]:
    """Return the files of two packings that differ in their seeds."""
    folder = tmp_path_factory.mktemp("seeds")
    paths = [str(folder / f"seed{seed}.network.h5") for seed in SEEDS]
    for path, seed in zip(paths, SEEDS, strict=True):
        write_network(path, slender(seed))
    return paths


def test_quick_quantities_of_a_file_are_printed(tmp_path, printed):
    """Measure a crystal that is long enough for each of them."""
    path = tmp_path / "crystal.network.h5"
    write_network(path, modal.fcc(cells=(1, 1, 200)))
    values = printed("measure", path, "--quick", main=main)
    assert set(values) == set(QUICK)
    assert set(values["v_p"]) == {"value", "error", "unit", "parts", "caveats", "codes"}
    assert values["v_p"]["unit"] == "m/s"
    assert values["void_ratio"]["error"] == 0


def test_mean_over_files_has_its_standard_error(paths, printed):
    """Find the larger of the scatter's standard error and that of the single errors.

    The error by a short length is the same for both packings, and no mean makes it less.
    """
    several = printed("measure", *paths, "--quantities", "v_p", main=main)
    assert set(several) == {*paths, "mean"}
    velocities = [several[path]["v_p"] for path in paths]
    values = [velocity["value"] for velocity in velocities]
    mean = several["mean"]["v_p"]
    assert mean["value"] == pytest.approx(np.mean(values))
    assert mean["scatter"] == pytest.approx(np.std(values, ddof=1))
    length = max(velocity["parts"]["length"] for velocity in velocities)
    independent = [
        velocity["error"] ** 2 - velocity["parts"]["length"] ** 2 for velocity in velocities
    ]
    single_errors = np.hypot(np.sqrt(sum(independent)) / 2, length)
    assert mean["error"] == pytest.approx(max(single_errors, mean["scatter"] / np.sqrt(2)))
    assert "one_sample" not in mean["codes"]


def test_file_has_the_same_numbers_alone_and_among_others(paths, printed):
    several = printed("measure", *paths, "--quantities", "v_p", main=main)
    alone = printed("measure", paths[0], "--quantities", "v_p", main=main)
    assert several[paths[0]] == alone


def test_some_unknown_quantity_of_those_requested_is_status_3(paths):
    command = ["measure", paths[0], "--quantities", "coordination", "even_part"]
    assert main(command) == 3


def test_absent_file_is_refused(tmp_path, one_line):
    one_line(main, ["measure", tmp_path / "none.h5"], "none.h5", code="no_file")


def test_output_file_has_what_is_printed(paths, tmp_path, printed):
    command = ["measure", paths[0], "--quantities", "void_ratio", "chi_z"]
    values = printed(*command, "-o", tmp_path / "a.json", main=main)
    assert json.loads((tmp_path / "a.json").read_text()) == values


def test_mean_of_short_packings_keeps_the_error_of_their_length():
    """Average the fit's error away, but not what a short length does to each sample."""
    measurement = analysis.measure(slender(), quantities="v_p")
    velocity = measurement["v_p"]
    mean = mean_of([measurement, measurement])["v_p"]
    assert "short" in mean.codes
    assert mean.parts["length"] == 0.15 * mean.value
    assert mean.error**2 + mean.parts["fit"] ** 2 == pytest.approx(velocity.error**2)


def test_mean_with_an_unknown_value_is_that_of_one_sample():
    measurement = analysis.measure(slender(), quantities="v_p")
    mean = mean_of([measurement, {"v_p": unknown("m/s")}])["v_p"]
    assert mean.error == pytest.approx(measurement["v_p"].error)
    assert "one_sample" in mean.codes


@pytest.mark.parametrize(
    ("lists", "expected", "error"),
    [
        # Standard errors: the scatter of 1 and 3, and of 2 and 6, divided by sqrt(2), or the fit's.
        ([[1.0, 2], [3.0, 6, 9]], [2, 4], [2**0.5, 2]),
        ([[1.0, 2], [np.nan]], [1, 2], [2, 2]),
    ],
    ids=["lists of two lengths", "an unknown list"],
)
def test_mean_of_lists_is_that_of_common_entries(lists, expected, error):
    measurements = [
        Measurement({"f": Value(np.array(values), "Hz", {"fit": 2.0})}) for values in lists
    ]
    mean = mean_of(measurements)["f"]
    assert mean.value == pytest.approx(np.array(expected, float))
    assert mean.error == pytest.approx(np.array(error, float))
