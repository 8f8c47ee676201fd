"""HDF5 files that are complete or absent: written under a temporary name, then renamed."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np


class InputError(ValueError):
    """A user's mistake; the message says in one line what is wrong, why, and what to do."""


@contextmanager
def atomic_h5(path: str | Path) -> Iterator[h5py.File]:
    """Open a new HDF5 file for writing that takes its final name only when the block succeeds."""
    path = Path(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with h5py.File(partial, "w") as file:
                yield file
            os.replace(partial, path)
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written ({error}); check the folder's permissions and space"
            ) from error
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def open_h5(path: str | Path, schema: str, version: int) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading; refuse what is missing, damaged or of another schema."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file; check the name")
    try:
        with h5py.File(path, "r") as file:
            found, found_version = file.attrs.get("schema"), file.attrs.get("schema_version")
            if isinstance(found, bytes):
                found = found.decode(errors="replace")
            if found != schema:
                raise InputError(f"{path}: schema is {found!r}, expected {schema!r}; wrong file?")
            if not np.isscalar(found_version) or int(found_version) != version:
                raise InputError(
                    f"{path}: schema_version is {found_version}, this program reads {version}; "
                    "convert the file or update the program"
                )
            yield file
    except InputError:
        raise
    except (OSError, KeyError, RuntimeError, ValueError, TypeError, MemoryError) as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"{path}: not a readable HDF5 file ({reason}); it may be truncated, make it again"
        ) from error


def put(
    file: h5py.File | h5py.Group, name: str, data: np.ndarray, units: str, *, compress: bool = False
) -> None:
    """Write one dataset with its units; `compress` for the large ones."""
    options = {"compression": "gzip", "shuffle": True} if compress and np.size(data) > 0 else {}
    file.create_dataset(name, data=data, **options).attrs["units"] = units


def get(file: h5py.File, name: str, kind: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """Read one dataset as float ("f"), integer ("i") or boolean ("b"); None is any length."""
    node = file.get(name)
    if not isinstance(node, h5py.Dataset):
        raise InputError(f"{file.filename}: dataset {name} is missing; write it as documented")
    fits = len(node.shape) == len(shape) and all(
        want is None or have == want for have, want in zip(node.shape, shape, strict=True)
    )
    if not fits:
        wanted = tuple("any" if want is None else want for want in shape)
        raise InputError(f"{file.filename}: {name} has shape {node.shape}, expected {wanted}")
    allowed = {"f": "fiu", "i": "iu", "b": "biu"}[kind]
    if node.dtype.kind not in allowed:
        raise InputError(f"{file.filename}: {name} has type {node.dtype}, which is not numeric")
    return node[()].astype({"f": np.float64, "i": np.int64, "b": bool}[kind])


def sha256(path: str | Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
