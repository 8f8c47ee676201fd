"""Find the memory that this process may still allocate: the smallest of all its limits.

These are the machine's free memory, Slurm's grant, the limits of the process (ulimit), and those of
its control groups (containers, systemd), which are nested.
"""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import numpy as np

try:
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]

PROC = Path("/proc")
"""Folder in which Linux describes its processes; it is absent on other systems."""
KIBIBYTE = 2**10
MEBIBYTE = 2**20
SLURM_UNITS = {"": MEBIBYTE, "K": KIBIBYTE, "M": MEBIBYTE, "G": 2**30, "T": 2**40}
"""Bytes of the units behind numbers in Slurm's variables."""
LIMITS_OF_PROCESS = {"RLIMIT_AS": "VmSize", "RLIMIT_DATA": "VmData"}
"""Limits of a process on its addresses and on its data, and the names in Linux of what it uses."""
CONTROL_GROUPS = {
    "cgroup2": (("memory.max", "memory.high"), "memory.current", "inactive_file"),
    "cgroup": (("memory.limit_in_bytes",), "memory.usage_in_bytes", "total_inactive_file"),
}
"""For both versions of control groups: the files of the limits and of the use, and the line of
memory.stat with the use for files that need not stay in memory."""
NO_LIMIT = 2**62
"""Bytes from which on version 1 means that there is no limit; it has no word for that."""


def memory_at_hand() -> float:
    """Return the memory that this process may still allocate, bytes; infinite if unknown."""
    limits = [_of_machine(), _of_slurm(), *_of_process(), *_of_control_groups()]
    return max(min(limits), 0.0)


def peak_memory() -> int:
    """Return the peak resident memory of this process so far, bytes; 0 if it is not known.

    VmHWM is used because the programs that a process starts inherit its `ru_maxrss` in Linux.
    """
    peak = _status().get("VmHWM")
    if peak is not None:
        return int(peak)
    if resource is None:
        return 0
    unit = 1 if sys.platform == "darwin" else KIBIBYTE
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def _of_machine() -> float:
    """Return the machine's free memory, bytes, or its total memory if the former is not known."""
    with suppress(OSError, StopIteration):
        lines = (PROC / "meminfo").read_text().splitlines()
        free = next(line for line in lines if line.startswith("MemAvailable:"))
        return float(KIBIBYTE * int(free.split()[1]))
    with suppress(OSError, ValueError, AttributeError):  # AttributeError on Windows
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return np.inf


def _of_slurm() -> float:
    """Return the memory that Slurm has granted this job on a node, bytes, or infinity.

    In Slurm 0 means all memory of the node. A text that is not an amount of memory is ignored,
    because the variables may be set by other programs.
    """
    of_node = _slurm_bytes("SLURM_MEM_PER_NODE")
    if of_node:
        return of_node
    cores = os.environ.get("SLURM_CPUS_ON_NODE", "")
    count = int(cores) if cores.isdecimal() and int(cores) > 0 else 1
    return count * _slurm_bytes("SLURM_MEM_PER_CPU") or np.inf


def _slurm_bytes(variable: str) -> float:
    """Return an amount of memory as Slurm writes it, 4096 (MB) or 4G, in bytes; 0 if absent."""
    written = re.fullmatch(r"(\d+(?:\.\d+)?)([KMGT]?)B?", os.environ.get(variable, "").upper())
    return float(written[1]) * SLURM_UNITS[written[2]] if written else 0.0


def _of_process() -> Iterator[float]:
    """Yield the memory, bytes, that each limit of the process itself leaves."""
    if resource is None:
        return
    status = _status()
    for name, used in LIMITS_OF_PROCESS.items():
        limit = resource.getrlimit(getattr(resource, name))[0]
        if limit != resource.RLIM_INFINITY:
            yield limit - status.get(used, 0.0)


def _of_control_groups() -> Iterator[float]:
    """Yield the memory, bytes, that each control group around the process leaves."""
    for kind, folder in _control_groups():
        limits, used, files = CONTROL_GROUPS[kind]
        for limit in limits:
            with suppress(OSError, ValueError):  # ValueError: "max", no limit
                room = int((folder / limit).read_text())
                if room < NO_LIMIT:
                    yield room - int((folder / used).read_text()) + _statistic(folder, files)


def _statistic(folder: Path, name: str) -> int:
    """Return a number in memory.stat of a control group; 0 if it is absent."""
    with suppress(OSError):
        for line in (folder / "memory.stat").read_text().splitlines():
            if line.split()[:1] == [name]:
                return int(line.split()[1])
    return 0


def _control_groups() -> list[tuple[str, Path]]:
    """Return version and folder of this process's memory control groups, the innermost first."""
    with suppress(OSError):
        groups = (PROC / "self/cgroup").read_text()
        return _mounted_groups(groups, (PROC / "self/mountinfo").read_text())
    return []


@lru_cache(maxsize=1)
def _mounted_groups(groups: str, mounts: str) -> list[tuple[str, Path]]:
    """Return version and folder of memory control groups from two files of Linux.

    In a container, a mount may show a nested group as the root. The files hardly ever change, and
    the memory is estimated often, so that they are read only once.
    """
    paths = dict(_own_groups(groups))
    folders = []
    for line in mounts.splitlines():
        before, _, after = line.partition(" - ")
        kind = after.split()[0]
        if kind not in paths or (kind == "cgroup" and "memory" not in _options(after)):
            continue
        root, mount = (Path(_plain(word)) for word in before.split()[3:5])
        path = Path(paths[kind])
        below = path.relative_to(root) if path.is_relative_to(root) else Path()
        for inner in (below, *below.parents):
            folders.append((kind, mount / inner))
    return folders


def _own_groups(groups: str) -> Iterator[tuple[str, str]]:
    """Yield the version and the path of the control groups that this process is in."""
    for line in groups.splitlines():
        _, controllers, path = line.split(":", 2)
        if not controllers:
            yield "cgroup2", path
        elif "memory" in controllers.split(","):
            yield "cgroup", path


def _options(after: str) -> list[str]:
    """Return the options of a mounted file system, which are the last word of its line.

    `after` is the part of the line after the dash.
    """
    return after.split()[-1].split(",")


def _plain(word: str) -> str:
    """Return a path of mountinfo with blanks in place of their octal codes."""
    return re.sub(r"\\(\d{3})", lambda octal: chr(int(octal[1], 8)), word)


def _status() -> dict[str, float]:
    """Return the sizes, bytes, by name that Linux reports for this process; empty elsewhere."""
    with suppress(OSError):
        lines = (PROC / "self/status").read_text(errors="replace").splitlines()
        sizes = (line.split() for line in lines if line.endswith(" kB"))
        return {name.rstrip(":"): KIBIBYTE * float(size) for name, size, _ in sizes}
    return {}
