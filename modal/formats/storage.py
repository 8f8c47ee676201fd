"""What an HDF5 file may hide: numbers of other files, numbers never written, and far too many.

A product is one file that holds all of its numbers, so that its checksum is that of all. HDF5 lets
a dataset stand for those of other files (external links, external storage, virtual datasets), and
gives fill values, zeros mostly, for whatever a killed writer has not written.
"""

import math
from collections.abc import Iterator

import h5py

from modal.tools.display import quantity
from modal.tools.errors import InputError
from modal.tools.workload import refuse_above_memory

MAX_COMPRESSION = 1100
"""Bytes of numbers from one stored byte: zlib, HDF5's own compression, has 1032 at most."""
SMALL_BYTES = 1 << 24
"""Of numbers: below this any compression is taken, as other kinds make less of equal numbers."""
PLAIN_LINKS = (h5py.HardLink, h5py.SoftLink)


def refuse_links(file: h5py.File) -> None:
    """InputError for links that lead out of the file, and for a group that has two names."""
    for _ in walk(file):
        pass


def walk(file: h5py.File) -> Iterator[tuple[str, h5py.Group | h5py.Dataset | None]]:
    """Yield all that the file has, by the path to it; None for what is neither group nor dataset.

    InputError for a link out of the file, and for a group that a second name, or a circle, leads
    to: what stands in it would have a name that nobody looks at.
    """
    groups: list[tuple[str, h5py.Group]] = [("", file)]
    seen = {_address(file)}
    while groups:
        folder, group = groups.pop()
        for name in group:
            path = f"{folder}/{name}".lstrip("/")
            node = _node(group, name, path)
            yield path, node
            if isinstance(node, h5py.Group) and not _is_soft(group, name):
                if _address(node) in seen:
                    raise InputError(
                        "link",
                        f"group {path} has two names, or holds itself",
                        remedy="write it once",
                    )
                seen.add(_address(node))
                groups.append((path, node))


def _node(group: h5py.Group, name: str, path: str) -> h5py.Group | h5py.Dataset | None:
    """Return what a name stands for; InputError for a link that leads out of the file."""
    try:
        link = group.get(name, getlink=True)
    except TypeError:  # of a kind that a program has made up
        link = None
    if not isinstance(link, PLAIN_LINKS):
        raise InputError(
            "link",
            f"{path} is a link out of the file",
            remedy="copy what it leads to into the file",
        )
    try:
        node = group[name]
    except (KeyError, OSError, RuntimeError):
        if isinstance(link, h5py.SoftLink):  # it leads nowhere, or to itself
            return None
        raise
    return node if isinstance(node, h5py.Group | h5py.Dataset) else None


def _is_soft(group: h5py.Group, name: str) -> bool:
    """Return whether a name stands for another name, under which what it leads to is met too."""
    return isinstance(group.get(name, getlink=True), h5py.SoftLink)


def _address(group: h5py.Group) -> tuple[int, ...]:
    """Return what tells a group of the file from all others."""
    info = h5py.h5o.get_info(group.id)
    return info.fileno, info.addr


def refuse_hidden(dataset: h5py.Dataset, name: str) -> None:
    """InputError for a dataset whose numbers are not all in the file, or more than can be."""
    if dataset.shape is None:
        raise InputError(
            "unwritten", f"{name} is empty, without a shape", remedy="write its numbers"
        )
    if dataset.is_virtual or dataset.external:
        raise InputError(
            "other_file",
            f"{name} has its numbers in another file",
            remedy="copy them into this one",
        )
    if not _is_written(dataset):
        raise InputError(
            "unwritten",
            f"{name} has parts that were never written",
            remedy="its program was stopped, make it again",
        )
    chunks = dataset.chunks or ()
    numbers = math.prod(dataset.shape)
    # Memory is taken for whole chunks, also for one that is larger than its dataset.
    needed = max(numbers, math.prod(chunks)) * dataset.dtype.itemsize
    if numbers and needed > SMALL_BYTES:
        padded = math.prod(chunks) > numbers
        if padded or needed > MAX_COMPRESSION * dataset.id.get_storage_size():
            raise InputError(
                "declared_size",
                f"{name} says that it has {quantity(needed, 'B', 3)}, more than its file can hold",
                remedy="make it again",
            )
        refuse_above_memory(needed, f"reading {name}", "take a machine with more")


def _is_written(dataset: h5py.Dataset) -> bool:
    """Return whether every number of the dataset has a place in the file."""
    if math.prod(dataset.shape) == 0:
        return True
    if dataset.chunks is None:
        stored = dataset.id.get_storage_size()
        return bool(stored >= math.prod(dataset.shape) * dataset.dtype.itemsize)
    sides = zip(dataset.shape, dataset.chunks, strict=True)
    wanted = math.prod(-(-length // side) for length, side in sides)
    return bool(dataset.id.get_num_chunks() >= wanted)
