"""This project's own samples, whose contacts are sought when they are read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from modal.exchange.import_result import ImportResult
from modal.exchange.registry import File, Option
from modal.packing.checks import named
from modal.packing.sample import read_sample

NAME = "this project (*.sample.h5)"
OPTIONS: Mapping[str, Option] = {}


def is_sample(path: str | Path) -> bool:
    """Whether a file is a sample, by its name."""
    return str(path).endswith(".sample.h5")


def sniff(file: File) -> bool:
    """By its name alone."""
    return is_sample(file.path)


def read(path: Path) -> ImportResult:
    """The network of the springs that the sample's positions make."""
    sample = read_sample(path)
    with named(path):
        return ImportResult(sample.network(), sought=True)
