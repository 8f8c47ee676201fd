"""Memory: the smallest of all limits is asked, and what exceeds it is refused in one line."""

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
    """A Linux of its own: 16 GB free, this process without limits, no control groups."""
    for name in [name for name in os.environ if name.startswith("SLURM_")]:
        monkeypatch.delenv(name)
    monkeypatch.setattr(memory, "PROC", tmp_path / "proc")
    monkeypatch.setattr(memory, "resource", None)
    write(tmp_path / "proc/meminfo", "MemTotal: 32000000 kB\nMemAvailable: 15625000 kB\n")
    assert memory.memory_at_hand() == 16e9
    return tmp_path


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def mounted(machine: Path, kind: str, root: str, own: str, options: str) -> Path:
    """A folder of control groups that shows those below `root`, this process in the group `own`."""
    folder = machine / "control groups"
    at = str(folder).replace(" ", r"\040")
    line = f"30 23 0:26 {root} {at} rw,nosuid shared:4 - {kind} cgroup {options}\n"
    write(machine / "proc/self/mountinfo", "21 1 8:1 / / rw - ext4 /dev/sda rw\n" + line)
    controllers = "" if kind == "cgroup2" else "cpu,memory"
    write(machine / "proc/self/cgroup", f"3:pids:/elsewhere\n0:{controllers}:{own}\n")
    return folder


@pytest.mark.parametrize("root", ["/", "/docker/abc"])
def test_control_groups_of_version_2_inside_of_each_other(machine, root):
    """What each leaves is its limit less its use, but for files that need not stay; max is none."""
    own = "/docker/abc/job/step" if root != "/" else "/job/step"
    folder = mounted(machine, "cgroup2", root, own, "rw")
    for name, limit, used, files in (
        ("", "max", 9 * GIGABYTE, 0),
        ("job", 3 * GIGABYTE, 2 * GIGABYTE, GIGABYTE // 2),
        ("job/step", 8 * GIGABYTE, GIGABYTE, 0),
    ):
        write(folder / name / "memory.max", f"{limit}\n")
        write(folder / name / "memory.current", f"{used}\n")
        write(folder / name / "memory.stat", f"anon 5\ninactive_file {files}\n")
    assert memory.memory_at_hand() == 1.5e9
    write(folder / "job/step/memory.high", f"{2 * GIGABYTE}\n")
    assert memory.memory_at_hand() == 1e9


@pytest.mark.parametrize("own", ["/slurm/job_7", "/docker/abc"])
def test_control_groups_of_version_1(machine, own):
    """Those of memory alone; a container's own is the root of what it sees."""
    root = own if "docker" in own else "/"
    folder = mounted(machine, "cgroup", root, own, "rw,cpu,memory")
    group = folder if root != "/" else folder / "slurm/job_7"
    write(group / "memory.limit_in_bytes", f"{4 * GIGABYTE}\n")
    write(group / "memory.usage_in_bytes", f"{3 * GIGABYTE}\n")
    write(group / "memory.stat", f"total_inactive_file {GIGABYTE}\n")
    assert memory.memory_at_hand() == 2e9
    write(group / "memory.limit_in_bytes", "9223372036854771712\n")  # no limit, as it is written
    assert memory.memory_at_hand() == 16e9


def test_a_group_that_has_more_than_its_limit_leaves_nothing(machine):
    folder = mounted(machine, "cgroup2", "/", "/", "rw")
    write(folder / "memory.max", f"{GIGABYTE}\n")
    write(folder / "memory.current", f"{2 * GIGABYTE}\n")
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
def test_what_slurm_grants(machine, monkeypatch, variables, bytes_):
    """In MB or with a unit; what is no number of Slurm's grants nothing and takes nothing."""
    for name, value in variables.items():
        monkeypatch.setenv(f"SLURM_{name}", value)
    assert memory.memory_at_hand() == bytes_


def test_limits_of_the_process_itself():
    """Its addresses and its data, less what it has of them; asked in a process of its own."""
    pytest.importorskip("resource")
    if not Path("/proc/self/status").exists():
        pytest.skip("only Linux tells what a process has")
    for limit in ("RLIMIT_AS", "RLIMIT_DATA"):
        code = (
            "import resource; from modal.tools.memory import memory_at_hand as free\n"
            f"before = free(); resource.setrlimit(resource.{limit}, (2 * 10**9,) * 2)\n"
            "print(before, free())"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        before, free = map(float, done.stdout.split())
        assert 0 < free < min(2e9, before)


def test_a_system_that_tells_little(monkeypatch, tmp_path):
    """As macOS, which tells its whole memory alone, and as Windows, which lacks these modules."""
    free, peak = memory.memory_at_hand(), memory.peak_memory()
    monkeypatch.setattr(memory, "PROC", tmp_path)
    assert free <= memory.memory_at_hand() < 1e15
    assert memory.peak_memory() >= 0.9 * peak
    monkeypatch.setattr(memory, "resource", None)
    monkeypatch.delattr(os, "sysconf", raising=False)
    monkeypatch.delenv("SLURM_MEM_PER_NODE", raising=False)
    monkeypatch.delenv("SLURM_MEM_PER_CPU", raising=False)
    assert memory.memory_at_hand() == np.inf and memory.peak_memory() == 0


def test_without_the_modules_that_windows_lacks():
    """resource and fcntl hidden: a network, its modes, a wave and what measure makes of it."""
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
    assert answers[:3] == 3 * ["True"] and answers[-2] == "0"


@pytest.mark.parametrize(
    "error", [MemoryError(), np._core._exceptions._ArrayMemoryError((9,), np.dtype(float))]
)
def test_a_command_that_finds_no_memory_ends_in_one_line(error, tmp_path, monkeypatch, capsys):
    """Where no estimate has foreseen it."""
    write_network(tmp_path / "a.network.h5", modal.fcc(cells=(1, 1, 4)))

    def fail(*_, **__):
        raise error

    monkeypatch.setattr("modal.cli.info.summary", fail)
    assert main(["info", str(tmp_path / "a.network.h5")]) == 2
    said = capsys.readouterr()
    assert said.err.startswith("error: ") and said.err.count("\n") == 1 and not said.out
