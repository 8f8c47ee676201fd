"""Choose where numba caches compiled loops: a folder of the user, never of the installation.

Files that numba writes next to a module would remain when pip removes the module, and would then
hide a later installation. A fault of the cache never stops a computation: a loop that cannot be
cached is compiled again.

Two things of numba are used that are not public (see `_guard`): the attributes of its cache, and
its functions that load and save.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

Loop = Callable[..., Any]


def compile_cached(
    function: Loop, *, fastmath: bool | set[str] = False, parallel: bool = False
) -> Loop:
    """Compile a function with numba, which caches the result in files if a folder is writable.

    numba finds the result by the path of the source file, here with links resolved: if the project
    is reached through different links, as on many clusters, nothing is compiled again.
    """
    folder = cache_folder()
    if folder is None:
        return numba.njit(fastmath=fastmath, parallel=parallel)(function)
    path = os.path.realpath(function.__code__.co_filename)
    function.__code__ = function.__code__.replace(co_filename=path)
    configured = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)  # numba reads it while it decorates
    try:
        compiler = numba.njit(cache=True, fastmath=fastmath, parallel=parallel)
        loop: Loop = compiler(function)
    except RuntimeError:  # numba has found no place for this function, as in a zip archive
        return numba.njit(fastmath=fastmath, parallel=parallel)(function)
    finally:
        numba.config.CACHE_DIR = configured
    files = getattr(getattr(loop, "_cache", None), "_cache_file", None)
    if files is not None:
        _guard(files)
    return loop


def cache_folder() -> Path | None:
    """Return the folder of NUMBA_CACHE_DIR, or the user's default; None if it is not usable.

    numba itself separates functions of different files, versions of Python, and processors; the
    version of numba is in the name of the folder.
    """
    if numba.config.CACHE_DIR:
        return _usable(Path(numba.config.CACHE_DIR))
    caches = _folder_of_caches()
    if caches is None:
        return None
    return _usable(caches / "granular-wave-modes" / f"numba-{numba.__version__}")


def _folder_of_caches() -> Path | None:
    """Return the folder of the user's caches; None for a user without a home."""
    variable = "LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME"
    folder = Path(os.environ.get(variable, ""))
    if folder.is_absolute():
        return folder
    try:
        return Path.home() / ".cache"
    except RuntimeError:
        return None


@cache
def _usable(folder: Path) -> Path | None:
    """Return the folder if files can be created in it, else None."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return None


def _guard(files: Any) -> None:
    """Replace how numba loads and saves a function: programs take turns, failures are ignored.

    `files` is numba's private cache of one function. The reasons, with the tests that show each:

    - Two programs that save the function for different kinds of arguments at the same time may
      leave an index that names the file of the other (numba 0.68); all later calls would then run
      wrong code: `test_programs_that_keep_a_loop_at_once_keep_each_its_own`.
    - numba raises if a file has been cut off: `test_a_file_that_cannot_be_read_is_made_anew`.
    - numba raises if the disk is full: `test_nothing_is_kept_on_a_full_disk`.

    They are in `tests/system/test_cores.py` and `tests/system/test_loops_anywhere.py`.
    """
    load = files.load
    save = files.save
    flush = files.flush
    lock = f"{files._index_path}.lock"

    def load_in_turn(key: Any) -> Any:
        with _in_turn(lock):
            try:
                return load(key)
            except Exception:  # pickle raises any error for a damaged file
                with suppress(OSError):
                    flush()
                return None

    def save_in_turn(key: Any, data: Any) -> None:
        with _in_turn(lock), suppress(OSError):
            save(key, data)

    files.load = load_in_turn
    files.save = save_in_turn


@contextmanager
def _in_turn(lock: str) -> Iterator[None]:
    """Wait until no other program is within this context, if the folder allows locks."""
    with ExitStack() as stack:
        with suppress(OSError):  # a folder of another user, a full disk, or one without locks
            file = stack.enter_context(open(lock, "w"))
            if fcntl is not None:
                fcntl.flock(file, fcntl.LOCK_EX)
        yield
