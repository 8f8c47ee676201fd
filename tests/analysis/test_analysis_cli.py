"""The command line of analysis, in-process: products in, table and figures out, errors."""

from pathlib import Path

import pytest
from exact_crystal import write_crystal
from study_folder import measured

from analysis.__main__ import main
from modal.packing.crystal import fcc


@pytest.fixture(scope="module")
def products(tmp_path_factory) -> Path:
    """Return a folder with the network and the record of case 2, and the network of case 3."""
    folder = tmp_path_factory.mktemp("products")
    write_crystal(folder, "case02")
    write_crystal(folder, "case03", 1e6, recorded=False)
    return folder


@pytest.fixture(scope="module")
def comparison(products) -> dict[str, dict[str, str]]:
    """Return the rows of case 2 beside theory: what theory, modes, linear wave and YADE give."""
    columns = ("theory", "modal", "linear", "yade", "note")
    rows = measured("case02", products).tables["comparison"]
    return {row[1]: dict(zip(columns, row[3:], strict=True)) for row in rows}


def test_band_edge_of_the_record_is_that_of_theory(comparison):
    edge = comparison["f_low-pass"]
    assert edge["modal"] == ""
    assert float(edge["yade"]) == pytest.approx(float(edge["theory"]), rel=2e-3)


def test_velocity_of_the_linear_wave_is_that_of_theory(comparison):
    """Compare within the bias of the damped transform, which is below 1e-5."""
    velocity = comparison["V_P, long waves"]
    assert float(velocity["linear"]) == pytest.approx(float(velocity["theory"]), rel=1e-5)


def test_pre_stress_has_its_own_row(comparison):
    """Find a difference from theory of at most N / (kn D) = 2/3 overlap / D."""
    row = comparison["V_P, long waves, with pre-stress"]
    crystal = fcc(cells=(1, 1, 4))
    overlap = crystal.overlap.max() / (2 * crystal.radius[0])
    theory = float(comparison["V_P, long waves"]["theory"])
    assert 0 < abs(float(row["linear"]) / theory - 1) < 2 / 3 * overlap
    assert row["theory"] == row["yade"] == ""
    assert "tangent" in row["note"]


def test_void_ratio_is_of_the_packing_with_or_without_a_run(comparison):
    void_ratio = comparison["void ratio, wall to wall"]
    assert void_ratio["yade"] == ""
    assert void_ratio["modal"]


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        pytest.param(["figure"], "command_line", id="no name"),
        pytest.param(["figure", "gain_cases", "x"], "no_file", id="absent packing"),
        pytest.param(["figure", "nothing", "NETWORK"], "unknown_word", id="unknown figure"),
        pytest.param(["figure", "chi_z"], "no_file", id="no packing"),
        pytest.param(["figure", "absent.csv"], "no_file", id="absent figure"),
        pytest.param(["figure", "chi_z", "NETWORK"], "absent", id="no modes"),
        pytest.param(["study", "NETWORK"], "no_file", id="no study"),
    ],
)
def test_bad_input_is_one_line(products, tmp_path, one_line, arguments, code):
    if len(arguments) > 1:
        network = products / "case02.network.h5"
        arguments = [network if word == "NETWORK" else word for word in arguments]
        arguments += ["-o", tmp_path]
    one_line(main, arguments, code=code)
