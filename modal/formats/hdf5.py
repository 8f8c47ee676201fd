"""HDF5 files that are complete or absent: written under a temporary name, then renamed.

All of a file carries checksums, so that a bit that has flipped is noticed when the file is read:
the data by HDF5's fletcher32 filter and zlib's, names, shapes and attributes by the format of
HDF5 1.10.
Files of other programs, with or without, are read alike.
"""

import errno
import glob
import hashlib
import io
import itertools
import mmap
import os
import platform
import stat
import traceback
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py
import numpy as np

from modal.tools.arrays import Array
from modal.tools.errors import InputError
from modal.tools.interrupted import UNFINISHED

CHECKSUMMED = ("v110", "v110")
"""Lowest and highest HDF5 format to write: from 1.10 on all structures have checksums."""
_WRITTEN = itertools.count()
_HEAP = b"GCOL\x01\0\0\0"
"""How a global heap begins: where HDF5 keeps texts."""

HOST = f"{zlib.crc32(platform.node().encode()):08x}"
"""This machine in names of partial files: a process of another one may be at work on the same disk,
and its number means nothing here. A digest, as names of hosts may be long."""


@contextmanager
def atomic_h5(path: str | Path) -> Iterator[h5py.File]:
    """Open a new HDF5 file for writing that takes its final name only when the block succeeds.

    It is built in memory: HDF5 ends the process with a segmentation fault where the disk is full.
    """
    image = io.BytesIO()
    with h5py.File(image, "w", libver=CHECKSUMMED) as file:
        yield file
    write_whole(path, image.getbuffer())


def write_whole(path: str | Path, data: bytes | memoryview) -> None:
    """Write a file of which others see the old state or the new one, never a part of it.

    Through a link into the file that it leads to; InputError for a device or a pipe.
    """
    refuse_unwritable(path)
    place = Path(os.path.realpath(path))
    partial = _partial(place)
    UNFINISHED.add(partial)
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(place)
        with open(partial, "wb") as file:
            with suppress(FileNotFoundError):  # who may read and write it stays as it was
                os.fchmod(file.fileno(), stat.S_IMODE(place.stat().st_mode))
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, place)
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        UNFINISHED.discard(partial)


def refuse_unwritable(path: str | Path) -> None:
    """InputError where no file of this name can be put, before anything is computed for it."""
    place = Path(os.path.realpath(path))
    try:
        if str(path).endswith(os.sep) or place.is_dir():
            raise InputError(f"{path}: a folder; name the file to be written in it")
        there = os.path.exists(path)
        if there and not place.is_file():  # /dev/stdout, its file removed
            raise InputError(f"{path}: a device or a pipe, no file; give the name of a file")
        with suppress(FileNotFoundError):
            os.lstat(_partial(place))  # whose name is longer
        folder = next(p for p in place.parents if p.exists())
        allowed = os.access(folder, os.W_OK | os.X_OK)
        if not (allowed and (not there or os.access(place, os.W_OK))):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise unwritable(path, error) from error


def unwritable(path: str | Path, error: OSError) -> InputError:
    """What is said of a file that could not be written."""
    return InputError(
        f"{path}: cannot be written ({error.strerror or error}); check the folder, its "
        "permissions and the space on the disk"
    )


def _partial(place: Path) -> Path:
    """Of this process, and of one writing alone: two threads may write the same file."""
    return place.with_name(f".{place.name}.{HOST}.{os.getpid()}.{next(_WRITTEN)}.part")


def write_text(path: str | Path, text: str) -> None:
    """Write a text whole or not at all."""
    write_whole(path, text.encode())


def _remove_abandoned(path: Path) -> None:
    """Remove the parts that killed processes of this machine have left of this file."""
    for part in path.parent.glob(f".{glob.escape(path.name)}.{HOST}.*.part"):
        pid = part.name.split(".")[-3]
        try:
            os.kill(int(pid), 0)
        except ProcessLookupError:
            part.unlink(missing_ok=True)
        except (PermissionError, ValueError):
            continue


def refuse_absent(path: str | Path) -> None:
    """InputError where there is no file of this name."""
    if os.path.isdir(path):
        raise InputError(f"{path}: a folder, no file; name the file in it")
    if not os.path.isfile(path):  # nor a name that is too long for one
        why = "a device or a pipe, no file" if os.path.exists(path) else "no such file"
        raise InputError(f"{path}: {why}; check the name")


@contextmanager
def open_h5(path: str | Path) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading; refuse what is missing or damaged.

    What the block itself raises is no damage of the file: it goes to the caller as it is, but for
    what HDF5 has raised in it.
    """
    path = Path(path)
    refuse_absent(path)
    try:
        _refuse_endless_heap(path)
        file = h5py.File(path, "r")
    except _BY_HDF5 as error:
        raise _unreadable(path, error) from error
    with file:
        try:
            yield file
        except _BY_HDF5 as error:
            frames = traceback.walk_tb(error.__traceback__)
            if any(frame.f_globals["__name__"].startswith("h5py.") for frame, _ in frames):
                raise _unreadable(path, error) from error
            raise


_BY_HDF5 = (OSError, KeyError, RuntimeError, ValueError, TypeError, MemoryError)


def _unreadable(path: Path, error: Exception) -> InputError:
    reason = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        return InputError(f"{path}: not enough memory to read it ({reason}); free some")
    do = "it may be truncated, make it again"
    if not h5py.is_hdf5(path):
        do += "; what another program wrote is read by `import`"
    return InputError(f"{path}: not a readable HDF5 file ({reason}); {do}")


@contextmanager
def complete(path: str | Path) -> Iterator[None]:
    """While attributes are read: InputError where one is absent or not what it should be."""
    try:
        yield
    except InputError:
        raise
    except (AttributeError, KeyError, IndexError, TypeError, ValueError) as error:
        raise InputError(f"{path}: {error}; incomplete, make it again") from error


@contextmanager
def named(path: str | Path) -> Iterator[None]:
    """Have what is refused begin with the file that it comes from."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _refuse_endless_heap(path: Path) -> None:
    """Refuse a file whose strings HDF5 (up to 2.0) would read for ever.

    Texts of attributes lie in "global heaps", the one structure without a checksum. The library
    walks from entry to entry; behind a damaged length it may meet an empty one of size zero.
    """
    if path.stat().st_size == 0:
        return
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        at = raw.find(_HEAP)
        while at >= 0:
            end = at + int.from_bytes(raw[at + 8 : at + 16], "little")
            here = at + 16
            while here + 16 <= min(end, len(raw)):
                index = int.from_bytes(raw[here : here + 2], "little")
                size = int.from_bytes(raw[here + 8 : here + 16], "little")
                step = 16 + (size + 7) // 8 * 8 if index else size
                if step == 0:
                    raise InputError(f"{path}: its texts are damaged; make the file again")
                here += step
            at = raw.find(_HEAP, at + 8)


def put(file: h5py.File | h5py.Group, name: str, data: Array, units: str) -> None:
    """Write one dataset with its units.

    Compressed even where it is small: fletcher32 takes 0xFFFF for zero, zlib's Adler-32 does not.
    """
    checked = {"fletcher32": True, "compression": "gzip", "shuffle": True}
    options = checked if np.size(data) > 0 else {}
    file.create_dataset(name, data=data, **options).attrs["units"] = units


def sha256(path: str | Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    with open(path, "rb") as file:  # piece by piece: mode shapes take gigabytes
        return hashlib.file_digest(file, "sha256").hexdigest()
