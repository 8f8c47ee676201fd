"""A packing from a file, whichever of the formats it has."""

from __future__ import annotations

from pathlib import Path

from modal.packing.checks import named
from modal.packing.network import Network, read_network
from modal.packing.sample import read_sample
from modal.tools.arguments import checked


def is_sample(path: str | Path) -> bool:
    """Whether a file is a sample, whose contacts are sought when it is read."""
    return str(path).endswith(".sample.h5")


@checked
def read_packing(path: str | Path) -> Network:
    """A packing from a file: a contact network (`*.network.h5`) or a sample (`*.sample.h5`).

    Both formats are described in `docs/formats.md`. What contacts a sample has, and how stiff they
    are, follows from its positions. InputError, one line, for what is missing, damaged, or cannot
    be a packing.

    >>> import modal
    >>> modal.read("nowhere.network.h5")
    Traceback (most recent call last):
        ...
    modal.tools.errors.InputError: nowhere.network.h5: no such file; check the name
    """
    if not is_sample(path):
        return read_network(path)
    sample = read_sample(path)
    with named(path):
        return sample.network()
