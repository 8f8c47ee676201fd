"""A study from its results: tables, missing cases, one page."""

import base64
import csv
import re
import shutil
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml
from exact_crystal import CHAIN, write_crystal
from packings import random_sample, slender
from places import ROOT

from analysis.__main__ import main
from analysis.case_columns import OF_RECORD
from analysis.figures.picture import read_picture
from analysis.frame import frame_of
from analysis.quantities.spectrum import natural_frequency
from analysis.result_file import read_results
from analysis.study.captions import UNKNOWN, Captions
from analysis.study.description import Study
from analysis.study.rules import Rules
from analysis.study.tables import make_tables, tabulate_all_numbers
from analysis.study.targets import answer_targets, tabulate_targets
from analysis.table import number
from modal.modes.eigenmodes import modes_of
from modal.packing.network import write_network
from modal.packing.state import void_ratio
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError

PAPER = ROOT / "studies/otsubo2017/study.yaml"
VELOCITY_COLUMN = "v_p_first_peaks_m_per_s"
REQUIRED_COLUMNS = {
    "case",
    "mu_comp",
    "stress_pa",
    "void_ratio",
    "coordination_number",
    VELOCITY_COLUMN,
    f"{VELOCITY_COLUMN}_error",
    "f_low_pass_2_khz",
    "f_low_pass_1_khz",
    "lambda_2_over_d",
    "lambda_1_over_d",
    "f_max_khz",
}
"""Columns of table 1 that other programs read."""
DRAWN_FIGURES = {"fig02_source", "fig06_velocity", "fig12_spectra", "fig19_gain"}
"""Figures of the page: of one case, of all cases, and of panels put together."""


@pytest.fixture(scope="module")
def paper() -> Study:
    return Study(PAPER)


def read_rows(path: Path) -> list[dict[str, str]]:
    """Read the rows of a table."""
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    """Return the results of two crystals, one with a record, and of two samples of case 6."""
    products = tmp_path_factory.mktemp("products")
    for case, stress in (("case02", 1e5), ("case03", 1e6)):
        write_crystal(products, case, stress, recorded=case == "case02")
    write_network(products / "case06.network.h5", slender())
    (products / "seed_2").mkdir()
    write_network(products / "seed_2/case06.network.h5", slender(4))
    results = products / "results"
    command = ["study", str(PAPER), "--products", str(products)]
    for case in ("case02", "case03", "case06"):
        assert main([*command, "--measure", case, "-o", str(results / f"{case}.json")]) == 0
    command = ["study", str(PAPER), "--products", str(products / "seed_2"), "--scatter"]
    result = str(results / "seed_2/case06.json")
    assert main([*command, "--measure", "case06", "-o", result]) == 0
    return results


@pytest.fixture(scope="module")
def page(results, tmp_path_factory) -> Path:
    """Return the folder of the study's page and tables; most of its cases are missing."""
    folder = tmp_path_factory.mktemp("study")
    study = folder / "paper"
    shutil.copytree(PAPER.parent, study)
    # Drawing all figures takes more time than all other tests of this file together.
    figures = yaml.safe_load((study / "figures.yaml").read_text())
    few = [figure for figure in figures if figure["name"] in DRAWN_FIGURES]
    (study / "figures.yaml").write_text(yaml.safe_dump(few))
    command = ["study", str(study / PAPER.name), "--results", str(results), "-o", str(folder)]
    assert main(command) == 3
    return folder


@pytest.fixture(scope="module")
def table(page) -> dict[str, dict[str, str]]:
    """Return the rows of table 1 by case."""
    return {row["case"]: row for row in read_rows(page / "table1.csv")}


@pytest.fixture(scope="module")
def targets(page) -> dict[str, dict[str, str]]:
    """Return the rows of the table of targets by their names."""
    rows = read_rows(page / "targets.csv")
    targets = {row["id"]: row for row in rows}
    assert len(targets) == len(rows)
    return targets


