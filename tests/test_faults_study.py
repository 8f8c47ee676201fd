"""Faults of a whole study, `run_cases.sh` on a short crystal: killed, doubled, without YADE."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from study_folder import PAPER, copy_of, planned, study_folder
from test_faults import equal, killed_again_and_again, study, undisturbed

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
RUN = """
export WAVE_FRACTION=${WAVE_FRACTION:-0.4}
for stage in wave modes; do ./run_cases.sh --case 2 -j 2 --stage $stage || exit; done
"""
"""All but the comparison, whose products are tables and figures."""


@pytest.fixture(scope="module")
def start(tmp_path_factory, yade) -> Path:
    """The project with a short crystal."""
    return study_folder(tmp_path_factory.mktemp("study") / "start", STUDY)


@pytest.fixture(scope="module")
def reference(start) -> tuple[Path, float]:
    """The undisturbed study, and the seconds that it took."""
    folder = copy_of(start, "reference")
    seconds = undisturbed(RUN, folder)
    assert len(list(folder.rglob("case02.*.h5"))) == 5
    return folder, seconds


def run(folder: Path, *options: str, **environment: str) -> subprocess.CompletedProcess:
    """`./run_cases.sh` there."""
    variables = os.environ | {"OMP_NUM_THREADS": "1", "WAVE_FRACTION": "0.4"} | environment
    command = ["./run_cases.sh", "-j", "2", *options]
    return subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True)


@pytest.fixture(scope="module")
def waved(start) -> tuple[Path, subprocess.CompletedProcess]:
    """The study as far as its waves, where case 1 is too narrow for YADE; how that ended."""
    folder = copy_of(start, "waved")
    narrow = STUDY + "cases: {case01: {width: 2}}\n"
    (folder / PAPER).write_text(narrow)
    return folder, run(folder, "--case", "1", "2", "--stage", "wave")


@pytest.mark.slow
def test_study_killed_a_hundred_times(reference):
    """The next run ends with the products of an undisturbed one."""
    folder, seconds = reference
    again = folder.with_name("again")
    alive, at_work = killed_again_and_again(RUN, folder, again, KILLS, seconds)
    assert alive > 0.8 * KILLS and at_work > 0.4 * KILLS


@pytest.mark.slow
def test_two_studies_in_one_folder_at_once(start, reference):
    folder = copy_of(start, "shared")
    both = [study(RUN, folder) for _ in range(2)]
    assert [process.wait(timeout=600) for process in both] == [0, 0]
    equal(reference[0], folder)


@pytest.mark.parametrize(
    ("program", "status", "said"),
    [("nowhere", 2, "setup.sh: YADE="), ("crashes", 1, "crystal case02: no product from YADE")],
)
def test_without_a_yade_that_works_there_is_no_product(program, status, said, start, tmp_path):
    """But one line: none, a crash; other failures of yade-batch in test_study_jobs.py."""
    for name, stands_there in (("crashes", "yade"), ("crashes-batch", "false")):
        (tmp_path / name).symlink_to(shutil.which(stands_there))
    folder = copy_of(start, "without")
    done = run(folder, "--case", "2", "--stage", "wave", YADE=str(tmp_path / program))
    assert done.returncode == status and said in done.stderr.strip().splitlines()[-1]
    assert not list(folder.rglob("*.h5"))


def test_wave_that_fails_does_not_keep_the_modes_from_being_made(waved):
    """An unstable time step: the job fails, the study says so; what is finished is kept."""
    folder = copy_of(waved[0], "unstable")
    (folder / "products/case02.signals.h5").unlink()
    done = run(folder, "--case", "2", WAVE_FRACTION="1.5")
    error = done.stderr.strip().splitlines()
    assert done.returncode == 2 and "yade_wave case02: " in error[-1], error
    made = {path.name for path in (folder / "products").glob("*.h5")}
    assert "case02.modes.h5" in made and "case02.signals.h5" not in made
    assert not (folder / "products/results/case02.json").exists()


def test_products_folder_that_is_a_file(start):
    folder = copy_of(start, "file")
    (folder / "products").write_text("")
    done = run(folder, "--case", "2", "--stage", "wave")
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "products" in done.stderr


def test_case_that_fails_does_not_keep_the_others_from_going_on(waved):
    """Case 2 gets its products, and the last line names case 1."""
    folder, done = waved
    assert done.returncode == 2
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("run_cases.sh: crystal case01: ") and "at least 3" in last
    made = {path.name for path in (folder / "products").glob("*.h5")}
    assert made == {f"case02.{kind}.h5" for kind in ("network", "highest.modes", "signals")}


def test_changed_study_makes_the_products_again(waved, monkeypatch):
    """Another stress in the study: by plan the network and what a wave needs follow it."""
    folder = copy_of(waved[0], "changed")
    monkeypatch.setenv("WAVE_FRACTION", "0.4")
    assert planned(folder, cases=[2], stage="wave") == {}
    (folder / PAPER).write_text(STUDY.replace("[1e4, 1e5]", "[1e4, 2e5]"))
    again = planned(folder, cases=[2], stage="wave")
    assert again == {"crystal": 1, "highest_mode": 1, "yade_wave": 1, "total": 4}
    network = packing_of(folder / "products/case02.network.h5")
    assert read_provenance(folder / "products/case02.network.h5").settings["stress"] == 1e5
    for kind in ("highest.modes", "signals"):
        assert read_provenance(folder / f"products/case02.{kind}.h5").packing[0] == network[0]
