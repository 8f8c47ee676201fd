"""The machine that a benchmark ran on."""

import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path

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
