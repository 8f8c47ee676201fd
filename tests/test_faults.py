"""Interrupted runs, full disks, folders that are none, two runs at once, YADE missing or failing.

What counts is the state left behind: every file whole or absent, and the next run ends with the
very products of an undisturbed one.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from modal.__main__ import main
from modal.formats.hdf5 import HOST, InputError
from modal.packing import examples as gallery
from modal.packing.network_file import read_network, write_network
from modal.packing.sample import read_sample

ROOT = Path(__file__).resolve().parents[1]
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
NOISE = {"run_time", "seconds", "study", "provenance", "network_sha256"}
"""What two undisturbed runs differ in: the time that they took, and what depends on it."""
PACK = """
set -e
run() { "$PYTHON" -m modal "$@" >/dev/null 2>&1; }
run pack --spheres 30 --aspect 2 --stress 1e5 -o chain
[ -f a.modes.h5 ] || run modes chain/01_100kPa.sample.h5 --all -o a.modes.h5
[ -f a.signals.h5 ] || run wave chain/01_100kPa.sample.h5 --duration 3e-5 -o a.signals.h5
"""
WALK = """
"$PYTHON" -m modal pack --friction 0.4 --spheres 400 --width 5 --stress 1e4 1e5 1e6 -o walk
"""


def contents(path: Path) -> dict[str, np.ndarray]:
    """All datasets and numeric attributes of a file, but for times and what depends on them."""
    found: dict[str, np.ndarray] = {}

    def keep(name: str, node: h5py.HLObject) -> None:
        if isinstance(node, h5py.Dataset):
            found[name] = node[()]

    with h5py.File(path) as file:
        file.visititems(keep)
        found |= {f"@{name}": value for name, value in file.attrs.items() if name not in NOISE}
    return found


def equal(first: Path, second: Path) -> None:
    """The same products in both folders, dataset by dataset, and nothing half written."""
    names = sorted(path.relative_to(first) for path in first.rglob("*.h5"))
    assert names == sorted(path.relative_to(second) for path in second.rglob("*.h5"))
    assert not list(second.rglob(".*.part"))
    for name in names:
        one, two = contents(first / name), contents(second / name)
        assert one.keys() == two.keys()
        for key, value in one.items():
            assert (
                np.array_equal(value, two[key], equal_nan=value.dtype.kind == "f")
                if isinstance(value, np.ndarray)
                else value == two[key] or value != value
            ), f"{name}: {key}"


def study(script: str, folder: Path, **environment: str) -> subprocess.Popen:
    """Start a shell script in a folder, in a process group of its own."""
    folder.mkdir(exist_ok=True)
    variables = os.environ | ONE_THREAD | {"PYTHON": sys.executable, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        ["bash", "-c", script],
        cwd=folder,
        env=variables | environment,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def end(process: subprocess.Popen, how: int) -> None:
    """Send a signal to the whole group, as a terminal or a batch system does, and wait."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, how)
    process.wait()


def killed_again_and_again(
    script: str, reference: Path, folder: Path, kills: int, seconds: float
) -> tuple[int, int]:
    """Kill a study at random, then let it end; how many kills met it, and a job of it."""
    random, alive, at_work = np.random.default_rng(kills), 0, 0
    for kill in range(1, kills + 1):
        shutil.rmtree(folder, ignore_errors=True)
        if reference.with_name("start").exists():
            shutil.copytree(reference.with_name("start"), folder, symlinks=True)
        started, process = time.monotonic(), study(script, folder)
        try:
            process.wait(timeout=random.uniform(0.02, 1.0) * seconds)
            seconds = time.monotonic() - started  # the machine has become quicker
        except subprocess.TimeoutExpired:
            alive += 1
            at_work += held(folder / "products/.jobs")
        end(process, signal.SIGKILL)
        assert study(script, folder).wait(timeout=600) == 0
        equal(reference, folder)
        print(f"kill {kill}: {alive} met the study, {at_work} a job of it", flush=True)
    return alive, at_work


def held(lock: Path) -> bool:
    """Whether a process holds the lock of this file."""
    with contextlib.suppress(FileNotFoundError), lock.open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def undisturbed(script: str, folder: Path) -> float:
    """Run the study once; seconds that it took."""
    started = time.monotonic()
    assert study(script, folder).wait(timeout=600) == 0
    return time.monotonic() - started


def test_killed_packing_pipeline(tmp_path):
    seconds = undisturbed(PACK, tmp_path / "reference")
    assert len(list((tmp_path / "reference").rglob("*.h5"))) == 4
    killed_again_and_again(PACK, tmp_path / "reference", tmp_path / "again", 1, seconds)


@pytest.mark.slow
def test_packing_pipeline_killed_fifty_times(tmp_path):
    seconds = undisturbed(PACK, tmp_path / "reference")
    again = tmp_path / "again"
    alive, _ = killed_again_and_again(PACK, tmp_path / "reference", again, 50, seconds)
    assert alive > 40


