"""Description of the machine that runs a benchmark."""

import importlib.metadata
import os
import platform
import re
import subprocess
from pathlib import Path

PACKAGES = ("numpy", "scipy", "numba", "pypardiso", "h5py")


def processor() -> str:
    """Return the model of the processor as the system names it."""
    listed = Path("/proc/cpuinfo")
    names = re.findall("model name.*: (.*)", listed.read_text()) if listed.exists() else []
    return names[0] if names else platform.processor() or platform.machine()


def yade_version() -> str:
    """Return the version of YADE as it prints it."""
    try:
        done = subprocess.run(["yade", "--version"], capture_output=True, text=True, check=False)
    except OSError:
        return "not installed"
    return (done.stdout or done.stderr).split()[-1]


def description() -> str:
    """Return hardware and versions of programs, without names of hosts or folders."""
    installed = {each.name: each.version for each in importlib.metadata.distributions()}
    versions = [f"{name} {installed.get(name, 'absent')}" for name in PACKAGES]
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return (
        f"{processor()}, {os.cpu_count()} cores, {memory:.0f} GB; {platform.system()} "
        f"{platform.machine()}; Python {platform.python_version()}, {', '.join(versions)}; "
        f"YADE {yade_version()}"
    )


def load() -> float:
    """Return the mean number of runnable programs over the last five minutes."""
    return os.getloadavg()[1]
