"""The file of a contact network: the one definition of "granular-contact-network"."""

from __future__ import annotations

from pathlib import Path

from modal.formats.product import Column, Product
from modal.packing.checks import named
from modal.packing.columns import CELL, CONTACTS, OF_BONDS, OPTIONAL, PARTICLES
from modal.packing.network import Network, handed_over

SCHEMA = "granular-contact-network"
VERSION = (1, 2)
"""With a column of `OF_BONDS` a file says 2, which a reader that would miss it refuses."""
_GROUPS = {"particles": ("n", PARTICLES), "contacts": ("m", CONTACTS)}
# What is not finite is refused, by its row, with all else that no packing can be.
_COLUMNS = {
    name: Column(
        f"{group}/{name}",
        kind,
        (count, *row),
        unit,
        name in OPTIONAL,
        finite=False,
        since=VERSION[name in OF_BONDS],
    )
    for group, (count, columns) in _GROUPS.items()
    for name, (kind, row, unit) in columns.items()
} | {
    name: Column(name.replace("_", "/").replace("wall/", "walls/"), *about, finite=False)
    for name, about in CELL.items()
}
FORMAT = Product(SCHEMA, _COLUMNS, groups=("study", "provenance"), versions=VERSION)


def write_network(path: str | Path, network: Network) -> None:
    """Write the network atomically."""
    FORMAT.write(path, vars(network))


def read_network(path: str | Path) -> Network:
    """Read and validate a network; raises InputError with one line for anything wrong."""
    said = FORMAT.read(path)
    columns = {name: said[name] for name in _COLUMNS if said[name] is not None}
    with named(path):
        return Network(**handed_over(**columns), study=said["study"], provenance=said["provenance"])
