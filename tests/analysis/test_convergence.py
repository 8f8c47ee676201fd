"""What a setting of the compression changes is read from packings whose answer is known."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from analysis.__main__ import main
from analysis.estimators.limit import limit
from analysis.measurement import Measurement
from analysis.study.convergence import (
    QUANTITIES,
    SWEEPS,
    limits_table,
    rows_of,
    twins_table,
)
from analysis.value import Value
from modal.packing.sample import write_sample
from modal.preparation.random_packing import random_sample

TABLE = """# a comment
setting program mu_comp spheres width fraction residual seeds
own modal 0.4 1000 8 0.7 1e-3 40

half_step - - - - 0.35 - 40
quarter_step - - - - 0.175 - 40
twin - - 500 6 - - 40
twin_yade yade - 500 6 - - 40
half_step modal 0.1 1000 8 0.35 1e-3 40
"""
NOISE = 0.05
STEP = SWEEPS[0].title


@pytest.fixture
def folder(tmp_path):
    """e is 0.6 + 0.1 fraction with noise; the twins draw from one distribution."""
    (tmp_path / "own.table").write_text(TABLE)
    rng = np.random.default_rng(5)
    fractions = {"own": 0.7, "half_step": 0.35, "quarter_step": 0.175, "twin": 0, "twin_yade": 0}
    for name, fraction in fractions.items():
        for seed in range(1, 42):
            path = tmp_path / f"{name}_mu0.4" / str(seed) / "100000Pa.json"
            path.parent.mkdir(parents=True)
            state = dict.fromkeys(QUANTITIES.values(), 1.0) | {"stress_error": 0.02 * (seed == 41)}
            state["void_ratio"] = 0.6 + 0.1 * fraction + NOISE * rng.normal()
            Measurement({name: Value(value, "1") for name, value in state.items()}).write(path)
    return tmp_path


def read_rows(folder):
    return rows_of(folder / "own.table", folder, folder / "none")[0]


def test_mean_and_error_are_those_of_the_draw(folder):
    own = read_rows(folder)[0]
    value, error, count = own.mean("e")
    assert (count, own.unsettled) == (40, 1)
    # The scatter of 40 draws is known to 1 / sqrt(2 * 39) = 11 %; three times that.
    assert error == pytest.approx(NOISE / np.sqrt(40), rel=0.34)
    assert abs(value - 0.67) < 4 * error


def test_a_sweep_holds_the_rows_that_differ_in_one_setting(folder):
    rows = read_rows(folder)
    found = SWEEPS[0].points(rows, 0.4, 1e5)
    assert [row.name for row in found] == ["quarter_step", "half_step", "own"]
    assert SWEEPS[0].points(rows, 0.1, 1e5) == []


def test_limit_of_a_line_is_exact_and_its_error_that_of_least_squares():
    size, value = np.array([1.0, 2.0, 4.0]), np.array([3.0, 5.0, 9.0])
    there = limit(size, value, np.full(3, 0.1))
    assert (there.value, there.chi) == pytest.approx((1.0, 0.0), abs=1e-12)
    # sigma^2 (1/n + mean^2 / sum (x - mean)^2), the textbook's error of an intercept.
    spread = ((size - size.mean()) ** 2).sum()
    assert there.error == pytest.approx(0.1 * np.sqrt(1 / 3 + size.mean() ** 2 / spread))
    assert np.isnan(limit(size[:1], value[:1], np.full(1, 0.1)).value)


def test_distance_from_the_limit_is_that_of_independent_draws():
    """Means of eight seeds without any effect: beyond one and two errors as often as a normal.

    Errors from eight seeds make it somewhat more often, Student's t of 7 degrees of freedom, 35 and
    8.6 % for 32 and 4.6: the bounds. An enlargement where chi^2 exceeds 1 makes it less often. Of
    4,000 draws the share is known to 0.8 %. Measured against the error of the limit alone, which
    the point itself has a part in, it was 63 and 33 %.
    """
    random, size = np.random.default_rng(5), np.array([1.0, 0.5, 0.25, 0.125])
    distance = []
    for _ in range(4000):
        seeds = random.standard_normal((4, 8))
        value, error = seeds.mean(axis=1), seeds.std(axis=1, ddof=1) / np.sqrt(8)
        distance.append(limit(size, value, error).distance(size[0], value[0], error[0]))
    share = [np.mean(np.abs(distance) > beyond) for beyond in (1, 2)]
    assert 0.15 < share[0] < 0.35 + 0.024 and share[1] < 0.086 + 0.013


def test_scatter_about_the_line_beyond_the_errors_enlarges_them():
    size, value = np.array([1.0, 2.0, 3.0]), np.array([1.0, 4.0, 1.0])
    few, many = limit(size, value, np.full(3, 0.1)), limit(size, value, np.full(3, 10.0))
    assert few.chi > 1 > many.chi
    # Weights that are equal drop out: the error is that of the scatter, whatever was said of it.
    assert few.error == pytest.approx(limit(size, value, np.full(3, 0.2)).error)
    assert many.error == pytest.approx(100 * np.sqrt(few.covariance[0, 0]))


def test_tables_tell_the_limit_and_the_twins(folder):
    rows = read_rows(folder)
    (line,) = (row for row in limits_table(rows).rows if row[0] == STEP and row[3] == "e")
    there, error = map(float, line[5].split(" ± "))
    assert abs(there - 0.6) < 4 * error
    (line,) = (row for row in twins_table(rows).rows if row[3] == "e")
    assert line[4] == "40, 40" and abs(float(line[-1])) < 4


def convergence(folder, out, packings="."):
    given = str(folder / "own.table"), "--results", str(folder / packings), "-o", str(out)
    return main(["study", *given])


def test_seeds_made_later_join_those_that_are_kept(folder):
    """In two parts, the packings of the first one lost, the tables are those of all at once."""
    whole, parts = folder / "whole", folder / "parts"
    assert convergence(folder, whole) == 0
    for path in [p for p in folder.glob("*_mu*/*") if int(p.name) % 3]:
        later = folder / "later" / path.relative_to(folder)
        later.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(path, later)
    assert convergence(folder, parts) == 0 and convergence(folder, parts, "later") == 0
    for name in ("seeds.csv", "settings.csv", "limits.csv", "twins.csv"):
        assert (parts / name).read_text() == (whole / name).read_text()


def test_seeds_of_which_the_means_are_known_count(folder):
    """The first 15 seeds of `own` by their mean and error alone: its line stays as it was."""
    whole, parts = folder / "whole", folder / "parts"
    assert convergence(folder, whole) == 0
    parts.mkdir()
    numbers = []
    for seed in range(1, 16):
        path = folder / "own_mu0.4" / f"{seed}" / "100000Pa.json"
        found = Measurement.read(path)
        numbers.append([found[name].value for name in QUANTITIES.values()])
        path.unlink()
    head = dict(setting="own", mu_comp="0.4", stress="100000", seeds=15, unsettled=0)
    head["made with"] = "modal 1000 8 0.7 1e-3"
    values = np.array(numbers)
    means = dict(zip(QUANTITIES, values.mean(axis=0), strict=True))
    errors = values.std(axis=0, ddof=1) / np.sqrt(15)
    line = head | means | {f"{n} error": s for n, s in zip(means, errors, strict=True)}
    text = "\n".join(",".join(map(str, cells)) for cells in (line, line.values()))
    (parts / "means.csv").write_text(text + "\n")
    assert convergence(folder, parts) == 0
    assert (parts / "settings.csv").read_text() == (whole / "settings.csv").read_text()


def test_seeds_of_other_settings_are_refused(folder, capsys):
    assert convergence(folder, folder / "out") == 0
    changed = TABLE.replace("own modal 0.4 1000 8 0.7", "own modal 0.4 1000 8 0.6")
    (folder / "own.table").write_text(changed)
    assert convergence(folder, folder / "out") == 2
    assert "was made with modal 1000 8 0.7 1e-3, " in capsys.readouterr().err
    (folder / "own.table").write_text(TABLE.replace("quarter_step", "fourth_step"))
    assert convergence(folder, folder / "out") == 2
    assert "has no row quarter_step of friction 0.4; remove" in capsys.readouterr().err
    (folder / "out" / "seeds.csv").write_text("setting,mu_comp\n")
    assert convergence(folder, folder / "out") == 2
    assert "seeds.csv: has no column V_P, " in capsys.readouterr().err


def test_command_writes_tables_and_figures(folder, capsys):
    out = folder / "out"
    assert convergence(folder, out) == 0
    assert {p.name for p in out.glob("*.md")} == {"settings.md", "limits.md", "twins.md"}
    assert (out / "own_fraction.png").stat().st_size > 5000
    assert convergence(folder, folder / "none", "out") == 2
    assert "run workflow/convergence.smk" in capsys.readouterr().err


def test_numbers_of_a_packing_are_those_of_its_contacts(tmp_path):
    """As the workflow has them: measured by the command line, of a sample at rest."""
    sample = random_sample(150, 1e7, aspect=1.5, tolerance=1e-4)
    path = tmp_path / "own_mu0.4" / "1" / "100000Pa.json"
    path.parent.mkdir(parents=True)
    (tmp_path / "own.table").write_text(TABLE)
    write_sample(tmp_path / "a.rest.sample.h5", replace(sample, study={"stress": 1e7}))
    asked = ["--quantities", *QUANTITIES.values(), "-o", str(path)]
    assert main(["measure", str(tmp_path / "a.rest.sample.h5"), *asked]) == 3  # too short for waves
    (row,) = read_rows(tmp_path)
    found, contact = row.seeds.iloc[0], sample.contacts()
    pairs, walls = (contact.particle_j >= 0).sum(), (contact.particle_j < 0).sum()
    assert found["Z"] == pytest.approx((2 * pairs + walls) / 150)
    # Hertz: forces go with the overlap to 3/2; those of walls are left out.
    force = contact.overlap[contact.particle_j >= 0] ** 1.5
    expected = (force**2).mean() / force.mean() ** 2
    assert found["force_squared"] == pytest.approx(expected, rel=1e-9)
    assert np.isnan(found["f_low_pass"])  # some diameters long
    assert found["residual"] < 1e-4
