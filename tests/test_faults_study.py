"""Faults of a whole study, `run_cases.sh` on a short crystal: killed, doubled, without YADE."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from test_faults import equal, killed_again_and_again, study, undisturbed

from modal.formats.provenance import packing_of, read_provenance

ROOT = Path(__file__).resolve().parents[1]
TABLE = """case mu_comp mu_wave stress input_frequency width layers
2 0 0.1 1e5 1e5 3 20
"""
RUN = """
export WAVE_FRACTION=${WAVE_FRACTION:-0.4}
for stage in sample highest wave modes; do ./run_cases.sh --case 2 --stage $stage || exit; done
"""
"""All but the analysis, which keeps nothing and always starts afresh."""


@pytest.fixture(scope="module")
def start(tmp_path_factory, yade) -> Path:
    """A copy of the project with a short crystal, and this very Python in place of .venv."""
    folder = tmp_path_factory.mktemp("study") / "start"
    folder.mkdir()
    for name in ("modal", "analysis", "yade_scripts", "cases"):
        ignore = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / name, ignore=ignore)
    for name in ("run_cases.sh", "setup.sh", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    (folder / "cases/fcc.table").write_text(TABLE)
    python = folder / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nunset PYTHONPATH\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    shutil.copy(ROOT / "pyproject.toml", folder / ".venv/installed-analysis")
    return folder


@pytest.fixture(scope="module")
def reference(start) -> tuple[Path, float]:
    """The undisturbed study, and the seconds that it took."""
    folder = start.with_name("reference")
    shutil.copytree(start, folder)
    seconds = undisturbed(RUN, folder)
    assert len(list(folder.rglob("case02.*.h5"))) == 5
    return folder, seconds


def copy_of(start: Path, name: str) -> Path:
    folder = start.with_name(name)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(start, folder)
    return folder


def outcome(folder: Path, **environment: str) -> tuple[int, list[str]]:
    """Status and lines on stderr of the study."""
    variables = os.environ | {"OMP_NUM_THREADS": "1"} | environment
    command = ["bash", "-c", RUN]
    run = subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True)
    return run.returncode, run.stderr.strip().splitlines()


@pytest.mark.slow
def test_study_killed_fifty_times(reference):
    """The next run ends with the products of an undisturbed one."""
    folder, seconds = reference
    alive = killed_again_and_again(RUN, folder, folder.with_name("again"), 50, seconds)
    print(f"{alive} of 50 kills met a running study of {seconds:.1f} s")
    assert alive > 40


@pytest.mark.slow
def test_two_studies_in_one_folder_at_once(start, reference):
    folder = copy_of(start, "shared")
    both = [study(RUN, folder) for _ in range(2)]
    assert [process.wait(timeout=600) for process in both] == [0, 0]
    equal(reference[0], folder)


def without_yade(folder: Path) -> str:
    """A PATH with all programs but YADE's."""
    for place in os.environ["PATH"].split(":"):
        for program in Path(place).glob("*"):
            link = folder / program.name
            if not program.name.startswith("yade") and not link.exists():
                link.symlink_to(program)
    return str(folder)


def test_missing_yade_is_one_line(start, tmp_path):
    status, error = outcome(copy_of(start, "missing"), PATH=without_yade(tmp_path))
    assert status == 2 and len(error) == 1 and "yade-batch" in error[0]


@pytest.mark.parametrize(
    "yade_batch", ["exit 0", "echo 'Segmentation fault' >&2; exit 139", "sleep 0; exit 1"]
)
def test_yade_that_makes_no_product(yade_batch, start, tmp_path):
    """Another version, a crash, a job that fails: yade-batch's own status says nothing."""
    fake = tmp_path / "yade-batch"
    fake.write_text(f"#!/bin/sh\n{yade_batch}\n")
    fake.chmod(0o755)
    folder = copy_of(start, "failing")
    status, error = outcome(folder, PATH=f"{tmp_path}:{os.environ['PATH']}")
    assert status not in (0, 139) and "case 2: no network" in error[-1]
    assert not list(folder.rglob("*.h5"))


def test_wave_that_fails_stops_the_study(reference):
    """An unstable time step: the job fails, the study says so and goes no further."""
    folder = copy_of(reference[0], "unstable")
    (folder / "products/case02.signals.h5").unlink()
    (folder / "products/case02.modes.h5").unlink()
    status, error = outcome(folder, WAVE_FRACTION="1.5")
    assert status == 1 and "case 2: no signals" in error[-1]
    assert not (folder / "products/case02.modes.h5").exists()


def test_products_folder_that_is_a_file(start):
    folder = copy_of(start, "file")
    (folder / "products").write_text("")
    status, error = outcome(folder)
    assert status != 0 and len(error) == 1 and "products" in error[0]


def test_case_that_fails_does_not_keep_the_others_from_going_on(start):
    """Case 1 is too narrow for YADE; case 2 gets its products, and the last line names case 1."""
    folder = copy_of(start, "one_fails")
    narrow = TABLE.splitlines()[1].replace("2 0 0.1 1e5 1e5 3", "1 0 0.1 1e5 1e5 2")
    (folder / "cases/fcc.table").write_text(f"{TABLE}{narrow}\n")
    command = ["./run_cases.sh", "--case", "1", "2", "--stage"]
    for stage, status, made in (("sample", 1, "network"), ("highest", 1, "highest.modes")):
        run = subprocess.run([*command, stage], cwd=folder, capture_output=True, text=True)
        assert run.returncode == status
        last = run.stderr.strip().splitlines()[-1]
        assert last.startswith(f"run_cases.sh: failed: case 1: no {made}") and "case 2" not in last
        assert (folder / f"products/case02.{made}.h5").is_file()
    assert not list((folder / "products").glob(".table.*"))


def test_changed_table_makes_the_products_again(reference):
    """Another stress in the table: network, modes and signals follow it, each saying why."""
    folder = copy_of(reference[0], "changed")
    table = folder / "cases/fcc.table"
    table.write_text(TABLE.replace("0.1 1e5", "0.1 2e5"))
    status, error = outcome(folder)
    assert status == 0
    assert "stress was 100000.0, is 200000.0" in (folder / "products/network.2.log").read_text()
    assert "stale, packing was case02.network.h5 (" in "\n".join(error)
    network = packing_of(folder / "products/case02.network.h5")
    for kind in ("highest.modes", "signals", "modes", "translations.modes"):
        path = folder / f"products/case02.{kind}.h5"
        assert read_provenance(path).packing[0] == network[0]


def test_committed_sample_spares_the_compression(start):
    """`--case 30` begins at results/samples, but with a state of one's own at that."""
    folder = copy_of(start, "committed")
    shutil.copy(ROOT / "cases/random.table", folder / "cases")
    (folder / "results/samples").mkdir(parents=True)
    sample = folder / "results/samples/case30.sample.h5"

    def planned() -> str:
        command = ["./run_cases.sh", "--case", "30", "--dry-run"]
        run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        return run.stdout

    assert "compress.py" in planned()
    sample.write_text("")
    assert "compress.py" not in planned() and f"cp results/samples/{sample.name}" in planned()
    state = folder / "products/compression_mu0.4/100000Pa.sample.h5"
    state.parent.mkdir(parents=True)
    state.write_text("")
    assert "modal relax products/compression_mu0.4/100000Pa.sample.h5" in planned()
