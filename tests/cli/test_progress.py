"""Progress on a terminal and in a log, by a clock that ticks as told; memory without Linux."""

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


class Screen(io.StringIO):
    def __init__(self, terminal):
        super().__init__()
        self.terminal = terminal

    def isatty(self):
        return self.terminal


@pytest.fixture
def said(monkeypatch):
    """What a loop of 40 steps says, each of so many seconds."""

    def run(terminal, seconds, count=40, loops=1):
        screen, now = Screen(terminal), [0.0]
        monkeypatch.setattr(module.sys, "stderr", screen)
        monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
        monkeypatch.setattr(module.Minute, "_asked", -math.inf)
        for _ in range(loops):
            for k in module.progress(count, "wave"):
                assert k < count
                now[0] += seconds
        return screen.getvalue()

    return run


def test_a_log_has_a_line_a_minute_with_step_and_time_to_go(said):
    """Steps of 25 s: a line after every third, more than a minute after the last one."""
    lines = said(terminal=False, seconds=25.0).splitlines()
    steps = [int(re.match(r"wave: step (\d+) of 40, ", line)[1]) for line in lines]
    assert steps == list(range(3, 41, 3))
    for step, line in zip(steps, lines, strict=True):
        left = 25.0 * (40 - step)  # equal steps: the estimate is exact
        assert line.endswith(f"{100 * step / 40:3.0f} %, {duration(left)} left")


@pytest.mark.parametrize(
    ("seconds", "count", "loops", "lines"),
    [
        (1.4, 40, 1, 0),  # one of 56 s
        (1.9, 10, 20, 380 // 61),  # whenever more than a minute has gone
        (0.5, 10, 100, 0),  # a minute after the last line of others, but in their own first 6 s
    ],
)
def test_short_loops_leave_a_line_a_minute_in_a_log(said, seconds, count, loops, lines):
    assert said(False, seconds, count, loops).count("\n") == lines


def test_a_terminal_has_a_bar_that_is_wiped_away(said):
    text = said(terminal=True, seconds=1.0)
    bars = re.findall(r"\[(#*) *\]", text)
    assert [len(bar) for bar in bars] == [int(module.WIDTH * k / 40) for k in range(1, 41)]
    assert "\n" not in text and text.endswith("\r\033[K")


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
