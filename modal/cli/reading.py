"""The packing that a command is about, and what its contacts do: their springs, their forces."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

from modal.exchange.registry import read_remarked
from modal.packing.network import Network
from modal.system.contacts import SLIDING, TANGENTS, with_sliding


def add_springs(command: argparse.ArgumentParser, known: Iterable[str] = TANGENTS) -> None:
    """The options of a command that computes with the springs of the contacts.

    `known` are the terms of carried forces that it can take.
    """
    command.add_argument(
        "--pre-stress",
        choices=list(known),
        default="none",
        help="carried forces in the tangent stiffness: none (default), the normal ones, all "
        "(full), or as the contact model of the program that the packing is from (law)",
    )
    command.add_argument(
        "--sliding",
        choices=SLIDING,
        default="elastic",
        help="contacts at the friction limit: elastic (default), or without tangential stiffness",
    )


def packing_of(options: argparse.Namespace, *, waves: bool = False) -> Network:
    """The packing of the command's file, remarks on it told, with the springs that it asks for.

    `waves` says that waves along z will be read, which need some length.
    """
    network = read_remarked(options.network, options.remarks.append, waves=waves)
    return with_sliding(network, options.sliding)
