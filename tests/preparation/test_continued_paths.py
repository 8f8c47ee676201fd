"""Loading paths that are killed, extended, or continued from a checkpoint."""

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from places import ROOT
from small_path import SMALL, WRITTEN_STATUSES, pack

from modal.__main__ import main
from modal.packing.sample import read_sample, write_sample
from modal.preparation import study as study_module
from modal.preparation.protocol import CHECKPOINT, OLD_CHECKPOINT


def assert_states_equal(folder, other):
    """Assert that the two states of one folder are those of the other, to the bit."""
    names = [path.name for path in folder.glob("*Pa.sample.h5")]
    assert len(names) == 2
    for name in names:
        expected = read_sample(folder / name)
        sample = read_sample(other / name)
        assert np.array_equal(sample.position, expected.position)
        assert np.array_equal(sample.shear, expected.shear)


def test_further_stress_is_added_to_a_finished_path(make_path, tmp_path):
    """Compare, to the bit, with a single call to both stresses, without friction.

    With friction a path is also killed on the way, in the next test.
    """
    folder, command = make_path("0")
    for stresses in (command[:-1], command):
        assert main([*stresses, "-o", str(tmp_path)]) in WRITTEN_STATUSES
    assert_states_equal(folder, tmp_path)


def kill_at_next_checkpoint(command, folder, delay):
    """Run a command in its own process, and kill it `delay` s after its next checkpoint."""
    checkpoint = folder / CHECKPOINT
    before = checkpoint.stat().st_mtime_ns if checkpoint.exists() else 0
    job = subprocess.Popen(
        [sys.executable, "-m", "modal", *command, "-o", str(folder)],
        cwd=ROOT,
        env=os.environ | {"NUMBA_NUM_THREADS": "1"},
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 100
    while time.monotonic() < deadline and job.poll() is None:
        if checkpoint.exists() and checkpoint.stat().st_mtime_ns != before:
            break
        time.sleep(0.01)
    time.sleep(delay)
    job.send_signal(signal.SIGKILL)
    job.wait()


@pytest.mark.parametrize(
    ("friction", "delay"),
    [
        pytest.param("0.4", 0.1, id="with friction", marks=pytest.mark.slow),
        pytest.param("0", 0.0, id="without friction"),
    ],
)
def test_killed_and_extended_path_ends_equal(friction, delay, make_path, tmp_path):
    """Kill a path to its first stress twice, then extend it; its states are equal to the bit."""
    folder, command = make_path(friction)
    to_first_stress = command[:-1]
    kill_at_next_checkpoint(to_first_stress, tmp_path, 0.0)
    kill_at_next_checkpoint(to_first_stress, tmp_path, delay)
    assert not list(tmp_path.glob("*Pa.sample.h5"))
    for stresses in (to_first_stress, command):
        assert main([*stresses, "-o", str(tmp_path)]) in WRITTEN_STATUSES
    assert_states_equal(folder, tmp_path)


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ("--seed 2 --stress 1e4 1e5", "other_study"),
        ("--friction 0.3 --stress 1e4 1e5", "other_study"),
        ("--stress 5e4 1e6", "other_path"),
    ],
    ids=["seed", "friction", "stresses"],
)
def test_checkpoint_of_another_path_is_kept(options, code, finished_path, refusal_code):
    before = {path.name: path.read_bytes() for path in finished_path.iterdir()}
    assert refusal_code(main, [*SMALL, *options.split(), "-o", finished_path]) == code
    assert before == {path.name: path.read_bytes() for path in finished_path.iterdir()}


def extend_path(finished_path, folder, stage, **changes):
    """Copy a finished path to a folder, with a checkpoint that has begun one more stage."""
    sample = read_sample(finished_path / CHECKPOINT)
    study = sample.study | {"stage": stage, "stage_time": 0.0}
    study["way"] += f"; {stage}"
    shutil.copytree(finished_path, folder, dirs_exist_ok=True)
    write_sample(folder / CHECKPOINT, replace(sample, study=study, **changes))


@pytest.mark.parametrize(
    "stresses", ["1e6", "2e5 5e5 1e6"], ids=["beyond the stage", "before the stage"]
)
def test_path_to_another_stress_is_not_diverted(stresses, finished_path, tmp_path, refusal_code):
    """Refuse a stress beyond the one of the stage, and one before, which would never be written."""
    extend_path(finished_path, tmp_path, "500000")
    command = *SMALL, "--stress", "1e4", "1e5", *stresses.split(), "-o", tmp_path
    assert refusal_code(main, command) == "other_path"


def test_path_of_another_program_is_not_continued(finished_path, tmp_path, refusal_code):
    """Refuse YADE's states, which modal's motion does not reproduce to the bit."""
    for path in finished_path.iterdir():
        sample = read_sample(path)
        provenance = sample.provenance | {"command": "yade_scripts/compress.py"}
        write_sample(tmp_path / path.name, replace(sample, provenance=provenance))
    command = *SMALL, "--stress", "1e4", "1e5", "-o", tmp_path
    assert refusal_code(main, command) == "other_command"


def test_unstable_step_loses_nothing(finished_path, tmp_path, monkeypatch, one_line):
    """Take a step far beyond the limit: the motion explodes, the checkpoint before it stays."""
    stable_step = study_module.time_step
    monkeypatch.setattr(study_module, "time_step", lambda *args: 20 * stable_step(*args))
    extend_path(finished_path, tmp_path, "1e+06", strain_rate=np.full(3, -10.0))
    checkpoint = tmp_path / CHECKPOINT
    before = checkpoint.read_bytes()
    one_line(main, [*SMALL, "--stress", "1e4", "1e5", "1e6", "-o", tmp_path])
    assert checkpoint.read_bytes() == before


def test_full_disk_loses_nothing(finished_path, tmp_path, monkeypatch, capsys):
    """Check that the checkpoint before stays readable, and that the path goes on from it."""
    shutil.copytree(finished_path, tmp_path, dirs_exist_ok=True)

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        assert pack(tmp_path, "--stress", "1e4", "1e5", "2e5") == 2
    shown = capsys.readouterr().err.splitlines()
    assert len([line for line in shown if line.startswith("error: ")]) == 1
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == sorted(path.name for path in finished_path.iterdir())
    assert pack(tmp_path, "--stress", "1e4", "1e5", "2e5") in WRITTEN_STATUSES


def test_path_goes_on_from_a_checkpoint_of_an_earlier_version(finished_path, tmp_path):
    """Check that its old name is gone, so that `measure *.h5` in the folder reads states alone."""
    shutil.copytree(finished_path, tmp_path, dirs_exist_ok=True)
    (tmp_path / CHECKPOINT).rename(tmp_path / OLD_CHECKPOINT)
    before = (tmp_path / "100000Pa.sample.h5").read_bytes()
    assert pack(tmp_path, "--stress", "1e4", "1e5", "1.2e5") in WRITTEN_STATUSES
    assert (tmp_path / "100000Pa.sample.h5").read_bytes() == before
    states = {"10000Pa.sample.h5", "100000Pa.sample.h5", "120000Pa.sample.h5"}
    assert {path.name for path in tmp_path.glob("*.h5")} == states
