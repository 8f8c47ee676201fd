"""Progress in a log, by a clock that ticks as told; memory without Linux."""

import io
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from modal.tools import progress as module
from modal.tools import workload
from modal.tools.display import duration


def test_a_log_has_a_line_a_minute_with_step_and_time_to_go(monkeypatch):
    """Steps of 25 s: a line after every third, more than a minute after the last one."""
    log, now = io.StringIO(), [0.0]
    monkeypatch.setattr(module.sys, "stderr", log)
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(module.Minute, "_asked", -math.inf)
    for _ in module.progress(40, "wave"):
        now[0] += 25.0
    lines = log.getvalue().splitlines()
    steps = [int(re.match(r"wave: step (\d+) of 40, ", line)[1]) for line in lines]
    assert steps == list(range(3, 41, 3))
    for step, line in zip(steps, lines, strict=True):
        left = 25.0 * (40 - step)  # equal steps: the estimate is exact
        assert line.endswith(f"{100 * step / 40:3.0f} %, {duration(left)} left")


def test_memory_of_a_system_without_proc(monkeypatch):
    """As on macOS, which tells its physical memory alone: at least what Linux says is free."""
    free, peak = workload.memory_at_hand(), workload.peak_memory()

    def refuse(path, *_):
        raise FileNotFoundError(path)

    monkeypatch.setattr(workload, "open", refuse, raising=False)
    assert free <= workload.memory_at_hand() < 1e15
    assert workload.peak_memory() >= 0.9 * peak


def test_peak_memory_is_that_of_the_process_alone():
    """Not of the process that started it, which Linux hands on."""
    if not Path("/proc/self/status").exists():
        pytest.skip("only Linux tells a process's own peak")
    held = np.ones(60_000_000)  # 480 MB
    code = "from modal.tools.workload import peak_memory; print(peak_memory())"
    # Forked, as a shell does it: the child's first pages are those of its parent.
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, preexec_fn=lambda: None
    )
    assert 1e7 < int(done.stdout) < held.nbytes <= workload.peak_memory()
