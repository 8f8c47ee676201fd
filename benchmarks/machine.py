"""The machine that a benchmark ran on, and how fast it moves memory."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
import time
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


def memory_gb() -> float:
    """Physical memory, GB."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9


def version_of(program: str, *arguments: str) -> str | None:
    """First line that a program prints, None where it is not installed."""
    try:
        done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    except OSError:
        return None
    return (done.stdout or done.stderr).strip().splitlines()[0]


def description() -> list[str]:
    """Lines that say what the numbers were measured on; no names of hosts or folders."""
    versions = []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"no {name}")
    yade = version_of("yade", "--version")
    return [
        f"{processor()}, {os.cpu_count()} cores, {memory_gb():.0f} GB; {platform.system()} "
        f"{platform.machine()}",
        f"Python {platform.python_version()}, " + ", ".join(versions),
        f"YADE: {yade.split()[-1] if yade else 'not installed'}",
    ]


def load() -> float:
    """Programs that want a core, mean over the last five minutes; above the cores: shared."""
    return os.getloadavg()[1]


def bandwidth(megabytes: float = 256.0, times: int = 7) -> dict[str, float]:
    """Bytes a second that one core reads and writes: best of copy a = b and triad a = b + s c.

    Three arrays that no cache holds; in processor time, like the tasks. Counted as the program asks
    for it: a write that first fetches its line moves more, so the bus is faster than this.
    """
    size = int(megabytes * 1e6 / 8)
    a, b, c = np.zeros(size), np.ones(size), np.ones(size)

    def triad() -> None:
        np.multiply(c, 2.0, out=a)
        np.add(a, b, out=a)

    # numpy makes two passes of the triad: five arrays pass, where a compiled loop needs three.
    kinds = {"copy": (lambda: np.copyto(a, b), 2), "triad": (triad, 5)}
    result = {}
    for name, (action, arrays) in kinds.items():
        seconds = []
        for _ in range(times):
            start = time.process_time()
            action()
            seconds.append(time.process_time() - start)
        result[name] = arrays * 8 * size / min(seconds)
    return result
