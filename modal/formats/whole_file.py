"""Files of which others see the old state or the new one, never a part.

All that this project writes goes through `write_whole`: a partial file beside the place, under a
name that nobody can foresee, takes the final name when it is complete. Its writer holds a lock on
it, by which those are known that a killed process has left.
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
"""This machine in names of partial files: some disks keep the locks of each machine apart. A
digest, as names of hosts may be long."""
RANDOM_BYTES = 8
"""In a partial file's name: a link that is planted under it beforehand cannot be met."""
LINKS = 40
"""From one to the next, after which Linux takes them for a circle."""


def write_whole(path: str | Path, data: bytes | memoryview) -> None:
    """Write a file of which others see the old state or the new one, never a part of it.

    Through a link into the file that it leads to, if the link is the user's own; InputError for
    another one's, for a device or a pipe, and where the file cannot be written.
    """
    refuse_unwritable(path)
    place = Path(os.path.realpath(path))
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(place)
        with _partial_file(place) as (partial, file):
            # Who may read and write it stays as it was, where there are such rights.
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
    """Write a text whole or not at all."""
    write_whole(path, text.encode())


def refuse_unwritable(path: str | Path) -> None:
    """InputError where no file of this name can be put, before anything is computed for it."""
    place = Path(os.path.realpath(path))
    try:
        if str(path).endswith(os.sep) or place.is_dir():
            raise InputError(
                "folder", f"{path}: a folder", remedy="name the file to be written in it"
            )
        _refuse_foreign_link(Path(path))
        there = os.path.exists(path)
        if there and not place.is_file():  # /dev/stdout, its file removed
            raise InputError(
                "no_file", f"{path}: a device or a pipe, no file", remedy="give the name of a file"
            )
        with suppress(FileNotFoundError):
            os.lstat(_partial_name(place))  # whose name is longer
        folder = next(p for p in place.parents if p.exists())
        allowed = os.access(folder, os.W_OK | os.X_OK)
        if not (allowed and (not there or os.access(place, os.W_OK))):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise unwritable(path, error) from error


def unwritable(path: str | Path, error: OSError) -> InputError:
    """Return what is said of a file that could not be written."""
    return InputError(
        "unwritable",
        f"{path}: cannot be written ({error.strerror or error})",
        remedy=("check the folder, its permissions and the space on the disk"),
    )


def refuse_absent(path: str | Path) -> None:
    """InputError where there is no file of this name."""
    if os.path.isdir(path):
        raise InputError("folder", f"{path}: a folder, no file", remedy="name the file in it")
    if not os.path.isfile(path):  # nor a name that is too long for one
        why = "a device or a pipe, no file" if os.path.exists(path) else "no such file"
        raise InputError("no_file", f"{path}: {why}", remedy="check the name")


def sha256(path: str | Path) -> str:
    """Return the hexadecimal SHA-256 of a file's bytes."""
    with open(path, "rb") as file:  # piece by piece: mode shapes take gigabytes
        return hashlib.file_digest(file, "sha256").hexdigest()


def _refuse_foreign_link(path: Path) -> None:
    """InputError where the name is a link that another user has put there.

    In a folder that several may write to it could lead to any file of whoever follows it. As Linux
    does in /tmp, links of the folder's owner are taken.
    """
    if not hasattr(os, "getuid"):
        return
    for _ in range(LINKS):
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
    """Return a name that no other process has, and that none can foresee."""
    return place.with_name(f".{place.name}.{HOST}.{secrets.token_hex(RANDOM_BYTES)}.part")


@contextmanager
def _partial_file(place: Path) -> Iterator[tuple[Path, BinaryIO]]:
    """Yield a new partial file, its name and the open file; remove it if it is still there."""
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

    Between its creation and its lock it looks abandoned: another one is made if it was removed.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    flags |= getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
    while True:
        partial = _partial_name(place)
        UNFINISHED.add(partial)
        descriptor = os.open(partial, flags, 0o666)  # less what the umask takes
        if _lock(descriptor) != "held" and os.fstat(descriptor).st_nlink > 0:
            return partial, os.fdopen(descriptor, "wb")
        os.close(descriptor)
        partial.unlink(missing_ok=True)
        UNFINISHED.discard(partial)


def _lock(descriptor: int) -> Literal["ours", "held", "none"]:
    """Lock an open file, until it is closed or its process ends.

    "held" where another one has the lock, "none" on a disk, or a system, without locks.
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
    """Remove the parts that killed processes of this machine have left of this file.

    Those whose lock can be had: a process of another container has another number here, but no
    other locks.
    """
    random = f"[0-9a-f]{{{2 * RANDOM_BYTES}}}"
    pattern = re.compile(rf"\.{re.escape(place.name)}\.{HOST}\.{random}\.part")
    flags = os.O_WRONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    for part in [part for part in place.parent.iterdir() if pattern.fullmatch(part.name)]:
        with suppress(OSError):  # another one has removed it, or it is no file
            descriptor = os.open(part, flags)
            try:
                if _lock(descriptor) == "ours":
                    part.unlink(missing_ok=True)
            finally:
                os.close(descriptor)
