"""The machine that a benchmark ran on, and how fast it moves memory and computes."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

PACKAGES = ("numpy", "scipy", "numba", "pypardiso", "h5py")


def processor() -> str:
    """Model of the processor as the system names it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def yade_version() -> str:
    """As YADE prints it."""
    try:
        done = subprocess.run(["yade", "--version"], capture_output=True, text=True, check=False)
    except OSError:
        return "not installed"
    return (done.stdout or done.stderr).split()[-1]


def description() -> str:
    """What the numbers were measured on; no names of hosts or folders."""
    versions = []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"no {name}")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return (
        f"{processor()}, {os.cpu_count()} cores, {memory:.0f} GB; {platform.system()} "
        f"{platform.machine()}; Python {platform.python_version()}, {', '.join(versions)}; "
        f"YADE {yade_version()}"
    )


def load() -> float:
    """Programs that want a core, mean over the last five minutes; above the cores: shared."""
    return os.getloadavg()[1]


def fastest(action: Callable[[], object], times: int = 5) -> float:
    """Least processor time, s, of several runs; of however many threads, it is that of one."""
    seconds = []
    for _ in range(times):
        start = time.process_time()
        action()
        seconds.append(time.process_time() - start)
    return max(min(seconds), 1e-9)


def bandwidth(megabytes: float = 256.0) -> dict[str, float]:
    """Bytes a second that one core reads (dot), and reads and writes (copy).

    Of arrays that no cache holds.
    """
    a, b = np.ones((2, int(megabytes * 1e6 / 8)))
    actions = {"copy": lambda: np.copyto(a, b), "dot": lambda: np.dot(a, b)}
    return {name: (a.nbytes + b.nbytes) / fastest(action) for name, action in actions.items()}


def arithmetic(rows: int = 1000) -> float:
    """Multiplications and additions a second of one core, in a dense product."""
    a = np.random.default_rng(1).random((rows, rows))
    return 2.0 * rows**3 / fastest(lambda: a @ a)
