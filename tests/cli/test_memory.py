"""Memory at hand: the smallest of all limits; what exceeds it is refused in one line."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import modal
from modal.cli.main import main
from modal.packing.network import write_network
from modal.tools import memory

GIGABYTE = 10**9


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Return the root of a Linux with 16 GB free, no limits of this process, no control groups."""
    for name in [name for name in os.environ if name.startswith("SLURM_")]:
        monkeypatch.delenv(name)
    monkeypatch.setattr(memory, "PROC", tmp_path / "proc")
    monkeypatch.setattr(memory, "resource", None)
    write(tmp_path / "proc/meminfo", "MemTotal: 32000000 kB\nMemAvailable: 15625000 kB\n")
    assert memory.memory_at_hand() == 16e9
    return tmp_path


def write(path: Path, text: str) -> None:
    """Write a file and its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def mount_groups(machine: Path, kind: str, root: str, group: str, options: str) -> Path:
    """Mount a folder of control groups that shows those below `root`; this process is in `group`.

    Returns the folder.
    """
    folder = machine / "control groups"
    escaped = str(folder).replace(" ", r"\040")
    line = f"30 23 0:26 {root} {escaped} rw,nosuid shared:4 - {kind} cgroup {options}\n"
    write(machine / "proc/self/mountinfo", "21 1 8:1 / / rw - ext4 /dev/sda rw\n" + line)
    controllers = "" if kind == "cgroup2" else "cpu,memory"
    write(machine / "proc/self/cgroup", f"3:pids:/elsewhere\n0:{controllers}:{group}\n")
    return folder


def write_group(folder: Path, limit: object, used: int, inactive_files: int) -> None:
    """Write the files of a control group of version 2, numbers in bytes."""
    write(folder / "memory.max", f"{limit}\n")
    write(folder / "memory.current", f"{used}\n")
    write(folder / "memory.stat", f"anon 5\ninactive_file {inactive_files}\n")


@pytest.fixture(params=[("/", "/job/step"), ("/docker/abc", "/docker/abc/job/step")], ids=str)
def nested_groups(request, machine) -> Path:
    """Return the folder of control groups of version 2 inside of each other."""
    root, group = request.param
    folder = mount_groups(machine, "cgroup2", root, group, "rw")
    write_group(folder, "max", 9 * GIGABYTE, 0)
    write_group(folder / "job", 3 * GIGABYTE, 2 * GIGABYTE, GIGABYTE // 2)
    write_group(folder / "job/step", 8 * GIGABYTE, GIGABYTE, 0)
    return folder


def test_control_group_leaves_its_limit_without_its_use(nested_groups):
    """Subtract the use, but for files that need not stay; `max` is no limit."""
    assert memory.memory_at_hand() == 1.5e9


def test_high_mark_of_a_control_group_is_a_limit(nested_groups):
    write(nested_groups / "job/step/memory.high", f"{2 * GIGABYTE}\n")
    assert memory.memory_at_hand() == 1e9


@pytest.fixture(params=["/slurm/job_7", "/docker/abc"])
def old_group(request, machine) -> Path:
    """Return a control group of version 1; a container's own is the root of what it sees."""
    group = request.param
    if "docker" in group:
        folder = mount_groups(machine, "cgroup", group, group, "rw,cpu,memory")
    else:
        folder = mount_groups(machine, "cgroup", "/", group, "rw,cpu,memory") / "slurm/job_7"
    write(folder / "memory.limit_in_bytes", f"{4 * GIGABYTE}\n")
    write(folder / "memory.usage_in_bytes", f"{3 * GIGABYTE}\n")
    write(folder / "memory.stat", f"total_inactive_file {GIGABYTE}\n")
    return folder


def test_control_group_of_version_1_leaves_its_limit_without_its_use(old_group):
    assert memory.memory_at_hand() == 2e9


def test_largest_integer_is_no_limit_of_a_control_group_of_version_1(old_group):
    write(old_group / "memory.limit_in_bytes", "9223372036854771712\n")
    assert memory.memory_at_hand() == 16e9


def test_group_that_uses_more_than_its_limit_leaves_nothing(machine):
    folder = mount_groups(machine, "cgroup2", "/", "/", "rw")
    write_group(folder, GIGABYTE, 2 * GIGABYTE, 0)
    assert memory.memory_at_hand() == 0


