"""Commands about a packing: their file, what its contacts do (springs, forces), frequencies."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import Any

import numpy as np

from modal.cli.options import add_choice, add_command, add_output
from modal.exchange.registry import read_remarked
from modal.packing.network import Network
from modal.system.contacts import SLIDING, with_sliding
from modal.tools.arrays import Floats
from modal.tools.display import quantity
from modal.tools.errors import InputError


def network_command(
    commands: Any,
    name: str,
    text: str,
    example: str,
    product: str = "",
    springs: Iterable[str] = (),
) -> argparse.ArgumentParser:
    """A command that reads a packing: its parser, with the file and --json.

    With a `product`, how the names of its files end, -o and --skip-current; with `springs`, the
    terms of carried forces that it can take, the options of the springs of the contacts.
    """
    command = add_command(commands, name, text, example)
    command.add_argument("network", help="*.network.h5, or *.sample.h5")
    if springs:
        text = "carried forces in the tangent stiffness: none, the normal ones, all (full), or as "
        text += "the contact model of the program that the packing is from (law)"
        add_choice(command, "--pre-stress", springs, text, "none")
        text = "contacts at the friction limit: elastic, or slip, without tangential stiffness"
        add_choice(command, "--sliding", SLIDING, text, "elastic")
    if product:
        add_output(command, f"write {product}", skip=True)
    return command


def packing_of(options: argparse.Namespace, *, waves: bool = False) -> Network:
    """The packing of the command's file, remarks on it told, with the springs that it asks for.

    `waves` says that waves along z will be read, which need some length.
    """
    network = read_remarked(options.network, options.remarks.append, waves=waves)
    return with_sliding(network, options.sliding)


def frequencies(at: list[str]) -> Floats:
    """Shape (k,), Hz: the frequencies of --at, whose texts are the names of results."""
    try:
        found = np.array([float(text) for text in at])
    except ValueError:
        found = np.array([np.nan])
    if not (np.isfinite(found) & (found >= 0)).all():
        raise InputError(f"--at {' '.join(at)}: give frequencies in Hz, as numbers from 0 on")
    return found


def remark_on_ends(options: argparse.Namespace, frequency: float, below: bool, above: bool) -> None:
    """Remark on a frequency, Hz, `below` the first or `above` the highest mode: perhaps in kHz."""
    if below or above:
        where = "below the first" if below else "above the highest"
        options.remarks.append(f"{quantity(frequency, 'Hz')} lies {where} mode: is it in Hz?")
