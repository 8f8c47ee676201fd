"""Compiled loops without a folder to keep them in, a disk, threads; in forked processes."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

from modal.tools import loop_cache

ROOT = Path(__file__).parents[2]
LOOP = """
def doubled(x):
    return 2 * x
"""


def load_doubled(folder):
    """Return the function of the module in a folder."""
    spec = importlib.util.spec_from_file_location("numbers_of_it", folder / "numbers_of_it.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.doubled


@pytest.fixture
def doubled(tmp_path):
    """Return a function of a module in a folder of its own."""
    folder = tmp_path / "installed"
    folder.mkdir()
    (folder / "numbers_of_it.py").write_text(LOOP)
    return load_doubled(folder)


@pytest.fixture
def caches(tmp_path, monkeypatch):
    """Yield the user's folder of caches, empty."""
    monkeypatch.setattr(loop_cache.numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    loop_cache._usable.cache_clear()
    yield tmp_path / "caches"
    loop_cache._usable.cache_clear()


def kept_files(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.nb[ic]"))


def test_loops_are_kept_for_the_user_and_not_in_the_installation(doubled, caches, tmp_path):
    """Keep compiled loops outside of the installation, where pip would leave them behind.

    The user's setting of numba stays.
    """
    loop = loop_cache.compile_cached(doubled)
    assert loop(21) == 42
    assert kept_files(tmp_path / "installed") == []
    assert len(kept_files(caches)) == 2
    assert loop_cache.numba.config.CACHE_DIR == ""
    again = loop_cache.compile_cached(doubled)
    assert again(21) == 42
    assert sum(again.stats.cache_hits.values()) == 1


def test_loops_behind_a_link_are_not_compiled_again(doubled, caches, tmp_path):
    loop_cache.compile_cached(doubled)(21)
    (tmp_path / "linked").symlink_to(tmp_path / "installed")
    loop = loop_cache.compile_cached(load_doubled(tmp_path / "linked"))
    assert loop(21) == 42
    assert sum(loop.stats.cache_hits.values()) == 1


def test_the_folder_of_numba_is_taken_where_it_is_named(doubled, caches, tmp_path, monkeypatch):
    monkeypatch.setattr(loop_cache.numba.config, "CACHE_DIR", str(tmp_path / "named"))
    assert loop_cache.compile_cached(doubled)(1.5) == 3
    assert len(kept_files(tmp_path / "named")) == 2
    assert kept_files(caches) == []


@pytest.mark.parametrize("name", ["XDG_CACHE_HOME", "HOME", "NUMBA_CACHE_DIR", "nobody"])
def test_without_a_folder_nothing_is_kept(name, doubled, caches, tmp_path, monkeypatch):
    """Compile without a folder: a file in its place, or a user without a home.

    Not even root can make a folder in the place of a file.
    """
    blocked = tmp_path / "blocked"
    blocked.write_text("")
    if name == "NUMBA_CACHE_DIR":
        monkeypatch.setattr(loop_cache.numba.config, "CACHE_DIR", str(blocked))
    elif name == "nobody":
        monkeypatch.delenv("XDG_CACHE_HOME")
        monkeypatch.setattr(Path, "home", lambda: (_ for _ in ()).throw(RuntimeError("no home")))
    else:
        monkeypatch.delenv("XDG_CACHE_HOME")
        monkeypatch.setenv(name, str(blocked))
    assert loop_cache.cache_folder() is None
    assert loop_cache.compile_cached(doubled)(21) == 42
    assert kept_files(tmp_path) == []


def test_a_file_that_cannot_be_read_is_made_anew(doubled, caches):
    """Damage the cache by cutting it, emptying it and overwriting it.

    The next program finds it whole.
    """
    loop_cache.compile_cached(doubled)(21)
    for damage in (lambda data: data[:20], lambda data: b"", lambda data: b"no pickle" + data):
        for path in caches.rglob("*.nbi"):
            path.write_bytes(damage(path.read_bytes()))
        assert loop_cache.compile_cached(doubled)(21) == 42
        again = loop_cache.compile_cached(doubled)
        assert again(21) == 42
        assert sum(again.stats.cache_hits.values()) == 1


def test_nothing_is_kept_on_a_full_disk(caches):
    """Limit files to 200 bytes, so that writes fail as on a full disk."""
    pytest.importorskip("resource")
    code = (
        "import resource\n"
        "from modal.tools import loop_cache, loops\n"
        "loop = loop_cache.compile_cached(loops.cross)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))\n"
        "print(loop((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))"
    )
    done = run(code, XDG_CACHE_HOME=str(caches))
    assert done.stdout == "(0.0, 0.0, 1.0)\n", done.stderr
    assert not list(caches.rglob("*.nbc"))


WRONG = {
    "NUMBA_NUM_THREADS=0": "thread_count",
    "NUMBA_NUM_THREADS=-2": "thread_count",
    "NUMBA_THREADING_LAYER=magic": "threading_layer",
    "NUMBA_THREADING_LAYER_PRIORITY=omp": "threading_layer",
}
"""Settings that are refused, with the code of the refusal."""
ACCEPTED = [
    "NUMBA_NUM_THREADS=abc",
    "NUMBA_NUM_THREADS=",
    "OMP_NUM_THREADS=abc",
    "OMP_NUM_THREADS=0",
    "OMP_NUM_THREADS=2,1",
    "OMP_NUM_THREADS=-1",
    "OMP_NUM_THREADS=²",
]
THREADS = (
    "import modal\n"
    "try:\n"
    "    from modal.tools import loops\n"
    "    print(loops.threads_for(10**6) >= 1)\n"
    "except modal.InputError as error:\n"
    "    print(error.code, str(error).count(chr(10)))"
)


@pytest.mark.parametrize("setting", [*WRONG, *ACCEPTED])
def test_numbers_of_threads_in_the_environment(setting):
    """Refuse settings that allow no thread in one line; ignore settings that are no number."""
    name, _, value = setting.partition("=")
    done = run(THREADS, **{name: value})
    expected = f"{WRONG[setting]} 0" if setting in WRONG else "True"
    assert done.stdout.strip() == expected, done.stderr


FORKED = """
import multiprocessing, sys
import numpy as np
import modal
from modal.system.operator import ContactOperator
from modal.tools import loops

crystal = modal.fcc(cells=(4, 4, 320))
motion = np.random.default_rng(0).standard_normal(6 * crystal.n_particles)
operator = ContactOperator(crystal)

def forces(_):
    return loops.threads_for(crystal.n_particles), operator.apply(motion)

def in_grandchild(_):
    return pool_of(forces)

def pool_of(task):
    with multiprocessing.get_context("fork").Pool(2) as pool:
        return pool.map_async(task, [0, 0]).get(timeout=100)

if __name__ == "__main__":
    threads, here = forces(0)
    size = abs(here).max()
    for count, there in pool_of(forces):
        print(threads, count, bool(abs(there - here).max() < 1e-14 * size))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_process_forked_after_threads_computes_with_one():
    """Fork processes after threads have run: numba's OpenMP would end them and hang the pool."""
    done = run(FORKED, NUMBA_NUM_THREADS="2", OMP_NUM_THREADS="2")
    assert done.stdout.splitlines() == 2 * ["2 1 True"], done.stderr


def run(code: str, **environment: str) -> subprocess.CompletedProcess:
    """Run a program of its own under settings of the environment."""
    settings = {name: value for name, value in os.environ.items() if "_NUM_THREADS" not in name}
    return subprocess.run(
        [sys.executable, "-c", code],
        env=settings | environment,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )
