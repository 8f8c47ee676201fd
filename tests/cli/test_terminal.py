"""What people see on a terminal: units, columns, groups, examples of the help, progress; pipes."""

import doctest
import importlib
import importlib.util
import io
import math
import re
import subprocess
import sys
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
from modal.tools import progress as module
from modal.tools.display import PREFIXES, duration, scaled

POWER = {prefix: power for power, prefix in PREFIXES.items()}


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # on a busy machine
@given(
    st.lists(st.floats(-1e11, 1e11).filter(lambda x: x == 0 or abs(x) > 1e-8), min_size=1),
    st.integers(3, 8),
)
def test_quantities_say_the_numbers(values, digits):
    """Read back, each differs by at most half of the last decimal, which the largest fixes."""
    numbers, unit = scaled(values, "Pa", digits)
    scale = 10.0 ** POWER[unit.removesuffix("Pa")]
    largest = max(map(abs, values))
    # Half a unit in the largest number's last digit; a carry, 9.9996 to 10.000, is one more digit.
    tolerance = 0.5001 * 10.0 ** (math.floor(math.log10(largest)) + 2 - digits) if largest else 0
    for text, value in zip(numbers, values, strict=True):
        assert abs(float(text) * scale - value) <= tolerance


def test_examples_of_the_help_run(tmp_path, monkeypatch, capsys):
    """What the help calls mine is small here, and imported before anything is made of it."""
    monkeypatch.chdir(tmp_path)
    network = modal.fcc(cells=(3, 3, 8))  # no pair touches twice, which a table cannot say
    program_files.tables(network, tmp_path)
    first = ["import", "pack", "modes"]
    for name in first + [name for name in COMMANDS if name not in first]:
        example = _example(name, capsys)
        if name == "export" and importlib.util.find_spec("meshio") is None:
            continue
        assert main(example) == 0, (name, capsys.readouterr().err)
        if name == "pack":
            (tmp_path / "dense/100000Pa.sample.h5").rename(tmp_path / "mine.sample.h5")


def _example(name, capsys):
    with pytest.raises(SystemExit):
        parser().parse_args([name, "--help"])
    line = capsys.readouterr().out.rstrip().splitlines()[-1]
    return line.removeprefix("example: python -m modal ").split()


def test_examples_in_docstrings_run():
    """Of all modules of these rooms."""
    for room in ("cli", "exchange", "tools"):
        for path in (ROOT / "modal" / room).rglob("*.py"):
            if ">>>" in path.read_text():
                name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
                assert doctest.testmod(importlib.import_module(name)).failed == 0, name


def test_info_shows_each_name_that_json_has(tmp_path, capsys, printed):
    write_network(tmp_path / "fcc.network.h5", modal.fcc(cells=(2, 2, 8)))
    told = printed("info", tmp_path / "fcc.network.h5")
    assert main(["info", str(tmp_path / "fcc.network.h5")]) == 0
    shown = capsys.readouterr().out.partition("notes of the file")[0]
    for name in set(told) - {"study", "seconds", "peak_memory_bytes"}:
        label = re.escape(label_and_unit(name)[0])
        assert len(re.findall(rf"^ +{label}(?:  |$)", shown, re.MULTILINE)) == 1, name


MEASURE = "analysis measure examples/packings/triaxial.network.h5 --quantities void_ratio"


@pytest.mark.parametrize("command", ["modal lattice", MEASURE])
def test_a_reader_that_has_seen_enough_is_no_error(command):
    """As with `python -m modal lattice | true`: what it read stays, nothing is said."""
    words, pipe = [sys.executable, "-m", *command.split()], subprocess.PIPE
    with subprocess.Popen(words, cwd=ROOT, stdout=pipe, stderr=pipe) as run:
        run.stdout.close()
        assert b"rror" not in run.stderr.read()
    assert run.returncode == 0


def test_a_log_has_a_line_a_minute_with_step_and_time_to_go(monkeypatch):
    """Steps of 25 s: a line after every third, more than a minute after the last one."""
    log, now = io.StringIO(), [0.0]
    monkeypatch.setattr(module.sys, "stderr", log)
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(module.Minute, "_last_use", -math.inf)
    for _ in module.progress(40, "wave"):
        now[0] += 25.0
    lines = log.getvalue().splitlines()
    steps = [int(re.match(r"wave: step (\d+) of 40, ", line)[1]) for line in lines]
    assert steps == list(range(3, 41, 3))
    for step, line in zip(steps, lines, strict=True):
        left = 25.0 * (40 - step)  # equal steps: the estimate is exact
        assert line.endswith(f"{100 * step / 40:3.0f} %, {duration(left)} left")


def test_peak_memory_is_that_of_the_process_alone():
    """Not of the process that started it, which Linux hands on."""
    if not Path("/proc/self/status").exists():
        pytest.skip("only Linux tells a process's own peak")
    held = np.ones(60_000_000)  # 480 MB
    code = "from modal.tools.memory import peak_memory; print(peak_memory())"
    # Forked, as a shell does it: the child's first pages are those of its parent.
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, preexec_fn=lambda: None
    )
    assert 1e7 < int(done.stdout) < held.nbytes <= memory.peak_memory()
