"""Faults of a whole study, `run_cases.sh` on a short crystal: killed, doubled, without YADE."""

import os
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest
from killed_runs import (
    MAX_SECONDS,
    assert_equal_products,
    kill_again_and_again,
    run_undisturbed,
    start_script,
)
from study_folder import PAPER, copy_of, driven, planned, study_folder

from modal.formats.provenance import packing_of, read_provenance

KILLS = int(os.environ.get("KILLS", 100))
STUDY = """
names: case{:02d}
groups:
  - kind: fcc
    factors: {stress: [1e4, 1e5]}
    friction: 0
    wave_friction: 0.1
    input_frequency: 1e5
    width: 3
    layers: 20
make:
  fcc: [network, highest.modes, signals, modes, translations.modes]
"""
WAVE_FRACTION = "0.4"
"""Time step of the wave divided by the largest stable one: large, so that the wave is short."""
RUN = f"""
export WAVE_FRACTION=${{WAVE_FRACTION:-{WAVE_FRACTION}}}
for stage in wave modes; do ./run_cases.sh --case 2 -j 2 --stage $stage || exit; done
"""
"""All but the comparison, whose products are tables and figures."""


@pytest.fixture(scope="module")
def start(tmp_path_factory, yade) -> Path:
    """Return the project with a short crystal."""
    return study_folder(tmp_path_factory.mktemp("study") / "start", STUDY)


class Reference(NamedTuple):
    """The folder of an undisturbed study, and the time, s, that it took."""

    folder: Path
    seconds: float


@pytest.fixture(scope="module")
def reference(start) -> Reference:
    """Run the study undisturbed."""
    folder = copy_of(start, "reference")
    seconds = run_undisturbed(RUN, folder)
    assert len(list(folder.rglob("case02.*.h5"))) == 5
    return Reference(folder, seconds)


def run(folder: Path, *options: str) -> subprocess.CompletedProcess:
    """Run `./run_cases.sh` in a folder."""
    variables = os.environ | {"OMP_NUM_THREADS": "1", "WAVE_FRACTION": WAVE_FRACTION}
    command = ["./run_cases.sh", "-j", "2", *options]
    return subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True)


def list_products(folder: Path) -> set[str]:
    """Return the names of the files of all products."""
    return {path.name for path in (folder / "products").glob("*.h5")}


class Waved(NamedTuple):
    """The folder of a study that has its waves, its exit status and the last line of its errors."""

    folder: Path
    status: int
    last_line: str


@pytest.fixture(scope="module")
def waved(start) -> Waved:
    """Run the study as far as its waves, where case 1 is too narrow for YADE."""
    folder = copy_of(start, "waved")
    (folder / PAPER).write_text(STUDY + "cases: {case01: {width: 2}}\n")
    done = run(folder, "--case", "1", "2", "--stage", "wave")
    return Waved(folder, done.returncode, done.stderr.strip().splitlines()[-1])


@pytest.mark.slow
def test_study_killed_a_hundred_times(reference):
    """End the next run with the products of an undisturbed one."""
    again = reference.folder.with_name("again")
    kills = kill_again_and_again(RUN, reference.folder, again, KILLS, reference.seconds)
    assert kills.of_script > 0.8 * KILLS
    assert kills.of_job > 0.4 * KILLS


@pytest.mark.slow
def test_two_studies_in_one_folder_at_once(start, reference):
    folder = copy_of(start, "shared")
    processes = [start_script(RUN, folder) for _ in range(2)]
    assert [process.wait(timeout=MAX_SECONDS) for process in processes] == [0, 0]
    assert_equal_products(reference.folder, folder)


def test_without_a_yade_there_is_no_product(start, tmp_path, monkeypatch, capfd):
    folder = copy_of(start, "without")
    monkeypatch.setenv("YADE", str(tmp_path / "nowhere"))
    status, _ = driven(folder, "", cases=[2], stage="wave")
    assert status == 2
    assert "setup.sh: YADE=" in capfd.readouterr().err.strip().splitlines()[-1]
    assert not list(folder.rglob("*.h5"))


def test_yade_that_crashes_makes_no_product(start, tmp_path, monkeypatch):
    """Report a crash in one line; other failures of yade-batch are in workflow/test_job_scripts."""
    (tmp_path / "crashes").symlink_to(shutil.which("yade"))
    (tmp_path / "crashes-batch").symlink_to(shutil.which("false"))
    folder = copy_of(start, "without")
    monkeypatch.setenv("YADE", str(tmp_path / "crashes"))
    status, output = driven(folder, "", cases=[2], stage="wave")
    assert status == 1
    assert "crystal case02: no product from YADE" in output.strip().splitlines()[-1]
    assert not list(folder.rglob("*.h5"))


def test_wave_that_fails_does_not_keep_the_modes_from_being_made(waved, monkeypatch):
    """Take an unstable time step: the job fails, the study says so, other products are kept."""
    folder = copy_of(waved.folder, "unstable")
    (folder / "products/case02.signals.h5").unlink()
    monkeypatch.setenv("WAVE_FRACTION", "1.5")
    status, output = driven(folder, "", cases=[2])
    assert status == 2
    assert "yade_wave case02: " in output.strip().splitlines()[-1], output
    assert "case02.modes.h5" in list_products(folder)
    assert "case02.signals.h5" not in list_products(folder)
    assert not (folder / "products/results/case02.json").exists()


def test_products_folder_that_is_a_file_is_refused(start):
    folder = copy_of(start, "file")
    (folder / "products").write_text("")
    done = run(folder, "--case", "2", "--stage", "wave")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "products" in done.stderr


def test_case_that_fails_does_not_keep_the_others_from_going_on(waved):
    """Make the products of case 2, and name case 1 in the last line."""
    assert waved.status == 2
    assert waved.last_line.startswith("run_cases.sh: crystal case01: ")
    assert "at least 3" in waved.last_line
    expected = {f"case02.{kind}.h5" for kind in ("network", "highest.modes", "signals")}
    assert list_products(waved.folder) == expected


def test_changed_study_makes_the_products_again(waved, monkeypatch):
    """Plan the network, and what a wave needs of it, again after another stress in the study."""
    folder = copy_of(waved.folder, "changed")
    monkeypatch.setenv("WAVE_FRACTION", WAVE_FRACTION)
    assert planned(folder, cases=[2], stage="wave") == {}
    (folder / PAPER).write_text(STUDY.replace("[1e4, 1e5]", "[1e4, 2e5]"))
    plan = planned(folder, cases=[2], stage="wave")
    assert plan == {"crystal": 1, "highest_mode": 1, "yade_wave": 1, "total": 4}


@pytest.mark.parametrize("kind", ["highest.modes", "signals"])
def test_products_know_the_network_that_they_were_made_from(kind, waved):
    network = waved.folder / "products/case02.network.h5"
    assert read_provenance(network).settings["stress"] == 1e5
    provenance = read_provenance(waved.folder / f"products/case02.{kind}.h5")
    assert provenance.packing[0] == packing_of(network)[0]
