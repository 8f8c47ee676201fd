"""The command line of analysis, in-process: products in, table and figures out, errors."""

import pytest
from exact_crystal import write_crystal
from study_folder import measured

from analysis.__main__ import main
from modal.packing.crystal import fcc


@pytest.fixture(scope="module")
def products(tmp_path_factory):
    """Case 2: network and signals; case 3: only the network."""
    folder = tmp_path_factory.mktemp("products")
    write_crystal(folder, "case02")
    write_crystal(folder, "case03", 1e6, recorded=False)
    return folder


def test_linear_is_one_thing_and_its_pre_stress_has_its_own_row(products):
    """Without pre-stress the linear wave's V_P is theory's; the pre-stress row may differ from it.

    By the ratio of normal force to stiffness and distance, N / (kn D) = 2/3 overlap / D, at most.
    The damped transform's own bias is below 1e-5.
    """
    lines = measured("case02", products).tables["comparison"]
    head = ("theory", "modal", "linear", "yade", "note")
    rows = {line[1]: dict(zip(head, line[3:], strict=True)) for line in lines}
    edge, void = rows["f_low-pass"], rows["void ratio, wall to wall"]
    assert edge["modal"] == ""
    assert float(edge["yade"]) == pytest.approx(float(edge["theory"]), rel=2e-3)
    theory = float(rows["V_P, long waves"]["theory"])
    full = rows["V_P, long waves, with pre-stress"]
    crystal = fcc(cells=(1, 1, 4))
    overlap = crystal.overlap.max() / (2 * crystal.radius[0])
    assert float(rows["V_P, long waves"]["linear"]) == pytest.approx(theory, rel=1e-5)
    assert 0 < abs(float(full["linear"]) / theory - 1) < 2 / 3 * overlap
    assert full["theory"] == full["yade"] == "" and "tangent" in full["note"]
    assert void["yade"] == "" and void["modal"]  # a property of the packing, with or without a run


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
