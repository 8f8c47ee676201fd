"""A study from its results: tables, missing cases, one page."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from exact_crystal import CHAIN, write_crystal
from packings import random_sample, slender
from places import ROOT

from analysis.__main__ import main
from analysis.frame import frame_of
from analysis.quantities.spectrum import natural_frequency
from analysis.result_file import read_results
from analysis.study.description import Study
from analysis.study.rules import Rules
from analysis.study.tables import make_tables, tabulate_all_numbers
from analysis.study.targets import answer_targets, tabulate_targets
from modal.modes.eigenmodes import modes_of
from modal.packing.network import write_network
from modal.packing.state import void_ratio
from modal.system.linear_system import LinearSystem

PAPER = ROOT / "studies/otsubo2017/study.yaml"
NEEDED = {
    *("case", "mu_comp", "stress_pa", "void_ratio", "coordination_number"),
    *("v_p_first_peaks_m_per_s", "f_low_pass_2_khz", "f_low_pass_1_khz"),
    *("lambda_2_over_d", "lambda_1_over_d", "f_max_khz"),
}


@pytest.fixture(scope="module")
def paper() -> Study:
    return Study(PAPER)


def read(path: Path) -> list[dict[str, str]]:
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The study of two crystals, one of them with a run, and a packing twice; its results."""
    folder, output = tmp_path_factory.mktemp("products"), tmp_path_factory.mktemp("study")
    results = folder / "results"
    for case, stress in (("case02", 1e5), ("case03", 1e6)):
        write_crystal(folder, case, stress, recorded=case == "case02")
    write_network(folder / "case06.network.h5", slender())
    (folder / "seed_2").mkdir()
    write_network(folder / "seed_2/case06.network.h5", slender(4))
    command = ["study", str(PAPER), "--products"]
    for case in ("case02", "case03", "case06"):
        name = ["--measure", case, "-o", str(results / f"{case}.json")]
        assert main([*command, str(folder), *name]) == 0
    seed = ["--scatter", "--measure", "case06", "-o", str(results / "seed_2/case06.json")]
    assert main([*command, str(folder / "seed_2"), *seed]) == 0
    whole = ["study", str(PAPER), "--results", str(results), "-o", str(output)]
    assert main(whole) == 3  # cases are missing
    return output, results


def test_files_have_the_columns_that_others_read(made):
    rows = read(made[0] / "table1.csv")
    assert [row["case"] for row in rows] == ["2", "3", "6"]
    columns = set(rows[0])
    assert columns >= NEEDED and columns >= {f"{n}_error" for n in NEEDED if n.startswith("v_p")}
    found = read(made[0] / "targets.csv")
    assert list(found[0]) == ["id", "value", "error", "target", "rule", "met", "why"]
    assert len(found) == len({row["id"] for row in found}) == 32
    assert {row["met"] for row in found} <= {"yes", "no"}
    assert all(row["why"] for row in found)


def test_numbers_of_the_crystal(made):
    """Known answers: the record is the exact lattice's, the void ratio that of touching spheres."""
    row = read(made[0] / "table1.csv")[0]
    for name, exact, rel in (
        ("f_low_pass_2_khz", CHAIN.low_pass_frequency / 1e3, 0.01),
        ("v_p_first_peaks_m_per_s", CHAIN.velocity, 0.013),
        ("v_p_static_m_per_s", CHAIN.velocity, 1e-3),
        ("lambda_edge_linear_over_d", 2**0.5, 5e-3),
        ("void_ratio", 0.353, 1.5e-3),
    ):
        assert float(row[name]) == pytest.approx(exact, rel=rel), name
    met = {row["id"]: row for row in read(made[0] / "targets.csv")}
    assert met["fcc_flow_theory"]["met"] == "yes" and met["fcc_e"]["met"] == "yes"
    assert met["fcc_f_200"]["met"] == "no" and "modes" in met["fcc_f_200"]["why"]
    # Two of four crystals: the exponent is there, and said to be of two.
    assert float(met["fcc_b"]["value"]) == pytest.approx(1 / 6, abs=2e-3)
    assert met["fcc_b"]["met"] == "no" and "no packing of case 1, 4" in met["fcc_b"]["why"]
    assert met["rnd_e_22"]["value"] == "" and "no packing of case 22" in met["rnd_e_22"]["why"]


def test_another_sample_of_a_case_gives_it_an_error(made):
    """The folder seed_2 holds case 6 alone: two samples of it, one of the crystals."""
    rows = {row["case"]: row for row in read(made[0] / "table1.csv")}
    assert [rows[n]["packings"] for n in ("2", "3", "6")] == ["1", "1", "2"]
    e = [void_ratio(slender(seed)) for seed in (3, 4)]
    found = float(rows["6"]["void_ratio_sample_error"])
    assert found == pytest.approx(abs(e[0] - e[1]) / 2**0.5, rel=0.01)
    assert rows["2"]["void_ratio_sample_error"] == ""


def test_page_says_what_is_missing_and_stands_alone(made):
    page = (made[0] / "study.html").read_text()
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    assert "3 of 32 cases are there" in page and "No result of case 1, 4-5, 7-32" in page
    drawn = {path.stem for path in made[0].glob("*.png")}
    assert {"fig02_source", "fig06_velocity", "fig12_spectra", "fig19_gain"} <= drawn


def test_a_case_is_shown_beside_theory_and_what_is_stated(made, capsys):
    shown = ["study", str(PAPER), "--results", str(made[1]), "--case"]
    assert main([*shown, "case02"]) == 0
    text = capsys.readouterr().out
    line = next(line for line in text.splitlines() if line.startswith("void ratio"))
    assert "0.353" in line and "theory" in text
    assert main([*shown, "case09"]) == 2


def test_committed_tables_are_those_of_the_committed_results(paper):
    """No table goes stale: all numbers and targets are made again from one JSON a case."""
    rows = read_results(ROOT / "results/study/cases")
    frame = frame_of(rows, paper.cases)
    assert frame["there"].all()
    rules = Rules(frame, paper.stated())
    found = [tabulate_all_numbers(frame), tabulate_targets(answer_targets(paper, frame))]
    found += make_tables(paper.part("tables"), rules)
    for table in found:
        with open(ROOT / f"results/study/{table.name}.csv", newline="") as file:
            header, *lines = csv.reader(file)
        assert list(table.header) == header and [list(row) for row in table.rows] == lines, (
            f"{table.name}: python -m analysis study studies/otsubo2017/study.yaml --results "
            "results/study/cases -o results/study"
        )


def test_the_library_knows_no_study():
    for path in (ROOT / "analysis").rglob("*.py"):
        assert "otsubo2017" not in path.read_text(), path


def test_errors_of_natural_frequencies_hold_the_exact_ones():
    """The error from the residual is a bound: the dense spectrum is within it."""
    network = random_sample(60, 1e5, seed=3).network()
    exact = modes_of(LinearSystem.of(network), all=True).frequency[-1]
    found = modes_of(LinearSystem.of(network), highest=1, certify=False)
    own = natural_frequency(float(found.frequency[-1]), found)
    assert np.isfinite(own.error)
    assert abs(own.value - exact) <= own.error + 1e-12 * own.value


def test_no_results_are_a_mistake_of_the_user(tmp_path, one_line):
    results = ["--results", tmp_path, "-o", tmp_path / "out"]
    one_line(main, ["study", PAPER, *results], code="no_results")
    one_line(main, ["study", PAPER, "--results", tmp_path / "none"], code="no_folder")
    one_line(main, ["study", tmp_path / "none.yaml", *results], code="no_file")
    assert not (tmp_path / "out").exists()