def test_table_has_the_cases_and_columns_that_others_read(table):
    assert list(table) == ["2", "3", "6"]
    assert set(table["2"]) >= REQUIRED_COLUMNS


def test_each_target_has_a_verdict_with_a_reason(targets):
    assert len(targets) == 32
    for row in targets.values():
        assert list(row) == ["id", "value", "error", "target", "rule", "met", "why"]
        assert row["met"] in ("yes", "no")
        assert row["why"]


@pytest.mark.parametrize(
    ("column", "exact", "tolerance"),
    [
        ("f_low_pass_2_khz", CHAIN.low_pass_frequency / 1e3, 0.01),
        (VELOCITY_COLUMN, CHAIN.velocity, 0.013),
        ("v_p_static_m_per_s", CHAIN.velocity, 1e-3),
        ("lambda_edge_linear_over_d", 2**0.5, 5e-3),
        ("void_ratio", 0.353, 1.5e-3),
    ],
)
def test_numbers_of_the_crystal(column, exact, tolerance, table):
    """Compare with the lattice, whose exact record is read, and with the paper's void ratio.

    The tolerances are the known biases of the 2 % rule and of first peaks, and the finite length;
    the void ratio is that of touching spheres, which overlap here.
    """
    assert float(table["2"][column]) == pytest.approx(exact, rel=tolerance)


def test_targets_of_the_crystal_are_met(targets):
    assert targets["fcc_flow_theory"]["met"] == "yes"
    assert targets["fcc_e"]["met"] == "yes"


def test_target_without_modes_is_not_met(targets):
    assert targets["fcc_f_200"]["met"] == "no"
    assert "modes" in targets["fcc_f_200"]["why"]


def test_exponent_of_two_of_four_crystals_is_known_but_meets_no_target(targets):
    assert float(targets["fcc_b"]["value"]) == pytest.approx(1 / 6, abs=2e-3)
    assert targets["fcc_b"]["met"] == "no"
    assert "case 1, 4" in targets["fcc_b"]["why"]


def test_target_of_a_missing_case_has_no_value(targets):
    assert targets["rnd_e_22"]["value"] == ""
    assert "case 22" in targets["rnd_e_22"]["why"]


def test_second_sample_of_a_case_gives_it_an_error(table):
    """Read case 6 from the folder seed_2, too: it has two samples, each crystal one."""
    assert [table[case]["packings"] for case in ("2", "3", "6")] == ["1", "1", "2"]
    first = void_ratio(slender(3))
    second = void_ratio(slender(4))
    # The standard deviation of two values is their difference divided by sqrt(2).
    error = float(table["6"]["void_ratio_sample_error"])
    assert error == pytest.approx(abs(first - second) / 2**0.5, rel=0.01)
    assert table["2"]["void_ratio_sample_error"] == ""


def test_page_stands_alone(page):
    text = (page / "study.html").read_text()
    assert not re.search(r'(src|href)="(?!data:|#)', text)


def test_page_says_which_cases_are_missing(page):
    text = (page / "study.html").read_text()
    assert "3 of 32 cases" in text
    assert "case 1, 4-5, 7-32" in text


def test_page_has_the_figures_of_its_cases(page):
    drawn = {path.stem for path in page.glob("*.png")}
    assert drawn == DRAWN_FIGURES


def test_case_is_shown_beside_theory(results, capsys):
    assert main(["study", str(PAPER), "--results", str(results), "--case", "case02"]) == 0
    text = capsys.readouterr().out
    (row,) = [line for line in text.splitlines() if line.startswith("void ratio")]
    assert "0.353" in row
    assert "theory" in text


def test_missing_case_is_refused(results, one_line):
    one_line(main, ["study", PAPER, "--results", results, "--case", "case09"])