@pytest.mark.parametrize(
    ("variables", "bytes_"),
    [
        ({"MEM_PER_NODE": "4096"}, 2**32),
        ({"MEM_PER_NODE": "4G"}, 2**32),
        ({"MEM_PER_NODE": "4194304k"}, 2**32),
        ({"MEM_PER_NODE": "4096MB"}, 2**32),
        ({"MEM_PER_NODE": "0"}, 16e9),
        ({"MEM_PER_NODE": "all"}, 16e9),
        ({"MEM_PER_NODE": ""}, 16e9),
        ({"MEM_PER_NODE": "-5"}, 16e9),
        ({"MEM_PER_CPU": "1G", "CPUS_ON_NODE": "4"}, 2**32),
        ({"MEM_PER_CPU": "1024", "CPUS_ON_NODE": "4(x2)"}, 2**30),
        ({"MEM_PER_CPU": "1024"}, 2**30),
    ],
)
def test_memory_that_slurm_grants_is_a_limit(machine, monkeypatch, variables, bytes_):
    """Read MB, or a number with a unit; any other text is no limit."""
    for name, value in variables.items():
        monkeypatch.setenv(f"SLURM_{name}", value)
    assert memory.memory_at_hand() == bytes_


@pytest.mark.parametrize("limit", ["RLIMIT_AS", "RLIMIT_DATA"], ids=["addresses", "data"])
def test_limit_of_the_process_leaves_what_the_process_does_not_have(limit):
    """Read the memory at hand in a process of its own, before and after the limit."""
    pytest.importorskip("resource")
    if not Path("/proc/self/status").exists():
        pytest.skip("only Linux tells what a process has")
    code = (
        "import resource; from modal.tools.memory import memory_at_hand\n"
        f"print(memory_at_hand()); resource.setrlimit(resource.{limit}, (2 * 10**9,) * 2)\n"
        "print(memory_at_hand())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    before, after = map(float, done.stdout.split())
    assert 0 < after < min(2e9, before)


def test_macos_tells_its_whole_memory_alone(monkeypatch, tmp_path):
    free = memory.memory_at_hand()
    peak = memory.peak_memory()
    monkeypatch.setattr(memory, "PROC", tmp_path)
    assert free <= memory.memory_at_hand() < 1e15
    assert memory.peak_memory() >= 0.9 * peak


def test_windows_tells_no_memory(monkeypatch, tmp_path):
    """Hide /proc and the modules that ask for limits, which Windows lacks."""
    monkeypatch.setattr(memory, "PROC", tmp_path)
    monkeypatch.setattr(memory, "resource", None)
    monkeypatch.delattr(os, "sysconf", raising=False)
    monkeypatch.delenv("SLURM_MEM_PER_NODE", raising=False)
    monkeypatch.delenv("SLURM_MEM_PER_CPU", raising=False)
    assert memory.memory_at_hand() == np.inf
    assert memory.peak_memory() == 0


def test_without_the_modules_that_windows_lacks():
    """Hide resource and fcntl: make a network, its modes, a wave, and measure a quantity."""
    code = (
        "import sys; sys.modules.update(resource=None, fcntl=None, pwd=None, termios=None);"
        "import modal, analysis; n = modal.fcc(cells=(1, 1, 12));"
        "print(modal.eigenmodes(n, lowest=2).certified);"
        "print(len(modal.propagate(n, 2e-5).signals.source_stress) > 2);"
        "print(analysis.measure(n, quantities=['void_ratio'])['void_ratio'].known);"
        "from modal.cli.main import main; print(main(['lattice']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    answers = done.stdout.split("\n")
    assert answers[:3] == ["True", "True", "True"]
    assert answers[-2] == "0"


@pytest.mark.parametrize(
    "error", [MemoryError(), np._core._exceptions._ArrayMemoryError((9,), np.dtype(float))]
)
def test_command_that_finds_no_memory_ends_in_one_line(error, tmp_path, monkeypatch, capsys):
    """Refuse also where no estimate has foreseen it."""
    write_network(tmp_path / "a.network.h5", modal.fcc(cells=(1, 1, 4)))

    def fail(*_, **__):
        raise error

    monkeypatch.setattr("modal.cli.info.summary", fail)
    assert main(["info", str(tmp_path / "a.network.h5")]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ")
    assert printed.err.count("\n") == 1
    assert printed.out == ""
