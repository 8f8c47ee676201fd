"""Write files so that other processes see the old state or the new one, never a part.

All files of this project are written by `write_whole`: a partial file in the folder of the final
one, under an unpredictable name, is renamed when it is complete. Its writer holds a lock on it, so
that partial files without a lock are known to be left by a killed process.
"""

import errno
import hashlib
import os
import platform
import re
import secrets
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Literal

from modal.tools.errors import InputError
from modal.tools.interrupted import UNFINISHED

try:
    import fcntl
except ImportError:  # Windows, which deletes no file that is open
    fcntl = None  # type: ignore[assignment]

HOST = f"{zlib.crc32(platform.node().encode()):08x}"
"""Digest of this machine's name, for the names of partial files. Some disks keep the locks of each
machine apart, and host names may be long."""
RANDOM_BYTES = 8
"""Random bytes in a partial file's name, so that nobody can put a link there beforehand."""
MAX_LINKS = 40
"""Largest number of links, each to the next, that are followed; beyond it they are taken for a
circle."""

LockState = Literal["ours", "held", "none"]
"""Whether a lock was taken, is held by another process, or is not possible."""


def write_whole(path: str | Path, data: bytes | memoryview) -> None:
    """Write a file so that other processes see the old state or the new one, never a part.

    A link of the user is followed, and its target is written. Raises InputError for a link of
    another user, for a device or a pipe, and if the file cannot be written.
    """
    refuse_unwritable(path)
    place = Path(os.path.realpath(path))
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(place)
        with _partial_file(place) as (partial, file):
            # The permissions of an existing file stay, on systems that have them.
            with suppress(FileNotFoundError, AttributeError):
                os.fchmod(file.fileno(), stat.S_IMODE(place.stat().st_mode))
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            if fcntl is None:  # Windows renames no file that is open
                file.close()
            os.replace(partial, place)
    except OSError as error:
        raise unwritable(path, error) from error


def write_text(path: str | Path, text: str) -> None:
    """Write a text file completely or not at all."""
    write_whole(path, text.encode())


def refuse_unwritable(path: str | Path) -> None:
    """Raise InputError, before anything is computed, if a file of this name cannot be written."""
    place = Path(os.path.realpath(path))
    try:
        if str(path).endswith(os.sep) or place.is_dir():
            remedy = "name the file to be written in it"
            raise InputError("folder", f"{path}: a folder", remedy=remedy)
        _refuse_foreign_link(Path(path))
        exists = os.path.exists(path)
        if exists and not place.is_file():  # /dev/stdout, its file removed
            problem = f"{path}: a device or a pipe, no file"
            raise InputError("no_file", problem, remedy="give the name of a file")
        with suppress(FileNotFoundError):
            os.lstat(_partial_name(place))  # fails if this longer name is too long
        folder = next(parent for parent in place.parents if parent.exists())
        may_write = os.access(folder, os.W_OK | os.X_OK)
        if exists:
            may_write = may_write and os.access(place, os.W_OK)
        if not may_write:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise unwritable(path, error) from error


def unwritable(path: str | Path, error: OSError) -> InputError:
    """Return the error for a file that could not be written."""
    problem = f"{path}: cannot be written ({error.strerror or error})"
    remedy = "check the folder, its permissions and the space on the disk"
    return InputError("unwritable", problem, remedy=remedy)


def refuse_absent(path: str | Path) -> None:
    """Raise InputError if there is no file of this name."""
    if os.path.isdir(path):
        raise InputError("folder", f"{path}: a folder, no file", remedy="name the file in it")
    if os.path.isfile(path):
        return
    if os.path.exists(path):
        problem = f"{path}: a device or a pipe, no file"
    else:  # also for a name that is too long
        problem = f"{path}: no such file"
    raise InputError("no_file", problem, remedy="check the name")


def sha256(path: str | Path) -> str:
    """Return the hexadecimal SHA-256 of a file's bytes."""
    with open(path, "rb") as file:  # piece by piece: mode shapes take gigabytes
        return hashlib.file_digest(file, "sha256").hexdigest()


def _refuse_foreign_link(path: Path) -> None:
    """Raise InputError if the name is a link that another user has made.

    In a folder to which several users may write such a link could lead to any file of the user who
    follows it. Links of the folder's owner are accepted, as Linux does in /tmp.
    """
    if not hasattr(os, "getuid"):
        return
    for _ in range(MAX_LINKS):
        if not path.is_symlink():
            return
        trusted = {os.getuid(), path.parent.stat().st_uid}
        if path.lstat().st_uid not in trusted:
            raise InputError(
                "foreign_link",
                f"{path}: a link that another user has put there",
                remedy="remove it, or give another name",
            )
        path = path.parent / os.readlink(path)


def _partial_name(place: Path) -> Path:
    """Return an unpredictable name that no other process uses."""
    return place.with_name(f".{place.name}.{HOST}.{secrets.token_hex(RANDOM_BYTES)}.part")


@contextmanager
def _partial_file(place: Path) -> Iterator[tuple[Path, BinaryIO]]:
    """Yield the name and the open file of a new partial file; remove it if it still exists."""
    partial, file = _new_partial_file(place)
    try:
        yield partial, file
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        # What a full disk has not taken is lost with the file.
        with suppress(OSError):
            file.close()
        UNFINISHED.discard(partial)


def _new_partial_file(place: Path) -> tuple[Path, BinaryIO]:
    """Return the name of a new partial file, and the file, open and locked.

    Between its creation and its lock a file looks abandoned. If another process removes it in this
    moment, a new one is created.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    flags |= getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
    while True:
        partial = _partial_name(place)
        UNFINISHED.add(partial)
        descriptor = os.open(partial, flags, 0o666)  # less the permissions that the umask removes
        if _lock(descriptor) != "held" and os.fstat(descriptor).st_nlink > 0:
            return partial, os.fdopen(descriptor, "wb")
        os.close(descriptor)
        partial.unlink(missing_ok=True)
        UNFINISHED.discard(partial)


def _lock(descriptor: int) -> LockState:
    """Lock an open file, until it is closed or its process ends; return whether that succeeded.

    Returns "held" if another process has the lock, "none" on a disk or a system without locks.
    """
    if fcntl is None:
        return "none"
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return "held"
    except OSError:
        return "none"
    return "ours"


def _remove_abandoned(place: Path) -> None:
    """Remove the partial files of this file that killed processes have left.

    A partial file whose lock can be taken is abandoned. Process IDs would not show this, because
    they differ between containers; locks do not.
    """
    random = f"[0-9a-f]{{{2 * RANDOM_BYTES}}}"
    pattern = re.compile(rf"\.{re.escape(place.name)}\.{HOST}\.{random}\.part")
    flags = os.O_WRONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    for part in list(place.parent.iterdir()):
        if not pattern.fullmatch(part.name):
            continue
        with suppress(OSError):  # another process has removed it, or it is no file
            descriptor = os.open(part, flags)
            try:
                if _lock(descriptor) == "ours":
                    part.unlink(missing_ok=True)
            finally:
                os.close(descriptor)
