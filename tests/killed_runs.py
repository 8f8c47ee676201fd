"""Shell scripts that are killed and started again, and whether their products are the same."""

import contextlib
import fcntl
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
from places import ROOT

ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
NOISE = {"run_time", "seconds", "study", "provenance", "network_sha256"}
"""Attributes in which two undisturbed runs differ: their times, and what depends on these."""
MAX_SECONDS = 600
"""Time within which a script must end."""


def read_contents(path: Path) -> dict[str, np.ndarray]:
    """Read all datasets and attributes of a file, but for times and what depends on them."""
    contents: dict[str, np.ndarray] = {}

    def add_dataset(name: str, node: h5py.HLObject) -> None:
        if isinstance(node, h5py.Dataset):
            contents[name] = node[()]

    with h5py.File(path) as file:
        file.visititems(add_dataset)
        for name, value in file.attrs.items():
            if name not in NOISE:
                contents[f"@{name}"] = value
    return contents


def assert_equal_products(first: Path, second: Path) -> None:
    """Assert that both folders have equal products, and the second nothing half written."""
    names = sorted(path.relative_to(first) for path in first.rglob("*.h5"))
    assert names == sorted(path.relative_to(second) for path in second.rglob("*.h5"))
    assert not list(second.rglob(".*.part"))
    for name in names:
        np.testing.assert_equal(
            read_contents(second / name), read_contents(first / name), str(name)
        )


def start_script(script: str, folder: Path) -> subprocess.Popen:
    """Start a shell script in a folder, in a process group of its own."""
    folder.mkdir(exist_ok=True)
    return subprocess.Popen(
        ["bash", "-c", script],
        cwd=folder,
        env=os.environ | ONE_THREAD | {"PYTHON": sys.executable, "PYTHONPATH": str(ROOT)},
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def kill(process: subprocess.Popen) -> None:
    """Kill the whole group of a process, as a batch system does, and wait for its end."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def run_undisturbed(script: str, folder: Path) -> float:
    """Run a script once; return the time that it took, s."""
    started = time.monotonic()
    assert start_script(script, folder).wait(timeout=MAX_SECONDS) == 0
    return time.monotonic() - started


def is_locked(lock: Path) -> bool:
    """Tell whether a process holds the lock of a file."""
    with contextlib.suppress(FileNotFoundError), lock.open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


class Kills(NamedTuple):
    """Number of kills that met a script before its end, and of those that met a study's job."""

    of_script: int
    of_job: int


def kill_again_and_again(
    script: str, reference: Path, folder: Path, kills: int, seconds: float
) -> Kills:
    """Kill a script at random within `seconds`, then let it end with the products of `reference`.

    Each of the `kills` begins with a copy of the folder `start` beside the reference, if it exists.
    """
    random = np.random.default_rng(kills)
    of_script = 0
    of_job = 0
    start = reference.with_name("start")
    for number in range(1, kills + 1):
        shutil.rmtree(folder, ignore_errors=True)
        if start.exists():
            shutil.copytree(start, folder, symlinks=True)
        started = time.monotonic()
        process = start_script(script, folder)
        try:
            process.wait(timeout=random.uniform(0.02, 1.0) * seconds)
            seconds = time.monotonic() - started  # the machine has become quicker
        except subprocess.TimeoutExpired:
            of_script += 1
            of_job += is_locked(folder / "products/.jobs")
        kill(process)
        assert start_script(script, folder).wait(timeout=MAX_SECONDS) == 0
        assert_equal_products(reference, folder)
        print(f"kill {number}: {of_script} met the script, {of_job} a job of it", flush=True)
    return Kills(of_script, of_job)
