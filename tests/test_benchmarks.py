"""The benchmarks on tiny sizes: columns, orders of convergence, causes of errors. No timing."""

from __future__ import annotations

import csv
import re
import shutil
import sys

import numpy as np
import pytest

from analysis.exact_chain import Chain
from benchmarks import (
    density,
    eigensolvers,
    fcc_time_step,
    machine,
    preparation,
    random_time_step,
    scaling,
    shortcuts,
    wave,
    yade_job,
)
from benchmarks.__main__ import JOBS, main
from benchmarks.diagram import knee, work_precision
from benchmarks.measure import attempted, measured, median_of, run_command
from benchmarks.packing import by_energy, spectrum
from benchmarks.report import Finding, table, write
from modal import gallery
from modal.density import density_of_states
from modal.eigenproblem import Eigenproblem
from modal.leapfrog import leapfrog
from modal.network import write_network
from modal.random_packing import random_network
from modal.source import Pulse
from modal.storage import InputError

COLUMNS = {
    "fcc_time_step": ("method", "error_f_low_pass", "error_velocity", "error_dispersion"),
    "random_time_step": ("time_step_over_limit", "error", "error_of_layers", "seconds"),
    "wave": ("method", "error", "apart_from_same_step", "apart_from_tangent"),
    "eigensolvers": ("method", "elastic_modes", "zero_modes", "error"),
    "density": ("method", "moments", "vectors", "error", "error_of_kernel", "error_of_vectors"),
    "preparation": ("method", "steps", "e", "Z", "stress_error", "unbalanced", "error_e"),
    "shortcuts": ("short cut", "system", "seconds_without", "seconds_with", "error"),
    "scaling": ("curve", "x", "seconds", "mb", "seconds_limit"),
}


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    """A random packing of 60 spheres with floppy modes, its file and its whole spectrum."""
    network = random_network(60, 1e5, seed=3, aspect=2.5)
    path = tmp_path_factory.mktemp("packing") / "packing.network.h5"
    write_network(path, network)
    problem = Eigenproblem.of(network)
    assert problem.floppy.total > 0
    return network, path, spectrum(problem), problem.floppy


