"""This project's own contact networks; see `docs/formats.md`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from modal.exchange.import_result import ImportResult
from modal.exchange.registry import File, Option
from modal.packing.network import read_network

NAME = "this project (*.network.h5)"
OPTIONS: Mapping[str, Option] = {}
HDF5 = b"\x89HDF\r\n"


def sniff(file: File) -> bool:
    """Any HDF5 file but a sample, and what has the name of one."""
    named = file.path.name.endswith(".h5")
    return (named or file.head.startswith(HDF5)) and not file.path.name.endswith(".sample.h5")


def read(path: Path) -> ImportResult:
    """The network as it stands in the file."""
    return ImportResult(read_network(path))
