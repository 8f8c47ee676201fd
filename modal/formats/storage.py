"""Refuse HDF5 files whose numbers are in other files, were never written, or are far too many.

A product is one file that contains all of its numbers, so that its checksum covers all of them. In
HDF5 the numbers of a dataset may be in other files (external links, external storage, virtual
datasets), and numbers that a killed writer has not written are read as fill values, mostly zeros.
"""

import math
from collections.abc import Iterator

import h5py

from modal.tools.display import quantity
from modal.tools.errors import InputError
from modal.tools.workload import refuse_above_memory

MAX_COMPRESSION = 1100
"""Largest ratio of the bytes of numbers to stored bytes: zlib, HDF5's own compression, reaches
1032."""
UNCHECKED_BYTES = 1 << 24
"""Size of numbers up to which any compression is accepted: other kinds compress equal numbers more
than zlib."""
PLAIN_LINKS = (h5py.HardLink, h5py.SoftLink)
"""Links that stay inside the file."""


def refuse_links(file: h5py.File) -> None:
    """Raise InputError for links to other files, and for a group with two names."""
    for _ in walk(file):
        pass


def walk(file: h5py.File) -> Iterator[tuple[str, h5py.Group | h5py.Dataset | None]]:
    """Yield the path and the node of everything in a file; None for a node of another kind.

    Raises InputError for a link to another file, for a group with a second name, and for a circle
    of groups: their datasets would have further paths, which are not checked.
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
                address = _address(node)
                if address in seen:
                    problem = f"group {path} has two names, or holds itself"
                    raise InputError("link", problem, remedy="write it once")
                seen.add(address)
                groups.append((path, node))


def _node(group: h5py.Group, name: str, path: str) -> h5py.Group | h5py.Dataset | None:
    """Return the node with a name; raise InputError for a link that leads to another file."""
    try:
        link = group.get(name, getlink=True)
    except TypeError:  # of a kind that a program has made up
        link = None
    if not isinstance(link, PLAIN_LINKS):
        problem = f"{path} is a link out of the file"
        raise InputError("link", problem, remedy="copy what it leads to into the file")
    try:
        node = group[name]
    except (KeyError, OSError, RuntimeError):
        if isinstance(link, h5py.SoftLink):  # it leads nowhere, or to itself
            return None
        raise
    if isinstance(node, h5py.Group | h5py.Dataset):
        return node
    return None


def _is_soft(group: h5py.Group, name: str) -> bool:
    """Tell whether a name is a soft link: its node is also found under another name."""
    return isinstance(group.get(name, getlink=True), h5py.SoftLink)


def _address(group: h5py.Group) -> tuple[int, ...]:
    """Return the number of the file and the address of a group, which identify the group."""
    info = h5py.h5o.get_info(group.id)
    return info.fileno, info.addr


def refuse_hidden(dataset: h5py.Dataset, name: str) -> None:
    """Raise InputError if some numbers of a dataset are not in the file, or if there are too many.

    Too many means: more than the stored bytes can contain under any compression.
    """
    if dataset.shape is None:
        problem = f"{name} is empty, without a shape"
        raise InputError("unwritten", problem, remedy="write its numbers")
    if dataset.is_virtual or dataset.external:
        problem = f"{name} has its numbers in another file"
        raise InputError("other_file", problem, remedy="copy them into this one")
    if not _is_written(dataset):
        problem = f"{name} has parts that were never written"
        raise InputError("unwritten", problem, "its program was stopped", "make it again")
    count = math.prod(dataset.shape)
    chunk_count = math.prod(dataset.chunks or ())
    # Memory is taken for whole chunks, also for one that is larger than its dataset.
    needed_bytes = max(count, chunk_count) * dataset.dtype.itemsize
    if count == 0 or needed_bytes <= UNCHECKED_BYTES:
        return
    max_bytes = MAX_COMPRESSION * dataset.id.get_storage_size()
    if chunk_count > count or needed_bytes > max_bytes:
        size = quantity(needed_bytes, "B", 3)
        problem = f"{name} says that it has {size}, more than its file can hold"
        raise InputError("declared_size", problem, remedy="make it again")
    refuse_above_memory(needed_bytes, f"reading {name}", "take a machine with more")


def _is_written(dataset: h5py.Dataset) -> bool:
    """Tell whether storage in the file is allocated for every number of the dataset."""
    count = math.prod(dataset.shape)
    if count == 0:
        return True
    if dataset.chunks is None:
        stored_bytes = dataset.id.get_storage_size()
        return bool(stored_bytes >= count * dataset.dtype.itemsize)
    chunk_count = 1
    for length, chunk_length in zip(dataset.shape, dataset.chunks, strict=True):
        chunk_count *= -(-length // chunk_length)  # rounded up
    return bool(dataset.id.get_num_chunks() >= chunk_count)