def hundred_megabytes():
    """Task for `measured`: memory that is written to, given back at the end."""
    return lambda: int(np.ones(100_000_000 // 8).sum())


def nothing_to_do():
    """Task for `measured`."""
    return lambda: None


def test_a_task_is_measured_in_its_own_process():
    small = measured("tests.test_benchmarks:nothing_to_do", times=3)
    large = measured("tests.test_benchmarks:hundred_megabytes")
    assert large.value == 12_500_000
    assert large.peak_mb - small.peak_mb == pytest.approx(100, rel=0.2)


def test_memory_of_a_command_is_its_own(tmp_path):
    """Not that of the process that starts it, which holds 300 MB here."""
    held = np.ones(300_000_000 // 8)
    _, peak = run_command([sys.executable, "-S", "-c", "print(1)"], tmp_path, tmp_path / "log")
    assert peak < 100 < held.nbytes / 1e6
    assert (tmp_path / "log").read_text() == "1\n"


def test_a_command_that_fails_says_why(tmp_path):
    with pytest.raises(InputError, match="KeyError"):
        run_command([sys.executable, "-c", "raise KeyError('lost')"], tmp_path, tmp_path / "log")


def test_a_task_that_fails_says_why(tmp_path):
    missing = str(tmp_path / "none.network.h5")
    failed = attempted("benchmarks.density:dense", path=missing)
    assert failed.seconds is None
    assert "none.network.h5" in failed.failure
    with pytest.raises(InputError, match="density:dense.*none.network.h5"):
        measured("benchmarks.density:dense", path=missing)


def test_a_job_that_fails_costs_one_line_and_no_other_job(tmp_path, monkeypatch, capsys):
    def fails(quick, folder):
        raise ZeroDivisionError("no spheres")

    rows = [{"method": "a", "error": 1e-3, "seconds": 1.0}]
    monkeypatch.setattr(wave, "run", fails)
    monkeypatch.setattr(density, "run", lambda quick, folder: Finding("Title", "Task.", rows))
    assert main(["wave", "density", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err == "error: wave: ZeroDivisionError: no spheres\n"
    assert {path.name for path in tmp_path.iterdir()} == {"README.md", "density.md", "density.csv"}


def test_short_commands_are_repeated_and_long_ones_not():
    costs = iter([(1.0, 5.0), (3.0, 7.0), (2.0, 6.0), (60.0, 8.0)])
    assert median_of(3, lambda: next(costs)) == (2.0, 6.0)
    assert median_of(3, lambda: next(costs)) == (60.0, 8.0)


def test_energy_of_the_springs_gives_the_frequencies(packing):
    """Against the matrix's own spectrum, to what round-off in K leaves of its lowest modes."""
    network, _, exact, floppy = packing
    found = by_energy(Eigenproblem.of(network), floppy.total, 10)
    wanted = exact[floppy.total :][:10]
    bound = np.finfo(float).eps * (exact[-1] / wanted[0]) ** 2
    assert abs(found / wanted - 1).max() < 100 * bound


def test_knee_is_the_cheapest_near_the_floor():
    rows = [
        {"error": 1e-2, "seconds": 1.0},
        {"error": 1.5e-4, "seconds": 4.0},
        {"error": 1e-4, "seconds": 9.0},
        {"error": None, "seconds": 0.1},
    ]
    assert knee(rows, "error")["seconds"] == 4.0
    assert knee(rows, "error", within=1.2)["seconds"] == 9.0


def test_report_has_every_column_and_its_figure(tmp_path):
    rows = [
        {"method": "a", "error": 1e-3, "seconds": 1.0, "peak_mb": 10.0},
        {"method": "b", "error": 0.0, "seconds": 2.0, "peak_mb": 20.0, "failure": "none"},
    ]
    figure = work_precision(rows, {"error": "error (-)"})
    text = write(Finding("Title", "Task.", rows, ["note"], {"shown": figure}), "job", tmp_path)
    assert "| b | 0 | 2 | 20 | none |" in text
    assert (tmp_path / "shown.png").stat().st_size > 0
    with open(tmp_path / "job.csv") as file:
        assert next(csv.reader(file)) == ["method", "error", "seconds", "peak_mb", "failure"]
    assert table(rows[:1]).count("\n") == 2


def test_unknown_job_is_refused(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["nonsense"])
    assert stop.value.code == 2
    assert "nonsense" in capsys.readouterr().err


def test_dispersion_error_of_the_time_step_has_order_two():
    network = yade_job.in_yades_order(gallery.fcc(2, 30))
    chain = Chain.of_network(network)
    found = [
        fcc_time_step.errors(leapfrog(network, 6e-5, step, every=round(4e-7 / step)), chain)
        for step in (2e-7, 1e-7)
    ]
    # omega (1 + (omega dt)^2 / 24): the quarter, up to the next order of some per cent.
    for name in ("error_dispersion", "error_f_low_pass", "error_signals"):
        assert np.log2(found[0][name] / found[1][name]) == pytest.approx(2, abs=0.15), name


def test_random_packing_time_step_has_order_two(tmp_path, monkeypatch):
    monkeypatch.setattr(random_time_step, "SIZE", {True: (150, 3e-5)})
    monkeypatch.setattr(random_time_step, "FRACTIONS", {True: (0.2, 0.1)})
    finding = random_time_step.run(True, tmp_path)
    for name in random_time_step.ERRORS:
        coarse, fine = (row[name] for row in finding.rows)
        steps = finding.rows[1]["steps"] / finding.rows[0]["steps"]
        # Second order in the step; the next order of the fastest waves changes it by some per cent.
        assert np.log(coarse / fine) / np.log(steps) == pytest.approx(2, abs=0.2)


def test_pre_stress_shifts_the_velocity_and_springs_do_not():
    """C loses 2 N / l where the springs give 2 (kn + kt): V_P falls by half of that share."""
    network = yade_job.in_yades_order(gallery.fcc(2, 30))
    chain = Chain.of_network(network)
    inner = network.particle_j >= 0
    lateral = np.median(network.force_normal[inner]) / (2 * network.radius[0])
    expected = lateral / chain.stiffness
    run = leapfrog(network, 6e-5, 2e-8, every=20, motion=Pulse())
    found = {}
    for kind in ("none", "full"):
        twin = fcc_time_step.linear_twin(network, run, kind)
        found[kind] = fcc_time_step.errors(twin, chain)["error_velocity"]
    assert found["none"] < 0.1 * expected
    assert found["full"] == pytest.approx(expected, rel=0.1)


def test_wave_errors_against_the_converged_wave():
    network = gallery.fcc(2, 20)
    exact = wave.exact(network, 5e-5, 1e-6)
    coarse = wave.leapfrog_wave(network, 5e-5, 2e-7, 5)
    fine = wave.leapfrog_wave(network, 5e-5, 1e-7, 10)
    ratio = wave.relative(coarse, exact) / wave.relative(fine, exact)
    assert np.log2(ratio) == pytest.approx(2, abs=0.15)


@pytest.mark.parametrize("solver", ["banded", "superlu"])
def test_program_lists_no_floppy_modes(packing, solver):
    _, path, exact, floppy = packing
    found = eigensolvers.program(str(path), solver, 20)()["frequency"]
    elastic, zero, error = eigensolvers.compare(found, exact, floppy.total, 20)
    assert (elastic, zero) == (20, 0)
    # Round-off in a matrix whose largest frequency is f_max, times a modest factor.
    assert error < 100 * np.finfo(float).eps * (exact[-1] / exact[floppy.total]) ** 2


def test_scipy_as_typed_lists_floppy_modes(packing):
    _, path, exact, floppy = packing
    found = eigensolvers.typed(str(path), 20, eigensolvers.SHIFT, 0.0)()["frequency"]
    elastic, zero, error = eigensolvers.compare(found, exact, floppy.total, 20)
    assert elastic + zero == 20
    assert zero >= min(20, floppy.total) // 2
    assert error is None


def test_dense_peers_agree_with_the_spectrum(packing):
    _, path, exact, floppy = packing
    for count in (None, 10 + floppy.total):
        found = eigensolvers.dense(str(path), count)()["frequency"]
        _, zero, error = eigensolvers.compare(found, exact, floppy.total, 10)
        assert zero == floppy.total
        assert error < 1e-9


def test_density_errors_split_into_kernel_and_vectors(packing):
    network, _, exact, floppy = packing
    found = {}
    for resolution, tolerance in ((4e4, 0.02), (1e4, 0.02), (1e4, 0.005)):
        states = density_of_states(
            network, resolution=resolution, tolerance=tolerance, zero_modes=floppy.basis
        )
        found[resolution, tolerance] = density.errors(exact, floppy.total, states)
    coarse, fine, many = found.values()
    assert fine["error_of_kernel"] < 0.5 * coarse["error_of_kernel"]
    assert many["error_of_kernel"] == pytest.approx(fine["error_of_kernel"])
    # Sixteen times the vectors: a quarter of their error on average, half at worst.
    assert many["error_of_vectors"] < 0.5 * fine["error_of_vectors"]
    for errors in found.values():
        assert errors["error"] <= errors["error_of_kernel"] + errors["error_of_vectors"]


def test_stop_criteria_are_read_from_one_run():
    """A state that settles like exp(-step): each criterion is met where it must be."""
    step = 50.0 * np.arange(200)
    settling = np.exp(-step / 500)
    trace = {
        "step": step,
        "seconds": 1e-3 * step,
        "e": 0.7 * (1 + settling),
        "Z": 4 * (1 - settling),
        "stress_error": settling,
        "unbalanced": settling,
    }
    rows = preparation.stop_rows(trace, 10.0, {"method": "made up"})
    assert [row["stop_unbalanced"] for row in rows[:-1]] == list(preparation.UNBALANCED)
    for row in rows[:-1]:
        assert row["unbalanced"] < row["stop_unbalanced"]
        assert row["error_e"] == pytest.approx(row["unbalanced"], rel=1e-3)
        # The state before did not meet it: its residual was exp(0.1) times larger.
        assert row["unbalanced"] * np.exp(0.1) >= row["stop_unbalanced"] * (1 - 1e-9)
    assert rows[-1]["error_e"] is None


def test_loose_spheres_do_not_touch():
    sample = preparation.loose_spheres(60, 0.3, seed=2)
    assert len(sample.contacts().particle_i) == 0
    assert sample.friction == 0.3


def test_symmetry_and_planar_motion_change_nothing(tmp_path):
    path = tmp_path / "crystal.network.h5"
    write_network(path, gallery.fcc(3, 6))
    dense = shortcuts.spectrum(str(path), "dense")()
    assert shortcuts.relative(shortcuts.spectrum(str(path), "symmetry")(), dense) < 1e-12
    full, half = (shortcuts.planar(str(path), only)() for only in (False, True))
    assert len(full) == 6
    assert shortcuts.relative(half, full) < 1e-10


def test_rotations_matter_in_a_random_packing(packing):
    """Held rotations stiffen it: the lowest elastic mode rises, by Rayleigh's principle."""
    _, path, exact, floppy = packing
    held = shortcuts.spectrum(str(path), "lowest", translations_only=True)()
    assert held[0] > exact[floppy.total]


def test_products_move_what_they_must(packing):
    network, path, _, _ = packing
    by_contacts = scaling.products(str(path), compiled=True)()
    by_matrix = scaling.products(str(path), compiled=False)()
    nonzeros = scaling.assembly(str(path))()
    size = 6 * network.n_particles
    # CSR: a number and an index of 4 or 8 bytes for each nonzero, one pointer a row, two vectors.
    low = 12 * nonzeros + 4 * (size + 1) + 16 * size
    assert low <= by_matrix <= low + 4 * nonzeros + 4 * (size + 1)
    assert by_contacts > 104 * network.n_contacts


def test_machine_is_described_without_names():
    text = " ".join(machine.description())
    assert "cores" in text
    assert "/" not in text
    assert {"copy", "triad"} == set(machine.bandwidth(1.0, times=1))


@pytest.mark.slow
def test_the_studys_chain_ends_settled(tmp_path):
    if shutil.which("yade") is None:
        pytest.skip("YADE is missing: apt-get install --no-install-recommends yade python3-h5py")
    row = preparation.chain_row(tmp_path, 200, 0.4, 1)
    assert row["stress_error"] < 3 * preparation.DEFAULT
    assert row["unbalanced"] < preparation.DEFAULT
    assert row["steps"] > 10_000 and row["seconds"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", JOBS)
def test_every_job_writes_its_table_and_figures(name, tmp_path):
    if shutil.which("yade") is None:
        pytest.skip("YADE is missing: apt-get install --no-install-recommends yade python3-h5py")
    assert main(["--quick", name, "-o", str(tmp_path)]) == 0
    page = (tmp_path / f"{name}.md").read_text()
    assert "not installed" not in page.split("Made by")[0]
    shown = re.findall(r"\((\w+\.png)\)", page)
    assert shown and all((tmp_path / figure).stat().st_size < 150_000 for figure in shown)
    with open(tmp_path / f"{name}.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 3
    for column in COLUMNS[name]:
        assert column in rows[0], column
        assert any(row[column] for row in rows), column
    assert f"({name}.md)" in (tmp_path / "README.md").read_text()
