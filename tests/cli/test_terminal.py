"""Output on a terminal: units, columns, groups, examples of the help, progress; pipes."""

import doctest
import importlib
import io
import math
import re
import shutil
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import program_files
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from places import ROOT

import modal
from modal.cli.main import COMMANDS, main, parser
from modal.cli.terminal import label_and_unit
from modal.packing.network import write_network
from modal.tools import memory
from modal.tools import progress as progress_module
from modal.tools.display import PREFIXES, duration, scaled

POWER = {prefix: power for power, prefix in PREFIXES.items()}


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # on a busy machine
@given(
    st.lists(st.floats(-1e11, 1e11).filter(lambda x: x == 0 or abs(x) > 1e-8), min_size=1),
    st.integers(3, 8),
)
def test_printed_quantities_are_rounded_in_the_last_decimal(values, digits):
    """Read each number back: it differs by at most half of the decimal that the largest fixes."""
    numbers, unit = scaled(values, "Pa", digits)
    scale = 10.0 ** POWER[unit.removesuffix("Pa")]
    largest = max(map(abs, values))
    tolerance = 0.0
    if largest:
        # A carry, 9.9996 to 10.000, is one more digit.
        last_decimal = math.floor(math.log10(largest)) + 2 - digits
        tolerance = 0.5001 * 10.0**last_decimal
    for text, value in zip(numbers, values, strict=True):
        assert abs(float(text) * scale - value) <= tolerance


@pytest.fixture(scope="module")
def folder_of_examples(tmp_path_factory):
    """Return a folder with the files that the help calls mine, and what is made of them first."""
    folder = tmp_path_factory.mktemp("examples")
    network = modal.fcc(cells=(3, 3, 8))  # no pair touches twice, which a table cannot say
    program_files.tables(network, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name in FIRST_COMMANDS:
            assert main(_example(name)) == 0
    shutil.copy(folder / "dense/100000Pa.sample.h5", folder / "mine.sample.h5")
    return folder


FIRST_COMMANDS = ["import", "pack", "modes"]
"""Commands whose products the examples of other commands read."""


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in FIRST_COMMANDS])
def test_example_of_the_help_runs(name, folder_of_examples, monkeypatch, capsys):
    if name == "export":
        pytest.importorskip("meshio")
    monkeypatch.chdir(folder_of_examples)
    assert main(_example(name)) == 0, capsys.readouterr().err


def _example(name):
    """Return the words of a command's example in its help."""
    output = io.StringIO()
    with redirect_stdout(output), pytest.raises(SystemExit):
        parser().parse_args([name, "--help"])
    line = output.getvalue().rstrip().splitlines()[-1]
    return line.removeprefix("example: python -m modal ").split()


ROOMS = ("cli", "exchange", "tools")
MODULES_WITH_EXAMPLES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in sorted((ROOT / "modal").rglob("*.py"))
    if path.relative_to(ROOT / "modal").parts[0] in ROOMS and ">>>" in path.read_text()
]


@pytest.mark.parametrize("name", MODULES_WITH_EXAMPLES)
def test_examples_in_docstrings_run(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_info_shows_each_name_that_json_has(tmp_path, capsys, printed):
    write_network(tmp_path / "fcc.network.h5", modal.fcc(cells=(2, 2, 8)))
    numbers = printed("info", tmp_path / "fcc.network.h5")
    assert main(["info", str(tmp_path / "fcc.network.h5")]) == 0
    shown = capsys.readouterr().out.partition("notes of the file")[0]
    for name in set(numbers) - {"study", "seconds", "peak_memory_bytes"}:
        label = re.escape(label_and_unit(name)[0])
        assert len(re.findall(rf"^ +{label}(?:  |$)", shown, re.MULTILINE)) == 1, name


MEASURE = "analysis measure examples/packings/triaxial.network.h5 --quantities void_ratio"


@pytest.mark.parametrize("command", ["modal lattice", MEASURE])
def test_closed_pipe_is_no_error(command):
    """Close the output at once, as `python -m modal lattice | true` does."""
    words = [sys.executable, "-m", *command.split()]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(words, cwd=ROOT, **pipes) as process:
        process.stdout.close()
        assert b"rror" not in process.stderr.read()
    assert process.returncode == 0


def test_log_has_a_line_a_minute_with_step_and_time_left(monkeypatch):
    """Take steps of 25 s: each third one is more than a minute after the last line."""
    log = io.StringIO()
    now = [0.0]
    monkeypatch.setattr(progress_module.sys, "stderr", log)
    monkeypatch.setattr(progress_module.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(progress_module.Minute, "_last_use", -math.inf)
    for _ in progress_module.progress(40, "wave"):
        now[0] += 25.0
    lines = log.getvalue().splitlines()
    steps = [int(re.match(r"wave: step (\d+) of 40, ", line)[1]) for line in lines]
    assert steps == list(range(3, 41, 3))
    for step, line in zip(steps, lines, strict=True):
        seconds_left = 25.0 * (40 - step)  # equal steps: the estimate is exact
        assert line.endswith(f"{100 * step / 40:3.0f} %, {duration(seconds_left)} left")


def test_peak_memory_is_that_of_the_process_alone():
    """Leave out the memory of the process that started it, which Linux hands on."""
    if not Path("/proc/self/status").exists():
        pytest.skip("only Linux tells a process's own peak")
    array = np.ones(60_000_000)  # 480 MB
    code = "from modal.tools.memory import peak_memory; print(peak_memory())"
    # Forked, as a shell does it: the child's first pages are those of its parent.
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, preexec_fn=lambda: None
    )
    assert 1e7 < int(done.stdout) < array.nbytes <= memory.peak_memory()