def test_committed_tables_are_those_of_the_committed_results(paper):
    """Make all tables again from the results of the cases: no table is out of date."""
    frame = frame_of(read_results(ROOT / "results/study/cases"), paper.cases)
    assert frame["there"].all()
    rules = Rules(frame, paper.stated())
    tables = [
        tabulate_all_numbers(frame),
        tabulate_targets(answer_targets(paper, frame)),
        *make_tables(paper.part("tables"), rules),
    ]
    remedy = (
        "python -m analysis study studies/otsubo2017/study.yaml --results results/study/cases "
        "-o results/study"
    )
    for table in tables:
        with open(ROOT / f"results/study/{table.name}.csv", newline="") as file:
            header, *rows = csv.reader(file)
        assert list(table.header) == header, (table.name, remedy)
        assert [list(row) for row in table.rows] == rows, (table.name, remedy)


def test_library_names_no_study():
    for path in (ROOT / "analysis").rglob("*.py"):
        assert "otsubo2017" not in path.read_text(), path


def test_error_of_a_natural_frequency_contains_the_exact_one():
    """Compare the bound that follows from the residual with a dense spectrum."""
    system = LinearSystem.of(random_sample(60, 1e5, seed=3).network())
    exact = modes_of(system, all=True).frequency[-1]
    highest = modes_of(system, highest=1, certify=False)
    value = natural_frequency(float(highest.frequency[-1]), highest)
    assert np.isfinite(value.error)
    # The dense solver rounds at 1e-16 of the highest frequency squared.
    assert abs(value.value - exact) <= value.error + 1e-12 * value.value


@pytest.mark.parametrize(
    ("study", "results", "code"),
    [
        (PAPER, ".", "no_results"),
        (PAPER, "absent", "no_folder"),
        ("absent.yaml", ".", "no_file"),
    ],
    ids=["no result", "no folder", "no study"],
)
def test_study_without_results_is_refused(study, results, code, tmp_path, one_line):
    command = ["study", tmp_path / study, "--results", tmp_path / results, "-o", tmp_path / "out"]
    one_line(main, command, code=code)
    assert not (tmp_path / "out").exists()