@pytest.mark.slow
def test_walk_with_friction_killed_twenty_times(tmp_path):
    """From its last checkpoint it takes the very steps again: all states to the bit, one thread."""
    seconds = undisturbed(WALK, tmp_path / "reference")
    assert len(list((tmp_path / "reference").rglob("*Pa.sample.h5"))) == 3
    again = tmp_path / "again"
    alive, _ = killed_again_and_again(WALK, tmp_path / "reference", again, 20, seconds)
    assert alive > 15


@pytest.mark.slow
def test_two_packings_in_one_folder_at_once(tmp_path):
    undisturbed(PACK, tmp_path / "reference")
    both = [study(PACK, tmp_path / "shared") for _ in range(2)]
    assert [process.wait(timeout=600) for process in both] == [0, 0]
    equal(tmp_path / "reference", tmp_path / "shared")


def test_interrupt_is_one_line_and_leaves_nothing_half(tmp_path):
    """Ctrl-C while a larger packing is made; the clock starts when all is imported."""
    script = (
        "import os, signal, sys, threading\n"
        "from modal.__main__ import main\n"
        # A shell's background jobs ignore Ctrl-C, and so do their children.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "threading.Timer(2, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        f"sys.exit(main(['pack', '--spheres', '20000', '-o', {str(tmp_path)!r}]))\n"
    )
    command, variables = [sys.executable, "-c", script], os.environ | ONE_THREAD
    done = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True)
    assert done.returncode == 130
    # A quick machine has a state or two by then, each with a line of its own.
    assert done.stderr.splitlines()[-1].startswith("interrupted")
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.glob(".*"))
    for path in tmp_path.glob("*.h5"):
        read_sample(path)


def status_with_limit(arguments: list[str], limit: int) -> tuple[int, str]:
    """Exit status and stderr of a command that may write `limit` bytes to a file."""
    sys.stdout.flush()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        status = 99
        with os.fdopen(writing, "w") as sys.stderr:
            status = main(arguments)
        os._exit(status)
    os.close(writing)
    _, status = os.waitpid(child, 0)
    with os.fdopen(reading) as error:
        return os.waitstatus_to_exitcode(status), error.read()


@pytest.mark.parametrize("limit", [0, 100, 3000, 10_000])
def test_full_disk_is_one_line_and_leaves_the_old_file(limit, tmp_path):
    """The HDF5 library alone ends with a segmentation fault here."""
    source = tmp_path / "a.network.h5"
    write_network(source, gallery.fcc(cells=(2, 2, 20)))
    out = tmp_path / "out"
    out.mkdir()
    for arguments, name in (
        (["modes", str(source), "--all"], "a.modes.h5"),
        (["wave", str(source), "--duration", "1e-4", "--particles"], "a.signals.h5"),
        (["density", str(source)], "a.density.h5"),
    ):
        (out / name).write_bytes(b"old")
        command = [*arguments, "-o", str(out / name), "--json"]
        status, error = status_with_limit(command, limit)
        assert status == 2 and error.count("\n") == 1 and "space on the disk" in error
        assert (out / name).read_bytes() == b"old"
        assert sorted(path.name for path in out.iterdir()) == [name]
        (out / name).unlink()


def test_folder_that_is_a_file(tmp_path, capsys):
    source, folder = tmp_path / "a.network.h5", tmp_path / "folder"
    write_network(source, gallery.fcc(cells=(2, 2, 6)))
    folder.write_text("")
    for arguments in (
        ["modes", str(source), "-o", str(folder / "a.modes.h5")],
        ["wave", str(source), "--duration", "1e-5", "-o", str(folder / "a.signals.h5")],
        ["info", str(source), "--layers", str(folder / "a.csv")],
        ["pack", "--spheres", "30", "--aspect", "2", "--stress", "1e5", "-o", str(folder)],
    ):
        assert main(arguments) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "cannot be written" in error


def test_parts_of_killed_processes_are_removed(tmp_path):
    path = tmp_path / "a.network.h5"
    child = os.fork()
    if child == 0:
        os._exit(0)
    os.waitpid(child, 0)
    other = f"{int(HOST, 16) ^ 1:08x}"  # a machine that writes to the same disk
    parts = [f"{HOST}.{child}", f"{HOST}.1", f"{other}.{child}", str(child)]
    dead, living, *elsewhere = (tmp_path / f".a.network.h5.{whose}.part" for whose in parts)
    for part in (dead, living, *elsewhere):
        part.write_bytes(b"half")
    write_network(path, gallery.fcc(cells=(1, 1, 5)))
    assert not dead.exists() and living.exists() and all(part.exists() for part in elsewhere)
    assert read_network(path).n_particles == 5
    with pytest.raises(InputError):
        read_network(living)
