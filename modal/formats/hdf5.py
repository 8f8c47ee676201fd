"""Read and write HDF5 files that are complete or absent, and contain all of their own numbers.

All parts of a file have checksums, so that a flipped bit is noticed when the file is read. The
checksums of data are those of HDF5's fletcher32 filter and of zlib; those of names, shapes and
attributes belong to the format of HDF5 1.10. Files of other programs are read with or without
checksums.
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
_HEAP_SIGNATURE = b"GCOL\x01\0\0\0"
"""First bytes of a global heap, in which HDF5 keeps texts."""
_HEAP_HEADER_BYTES = 16
"""Size of the header of a heap, and of the header of each entry."""
_HDF5_ERRORS = (OSError, KeyError, RuntimeError, ValueError, TypeError, MemoryError)
"""Exceptions that h5py raises for a file that it cannot read."""
_NO_LOCK_ERRORS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
"""Error numbers of a disk that does not support locks."""
_INCOMPLETE_ERRORS = (
    *(AttributeError, KeyError, IndexError, TypeError, ValueError),
    *(OverflowError, RecursionError),  # of a whole number too large, of JSON in JSON in JSON
)
"""Exceptions for an attribute that is absent or not of its kind."""


@contextmanager
def atomic_h5(path: str | Path) -> Iterator[h5py.File]:
    """Open a new HDF5 file for writing that takes its final name only when the block succeeds.

    The file is built in memory: on a full disk HDF5 ends the process with a segmentation fault.
    """
    image = io.BytesIO()
    with h5py.File(image, "w", libver=CHECKSUMMED) as file:
        yield file
    # Given back also where writing fails: Python 3.13 complains of lent memory when it collects it.
    with image.getbuffer() as data:
        write_whole(path, data)


@contextmanager
def open_h5(path: str | Path) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading; raise InputError if it is missing or damaged.

    Exceptions of the block itself do not mean a damaged file, and reach the caller unchanged;
    exceptions that HDF5 raises in the block become InputError.
    """
    path = Path(path)
    refuse_absent(path)
    try:
        _refuse_endless_heap(path)
        file = h5py.File(path, "r")
    except _HDF5_ERRORS as error:
        raise _unreadable(path, error) from error
    with file:
        try:
            with named(path):
                refuse_links(file)
            yield file
        except _HDF5_ERRORS as error:
            if _is_from_h5py(error):
                raise _unreadable(path, error) from error
            raise


def _is_from_h5py(error: Exception) -> bool:
    """Tell whether an exception was raised in h5py."""
    frames = traceback.walk_tb(error.__traceback__)
    return any(frame.f_globals["__name__"].startswith("h5py.") for frame, _ in frames)


def _unreadable(path: Path, error: Exception) -> InputError:
    """Return the error for a file that HDF5 cannot read, from the exception that HDF5 raised."""
    reason = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        problem = f"{path}: not enough memory to read it"
        return InputError("memory", problem, reason, "free some")
    if _is_in_use(error):
        problem = f"{path}: another program has it open for writing, or this disk has no locks"
        remedy = "close it there, or set HDF5_USE_FILE_LOCKING=FALSE if nobody writes it"
        return InputError("file_in_use", problem, remedy=remedy)
    remedy = "it may be truncated, make it again"
    if not h5py.is_hdf5(path):
        remedy += "; what another program wrote is read by `import`"
    return InputError("unreadable", f"{path}: not a readable HDF5 file", reason, remedy)


def _is_in_use(error: Exception) -> bool:
    """Tell whether HDF5 refused a file because it is locked, or marked as open for writing."""
    if isinstance(error, BlockingIOError) or getattr(error, "errno", None) in _NO_LOCK_ERRORS:
        return True
    # HDF5 has no error number for a file that this process, or a killed one, has open.
    return "already open for" in str(error)


@contextmanager
def complete(path: str | Path) -> Iterator[None]:
    """Raise InputError if an attribute that the block reads is absent or has the wrong type."""
    try:
        yield
    except InputError:
        raise
    except _INCOMPLETE_ERRORS as error:
        remedy = "incomplete, make it again"
        raise InputError("incomplete", f"{path}", f"{error}", remedy) from error


@contextmanager
def named(path: str | Path) -> Iterator[None]:
    """Put the name of a file before the problem of each InputError that the block raises."""
    try:
        yield
    except InputError as error:
        problem = f"{path}: {error.problem}"
        raise InputError(error.code, problem, error.reason, error.remedy) from error


def _refuse_endless_heap(path: Path) -> None:
    """Raise InputError for a file whose texts HDF5 (up to 2.0) would read for ever.

    Texts of attributes are in global heaps, the only structure without a checksum. The library
    steps from entry to entry; after a damaged length it may reach an empty entry of size zero,
    where it stays for ever.
    """
    if path.stat().st_size == 0:
        return
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        heap = raw.find(_HEAP_SIGNATURE)
        while heap >= 0:
            if _has_empty_entry(raw, heap):
                problem = f"{path}: its texts are damaged"
                raise InputError("unreadable", problem, remedy="make the file again")
            heap = raw.find(_HEAP_SIGNATURE, heap + len(_HEAP_SIGNATURE))


def _has_empty_entry(raw: mmap.mmap, heap: int) -> bool:
    """Tell whether the global heap at this place has an entry of size zero."""
    end = heap + int.from_bytes(raw[heap + 8 : heap + 16], "little")
    entry = heap + _HEAP_HEADER_BYTES
    while entry + _HEAP_HEADER_BYTES <= min(end, len(raw)):
        index = int.from_bytes(raw[entry : entry + 2], "little")
        size = int.from_bytes(raw[entry + 8 : entry + 16], "little")
        step = size
        if index:
            padded_size = (size + 7) // 8 * 8
            step = _HEAP_HEADER_BYTES + padded_size
        if step == 0:
            return True
        entry += step
    return False


def put(file: h5py.File | h5py.Group, name: str, data: Array, units: str) -> None:
    """Write one dataset with its units.

    Small datasets are compressed, too, for the checksum of zlib: fletcher32 does not notice if
    0xFFFF becomes zero.
    """
    if np.size(data) > 0:
        dataset = file.create_dataset(
            name, data=data, fletcher32=True, compression="gzip", shuffle=True
        )
    else:
        dataset = file.create_dataset(name, data=data)
    dataset.attrs["units"] = units