class Reader(HTMLParser):
    """What a page says: language, texts, pictures, headings, headers of tables."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.language = ""
        self.alts: list[str] = []
        self.levels: list[int] = []
        self.columns: list[int] = []
        """Numbers of header cells of the tables."""
        self.rows_without_header = 0
        self.texts: list[str] = []
        self._row: list[dict] = []
        self._shown = True
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        if tag == "html":
            self.language = found.get("lang", "")
        elif tag == "img":
            self.alts.append(found.get("alt", ""))
        elif tag in ("h1", "h2", "h3"):
            self.levels.append(int(tag[1]))
        elif tag == "table":
            self.columns.append(0)
        elif tag == "th" and found.get("scope") == "col":
            self.columns[-1] += 1
        elif tag == "tr":
            self._row = []
        if tag in ("th", "td"):
            self._row.append({"tag": tag, "scope": found.get("scope")})
        if tag == "style":
            self._shown = False

    def handle_endtag(self, tag):
        if tag == "tr" and self._row[0]["tag"] != "th":
            self.rows_without_header += 1
        if tag == "style":
            self._shown = True

    def handle_data(self, data):
        if self._shown:
            self.texts.append(data)


COMMITTED = ROOT / "results/study"
"""Page, tables and figures of the study, as they are committed."""


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader((COMMITTED / "study.html").read_text())


def test_page_can_be_read_aloud(reader):
    """Name the language, describe pictures, give tables headers and headings an order."""
    assert reader.language == "en"
    assert len(reader.alts) > 20
    assert all(20 < len(alt) < 400 for alt in reader.alts)
    assert reader.levels[0] == 1
    assert all(level <= last + 1 for last, level in pairwise(reader.levels))
    assert len(reader.columns) > 10
    assert min(reader.columns) > 1
    assert reader.rows_without_header == 0


def test_page_speaks_in_words(reader):
    text = " ".join([*reader.texts, *reader.alts])
    assert "friction 0.4 during compression" in text
    for word in ("mu_comp", "Absent:", "nan"):
        assert not re.search(rf"\b{word}", text), word


def test_page_says_each_note_once_with_its_count(reader):
    frame = frame_of(read_results(COMMITTED / "cases"), Study(PAPER).cases)
    notes = {note for row in frame["row"] for note in row.notes}
    assert notes
    for note in notes:
        (line,) = [text for text in reader.texts if text.startswith(f"{note} (")]
        assert re.search(r"\(\d+ packings?: case ", line)


def test_headline_of_the_page_is_that_of_the_readme(reader):
    """Both are means over samples, of which a table of fits is committed."""
    with open(ROOT / "results/isostaticity/fits.csv", newline="") as file:
        fits = {row["quantity"]: row for row in csv.DictReader(file)}
    zero = float(fits["low-pass frequency (2 %)"]["z_c"])
    assert f"z_c = {zero:.2f} (" in " ".join(reader.texts)
    assert "isostaticity/headline.png" in (ROOT / "README.md").read_text()
    picture = base64.b64encode((ROOT / "results/isostaticity/headline.png").read_bytes())
    assert picture.decode() in (COMMITTED / "study.html").read_text()


def test_every_axis_has_a_name_and_a_unit():
    """Read all committed figures; (-) says that a number has no unit."""
    paths = [*COMMITTED.glob("fig*.csv"), *COMMITTED.glob("beyond*.csv")]
    paths += [path for path in (COMMITTED / "cases").glob("*.csv") if "agreement" not in path.name]
    assert len(paths) > 30
    for path in paths:
        for panel in read_picture(path).panels:
            for label in (panel.xlabel, panel.ylabel, panel.colour_label or "none (-)"):
                assert re.fullmatch(r".*\w.*\(.+\)|.*\(.+\), .*\(.+\)", label), (path.name, label)


def test_a_number_has_one_error_wherever_it_stands():
    """Compare quantities of the record with those of its producer, and the table of choices."""
    rows = {row.name: row for row in read_results(COMMITTED / "cases")}
    for row in rows.values():
        for name, of_record in OF_RECORD.items():
            source = of_record.format(record=row.record)
            if source in row.columns and name in row.columns:
                errors = row.spread(source), row.spread(name)
                assert np.array_equal(*errors, equal_nan=True), (row.name, name)
    case = rows["case22"]
    shown = number(case.value("f_low_pass_2_khz"), case.spread("f_low_pass_2_khz"))
    assert "±" in shown
    by_case = {line["case"]: line for line in read_rows(COMMITTED / "table1_seen.csv")}
    assert by_case["22"]["f_low-pass 2 %, kHz"].removesuffix(" *") == shown
    choices = {line["f_low-pass, kHz"]: line for line in read_rows(COMMITTED / "choices.csv")}
    line = choices["YADE, chain, 2 % of the maximum of the whole map"]
    assert line["random, 100 kPa (case 22)"].split(",")[0] == shown


def test_caption_reads_a_number_of_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("fits.csv").write_text("name,z_c\nlimit,4.248\n3,5\n")
    captions = Captions(frame_of([]).assign(there=[]))
    assert captions("{{ entry('fits.csv', 'limit', 'z_c', '.2f') }}") == "4.25"
    assert captions("{{ entry('fits.csv', '3', 'z_c') }}") == "5"
    assert captions("{{ entry('other.csv', 'limit', 'z_c') }}") == UNKNOWN


@pytest.mark.parametrize(
    "arguments",
    ["'/etc/passwd', 'a', 'b'", "'../fits.csv', 'a', 'b'", "'fits.csv', 'limit', 'slope'"],
)
def test_caption_reads_no_other_file(arguments, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    Path("fits.csv").write_text("name,z_c\nlimit,4.248\n")
    with pytest.raises(InputError):
        Captions(frame_of([]).assign(there=[]))(f"{{{{ entry({arguments}) }}}}")
