"""This project's own contact networks and samples; see `docs/formats.md`.

The contacts of a sample are found from its positions when it is read.
"""

from collections.abc import Mapping
from pathlib import Path

from modal.exchange.hdf5_files import refuse_other_hdf5
from modal.exchange.import_result import ImportResult
from modal.exchange.registry import Option
from modal.formats.hdf5 import named
from modal.packing.network import read_network
from modal.packing.sample import read_sample

NAME = "this project (*.network.h5, *.sample.h5)"
OPTIONS: Mapping[str, Option] = {}
HDF5_SIGNATURE = b"\x89HDF\r\n"


def is_sample(path: str | Path) -> bool:
    """Tell whether a file is a sample, by its name."""
    return str(path).endswith(".sample.h5")


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether a file is HDF5, or has the ending of an HDF5 file."""
    return path.name.endswith(".h5") or head.startswith(HDF5_SIGNATURE)


def read(path: Path) -> ImportResult:
    """Return a network as it is in the file, or the network of a sample's contacts."""
    if not is_sample(path):
        refuse_other_hdf5(path)
        return ImportResult(read_network(path))
    sample = read_sample(path)
    with named(path):
        return ImportResult(sample.network(), sought=True)
