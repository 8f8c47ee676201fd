"""The table of samples measures what it shows."""

from dataclasses import replace

import pytest

from analysis.__main__ import main
from analysis.packings.samples import HEADER, table
from modal.packing.sample import write_sample
from modal.preparation.random_packing import random_sample


def test_table_measures_the_sample(tmp_path, capsys):
    sample = random_sample(150, 1e7, aspect=1.5, tolerance=1e-3)
    sample = replace(sample, friction=0.1, study={"stress": 1e7, "mu_comp": 0.0, "steps": 12})
    path, out = tmp_path / "case08.sample.h5", tmp_path / "samples.md"
    write_sample(path, sample)
    assert main(["samples", str(path), "-o", str(out)]) == 0
    assert capsys.readouterr().out == out.read_text()
    lines = [[c.strip() for c in line.split("|")[1:-1]] for line in out.read_text().splitlines()]
    assert lines[0] == list(HEADER)
    found = dict(zip(HEADER, lines[2], strict=True))
    assert found["sample"] == "case08"
    assert float(found["e"]) == pytest.approx(sample.network().study["void_ratio"], abs=6e-5)
    # The minimiser's own tolerances: stresses within 1e-3, mean net force below 1e-3.
    assert all(abs(float(x)) < 0.11 for x in found["stress x, y, z, % off"].split(","))
    assert float(found["residual / mean force"]) < 1.1e-3
    assert found["steps"] == "12" and found["seconds"] == ""
    assert lines[2][4] == "0.516"


def test_stages_of_the_longest_compression_are_listed(tmp_path):
    sample = random_sample(150, 1e7, aspect=1.5, tolerance=1e-3)
    costs = {"cool": (600, 3.0, 10), "1e+07": (50, 2.0, 500), "cloud": (100, 0.5, 0)}
    study = {}
    for name, cost in costs.items():
        study |= zip([f"steps_{name}", f"seconds_{name}", f"contacts_{name}"], cost, strict=True)
    for name, known in (("long", study), ("short", {})):
        path = tmp_path / f"{name}.sample.h5"
        write_sample(path, replace(sample, friction=0.1, study=known))
    lines = table([str(tmp_path / f"{name}.sample.h5") for name in ("short", "long")]).splitlines()
    cells = [[c.strip() for c in line.split("|")[1:-1]] for line in lines[5:]]
    assert cells[0][0] == "stage"
    assert [row[0] for row in cells[2:]] == ["cloud", "cool", "1e+07 Pa"]
    assert cells[3] == ["cool", "600", "3", "10", "200.0"]


def test_a_file_that_is_no_sample(tmp_path, capsys):
    assert main(["samples", str(tmp_path / "absent.sample.h5")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_table_of_nothing_is_a_header():
    assert len(table([]).splitlines()) == 2
