"""Files in which numba keeps compiled loops: a folder of the user, never of the installation.

What numba writes beside a module stays behind where pip removes the module, and then hides a later
installation. Nothing here may stop a computation: a loop that cannot be kept is compiled anew.
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


def kept(function: Loop, **options: Any) -> Loop:
    """Return the function compiled by numba, which keeps it in files where a folder allows it."""
    folder = cache_folder()
    if folder is None:
        return numba.njit(**options)(function)
    usual = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        loop: Loop = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba has found no place for this function, as in a zip archive
        return numba.njit(**options)(function)
    finally:
        numba.config.CACHE_DIR = usual
    files = getattr(getattr(loop, "_cache", None), "_cache_file", None)
    if files is not None:
        _guard(files)
    return loop


def cache_folder() -> Path | None:
    """Return the folder of NUMBA_CACHE_DIR, or one of the user's own; None where it is not usable.

    numba itself keeps apart the functions of different files, and versions of Python and of
    processors; the version of numba is in the name.
    """
    if numba.config.CACHE_DIR:
        return _usable(Path(numba.config.CACHE_DIR))
    place = _folder_of_caches()
    if place is None:
        return None
    return _usable(place / "granular-wave-modes" / f"numba-{numba.__version__}")


def _folder_of_caches() -> Path | None:
    """Return where the user's caches are; None for a user without a home."""
    variable = "LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME"
    named = Path(os.environ.get(variable, ""))
    if named.is_absolute():
        return named
    try:
        return Path.home() / ".cache"
    except RuntimeError:
        return None


@cache
def _usable(folder: Path) -> Path | None:
    """Return the folder if files can be made in it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return None


def _guard(files: Any) -> None:
    """Let programs use numba's files of a function in turn, and do without what fails there.

    Of two programs that each save the function for other kinds of arguments at once, numba (0.68)
    may let the index of one name the file of the other; all later calls would then run wrong code.
    numba raises where a disk is full, and where a file has been cut off.
    """
    load, save, flush = files.load, files.save, files.flush
    lock = f"{files._index_path}.lock"

    def load_in_turn(key: Any) -> Any:
        with _in_turn(lock):
            try:
                return load(key)
            except Exception:  # whatever a damaged file makes pickle raise
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
    """Wait until no other program is within this, where the folder has locks."""
    with ExitStack() as stack:
        with suppress(OSError):  # a folder of another user, a full disk, or one without locks
            file = stack.enter_context(open(lock, "w"))
            if fcntl is not None:
                fcntl.flock(file, fcntl.LOCK_EX)
        yield
