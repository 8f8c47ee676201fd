"""The benchmarks' harness, and what they measure, on tiny sizes; each whole job is slow."""

import re
import sys

import numpy as np
import pytest
from oracles import stepped
from packings import random_sample

from analysis.estimators.layer_lattice import LayerLattice
from benchmarks import dem, density, scaling, wave
from benchmarks.__main__ import NAMED, main
from benchmarks.harness.measure import Job, run_command
from benchmarks.harness.packing import by_energy, resized, spectrum
from benchmarks.harness.report import Page, read_csv
from benchmarks.harness.yade import in_yades_order
from modal.modes.density import density_of_states
from modal.modes.zero_modes import by_structure
from modal.packing import crystal as gallery
from modal.packing.network import RECEIVER_WALL
from modal.system.assembly import stiffness_matrix
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from tests.benchmarks import tasks


@pytest.fixture(scope="module")
def packing():
    """Return a random packing of 60 spheres with floppy modes, and its whole spectrum."""
    network = random_sample(60, 1e5, seed=3, aspect=2.5).network()
    system = LinearSystem.of(network)
    assert by_structure(system).total > 0
    return network, spectrum(system), by_structure(system)


@pytest.fixture
def job(tmp_path):
    return Job(True, tmp_path)


def test_a_task_is_measured_in_its_own_process(job):
    small = job.measured(tasks.nothing_to_do)
    large = job.measured(tasks.hundred_megabytes)
    assert large.value == 12_500_000
    assert large.peak_mb - small.peak_mb == pytest.approx(100, rel=0.2)


def test_memory_of_a_command_is_its_own(tmp_path):
    """Leave out the memory of the process that starts it, which has 300 MB here."""
    memory = np.ones(300_000_000 // 8)
    spent = run_command([sys.executable, "-S", "-c", "print(1)"], tmp_path, tmp_path / "log")
    assert spent.peak_mb < 100 < memory.nbytes / 1e6
    assert (tmp_path / "log").read_text() == "1\n"


def test_a_command_or_task_that_fails_says_why(job):
    assert "none.h5" in job.command("modal", "info", "none.h5").failure
    setting = {"path": "none.network.h5", "resolution": 1e3, "tolerance": 0.1}
    with pytest.raises(InputError, match="none.network.h5"):
        job.measured(density.states, **setting)
    failed = job.measured(density.states, must=False, **setting)
    assert failed.seconds is None
    assert "none.network.h5" in failed.failure


def test_several_threads_are_timed_by_the_clock(job):
    """Count the time of waiting on several threads, though it takes no processor time."""
    wait = [sys.executable, "-S", "-c", "import time; time.sleep(0.5)"]
    log = job.folder / "log"
    assert run_command(wait, job.folder, log, threads=1).seconds < 0.5
    assert run_command(wait, job.folder, log, threads=2).seconds >= 0.5
    assert job.measured(tasks.waiting, threads=1).seconds < 0.5
    assert job.measured(tasks.waiting, threads=2).seconds >= 0.5


def test_a_job_that_fails_costs_one_line_and_no_other_job(tmp_path, monkeypatch, capsys):
    def fails(job):
        raise ZeroDivisionError("no spheres")

    rows = [{"method": "a", "error": 1e-3, "seconds": 1.0}]
    monkeypatch.setattr(wave, "run", fails)
    monkeypatch.setattr(density, "run", lambda job: Page("Title", "Task.", {"t": rows}))
    assert main(["wave", "density", "--quick", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err == "error: wave: ZeroDivisionError: no spheres\n"
    assert {path.name for path in tmp_path.iterdir()} == {"README.md", "density.md", "t.csv"}
    assert "- [Title](density.md)" in (tmp_path / "README.md").read_text()


def test_energy_of_the_springs_gives_the_frequencies(packing):
    """Compare with the matrix's spectrum, within the round-off of K in its lowest modes."""
    network, exact, floppy = packing
    frequency = by_energy(LinearSystem.of(network), floppy.total, 10)
    expected = exact[floppy.total :][:10]
    bound = np.finfo(float).eps * (exact[-1] / expected[0]) ** 2
    assert abs(frequency / expected - 1).max() < 100 * bound


def test_lower_part_keeps_its_stiffness(packing):
    """Compare with the block of K without the contacts that were cut, except at the top."""
    network = packing[0]
    lower = resized(network, 25)
    in_lower = (network.particle_i < 25) & (network.particle_j < 25)
    expected = stiffness_matrix(network.with_contacts(in_lower))[:150, :150]
    difference = abs(stiffness_matrix(lower) - expected).toarray()
    changed = (difference > 1e-12 * abs(expected).max()).any(axis=0)
    top = np.argmax(lower.position[:, 2])
    assert set(np.flatnonzero(changed) // 6) == {top}
    assert lower.particle_j.min() == RECEIVER_WALL


def test_a_wave_passes_through_the_lower_part(packing):
    assert propagate(resized(packing[0], 25), 2e-5).products > 0


def test_a_packing_is_resized_by_whole_copies(packing):
    assert resized(packing[0], 130).n_particles == 120


def test_dispersion_error_of_the_time_step_has_order_two():
    network = in_yades_order(gallery.fcc(cells=(2, 2, 30)))
    chain = LayerLattice.of_network(network)

    def errors(step):
        record = stepped(network, 6e-5, step, every=round(4e-7 / step))
        return dem.errors(record, chain)

    coarse = errors(2e-7)
    fine = errors(1e-7)
    # omega (1 + (omega dt)^2 / 24): the quarter, up to the next order of some per cent.
    for name in ("error_dispersion", "error_f_low_pass"):
        assert np.log2(coarse[name] / fine[name]) == pytest.approx(2, abs=0.15), name


def test_density_errors_split_into_kernel_and_vectors(packing):
    network, exact, floppy = packing

    def errors(resolution, tolerance):
        states = density_of_states(network, resolution=resolution, tolerance=tolerance)
        errors = density.errors(exact, floppy.total, states)
        assert errors["error"] <= errors["error_of_kernel"] + errors["error_of_vectors"]
        return errors

    coarse = errors(4e4, 0.02)
    fine = errors(1e4, 0.02)
    many_vectors = errors(1e4, 0.005)
    assert fine["error_of_kernel"] < 0.5 * coarse["error_of_kernel"]
    assert many_vectors["error_of_kernel"] == pytest.approx(fine["error_of_kernel"])
    # Sixteen times the vectors: a quarter of their error on average, half at worst.
    assert many_vectors["error_of_vectors"] < 0.5 * fine["error_of_vectors"]


@pytest.mark.parametrize("curve", scaling.ACTIONS)
def test_what_is_measured_still_works(packing, curve):
    """Run each task: one that fails is an empty row of the table, which nobody may notice."""
    result = scaling.ACTIONS[curve](packing[0])
    assert re.match(r"[1-9]\d* (nonzeros|products|modes)", result)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMED)
def test_every_job_writes_its_tables_and_figures(name, tmp_path, yade):
    """Find a number in each column; complete where YADE is, LAMMPS may be missing."""
    assert main(["--quick", name, "-o", str(tmp_path)]) == 0
    page = (tmp_path / f"{name}.md").read_text()
    shown = re.findall(r"\((\w+\.png)\)", page)
    assert shown
    assert all((tmp_path / figure).stat().st_size < 150_000 for figure in shown)
    for table in tmp_path.glob("*.csv"):
        rows = read_csv(table)
        assert len(rows) > 1
        assert f"`{table.name}`" in page
        for column in rows[0]:
            assert any(row[column] is not None for row in rows), column
