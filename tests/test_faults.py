"""Runs that are killed, doubled or interrupted: every file is whole or absent.

The next run ends with the very products of an undisturbed one.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from killed_runs import (
    MAX_SECONDS,
    ONE_THREAD,
    assert_equal_products,
    kill_again_and_again,
    run_undisturbed,
    start_script,
)
from places import ROOT

from modal.packing.sample import read_sample

PACK = """
set -e
run() { "$PYTHON" -m modal "$@" >/dev/null 2>&1; }
run pack --spheres 30 --aspect 2 --stress 1e5 -o chain
[ -f a.modes.h5 ] || run modes chain/100000Pa.sample.h5 --all -o a.modes.h5
"""
PACK_AND_WAVE = f"""
{PACK}
[ -f a.signals.h5 ] || run wave chain/100000Pa.sample.h5 --duration 3e-5 -o a.signals.h5
"""
WALK = """
"$PYTHON" -m modal pack --friction 0.4 --spheres 400 --width 5 --stress 1e4 1e5 1e6 -o walk
"""


@pytest.mark.parametrize(
    ("script", "files", "kills", "min_met"),
    [
        (PACK, 2, 1, 0),
        pytest.param(PACK_AND_WAVE, 3, 50, 41, marks=pytest.mark.slow),
        pytest.param(WALK, 3, 20, 16, marks=pytest.mark.slow),
    ],
    ids=["pack", "pack and wave", "walk"],
)
def test_killed_script_ends_with_the_same_products(script, files, kills, min_met, tmp_path):
    """Take the very steps again from the last checkpoint: all files are equal to the bit."""
    reference = tmp_path / "reference"
    seconds = run_undisturbed(script, reference)
    products = [path for path in reference.rglob("*.h5") if "checkpoint" not in path.name]
    assert len(products) == files
    met = kill_again_and_again(script, reference, tmp_path / "again", kills, seconds)
    assert met.of_script >= min_met


@pytest.mark.slow
def test_two_packings_in_one_folder_at_once(tmp_path):
    run_undisturbed(PACK_AND_WAVE, tmp_path / "reference")
    processes = [start_script(PACK_AND_WAVE, tmp_path / "shared") for _ in range(2)]
    assert [process.wait(timeout=MAX_SECONDS) for process in processes] == [0, 0]
    assert_equal_products(tmp_path / "reference", tmp_path / "shared")


def run_interrupted(words: list[str], folder: Path, seconds: float | None = None):
    """Run Python with Ctrl-C after some seconds, or by the program itself.

    Returns the exit status and standard error.
    """
    process = subprocess.Popen(
        [sys.executable, *words],
        cwd=folder,
        env=os.environ | ONE_THREAD | {"PYTHONPATH": f"{folder}:{ROOT}"},
        stderr=subprocess.PIPE,
        text=True,
        # A shell's background jobs ignore Ctrl-C, and so do their children.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    if seconds is not None:
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    return process.returncode, errors


INTERRUPTED = "interrupted; files are whole or absent"


def test_interrupt_is_one_line_and_leaves_nothing_half(tmp_path):
    """Interrupt while a larger packing is made."""
    folder = tmp_path / "out"
    words = ["-m", "modal", "pack", "--spheres", "20000", "-o", str(folder)]
    status, errors = run_interrupted(words, tmp_path, seconds=4)
    assert status == 130
    # A quick machine has a state or two by then, each with a line of its own.
    assert errors.splitlines()[-1] == INTERRUPTED
    assert "Traceback" not in errors
    assert not list(folder.glob(".*"))
    for path in folder.glob("*.h5"):
        read_sample(path)


INTERRUPT = "import os, signal, time; os.kill(os.getpid(), signal.SIGINT); time.sleep(0.1)"
MOMENTS = {
    "as it is loaded": INTERRUPT,
    "as an object is deleted": (
        f"class A:\n    def __del__(self):\n        {INTERRUPT}\nA()\nraise SystemExit(0)"
    ),
}
"""Modules that interrupt themselves where Ctrl-C as an exception is a traceback, or lost."""


@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("program", ["modal", "analysis"])
def test_interrupt_at_any_moment_is_one_line(program, moment, tmp_path):
    """Load a module that interrupts itself in place of a library."""
    (tmp_path / "numpy.py").write_text(MOMENTS[moment])
    status, errors = run_interrupted(["-m", program, "--help"], tmp_path)
    assert status == 130
    assert errors == f"{INTERRUPTED}\n"
