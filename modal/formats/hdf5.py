"""HDF5 files that are complete or absent, and hold all of their numbers themselves.

All of a file carries checksums, so that a bit that has flipped is noticed when the file is read:
the data by HDF5's fletcher32 filter and zlib's, names, shapes and attributes by the format of
HDF5 1.10.
Files of other programs, with or without, are read alike.
"""

import errno
import io
import mmap
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from modal.formats.storage import refuse_links
from modal.formats.whole_file import HOST as HOST
from modal.formats.whole_file import refuse_absent, write_whole
from modal.formats.whole_file import sha256 as sha256
from modal.formats.whole_file import write_text as write_text
from modal.tools.arrays import Array
from modal.tools.errors import InputError

CHECKSUMMED = ("v110", "v110")
"""Lowest and highest HDF5 format to write: from 1.10 on all structures have checksums."""
_HEAP = b"GCOL\x01\0\0\0"
"""How a global heap begins: where HDF5 keeps texts."""


@contextmanager
def atomic_h5(path: str | Path) -> Iterator[h5py.File]:
    """Open a new HDF5 file for writing that takes its final name only when the block succeeds.

    It is built in memory: HDF5 ends the process with a segmentation fault where the disk is full.
    """
    image = io.BytesIO()
    with h5py.File(image, "w", libver=CHECKSUMMED) as file:
        yield file
    write_whole(path, image.getbuffer())


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
            with named(path):
                refuse_links(file)
            yield file
        except _BY_HDF5 as error:
            frames = traceback.walk_tb(error.__traceback__)
            if any(frame.f_globals["__name__"].startswith("h5py.") for frame, _ in frames):
                raise _unreadable(path, error) from error
            raise


_BY_HDF5 = (OSError, KeyError, RuntimeError, ValueError, TypeError, MemoryError)
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
"""What a disk says that knows no locks."""


def _unreadable(path: Path, error: Exception) -> InputError:
    """Return what is said of a file that HDF5 does not read, by what it has raised."""
    reason = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        return InputError(
            "memory", f"{path}: not enough memory to read it ({reason})", remedy="free some"
        )
    if _is_in_use(error):
        return InputError(
            "file_in_use",
            f"{path}: another program has it open for writing, or this disk has no locks",
            remedy=("close it there, or set HDF5_USE_FILE_LOCKING=FALSE if nobody writes it"),
        )
    do = "it may be truncated, make it again"
    if not h5py.is_hdf5(path):
        do += "; what another program wrote is read by `import`"
    return InputError("unreadable", f"{path}: not a readable HDF5 file ({reason})", remedy=do)


def _is_in_use(error: Exception) -> bool:
    """Return whether HDF5 has refused a file for its lock, or for the mark of a writer in it."""
    if isinstance(error, BlockingIOError) or getattr(error, "errno", None) in _NO_LOCKS:
        return True
    # HDF5 has no number for what this process, or a killed one, has open.
    return "already open for" in str(error)


@contextmanager
def complete(path: str | Path) -> Iterator[None]:
    """While attributes are read: InputError where one is absent or not what it should be."""
    try:
        yield
    except InputError:
        raise
    except _INCOMPLETE as error:
        raise InputError(
            "incomplete", f"{path}", f"{error}", "incomplete, make it again"
        ) from error


_INCOMPLETE = (
    *(AttributeError, KeyError, IndexError, TypeError, ValueError),
    *(OverflowError, RecursionError),  # of a whole number too large, of JSON in JSON in JSON
)


@contextmanager
def named(path: str | Path) -> Iterator[None]:
    """Have what is refused begin with the file that it comes from."""
    try:
        yield
    except InputError as error:
        problem = f"{path}: {error.problem}"
        raise InputError(error.code, problem, error.reason, error.remedy) from error


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
                    raise InputError(
                        "unreadable", f"{path}: its texts are damaged", remedy="make the file again"
                    )
                here += step
            at = raw.find(_HEAP, at + 8)


def put(file: h5py.File | h5py.Group, name: str, data: Array, units: str) -> None:
    """Write one dataset with its units.

    Compressed even where it is small: fletcher32 takes 0xFFFF for zero, zlib's Adler-32 does not.
    """
    checked = {"fletcher32": True, "compression": "gzip", "shuffle": True}
    options = checked if np.size(data) > 0 else {}
    file.create_dataset(name, data=data, **options).attrs["units"] = units
