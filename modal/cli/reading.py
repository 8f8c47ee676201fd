"""The packing that a command is about, and how its sliding contacts are held."""

from __future__ import annotations

import argparse

from modal.packing.network import Network
from modal.packing.plausibility import read_remarked
from modal.system.contacts import SLIDING, with_sliding


def add_sliding(command: argparse.ArgumentParser) -> None:
    """The option --sliding of a command that computes with the springs of the contacts."""
    command.add_argument(
        "--sliding",
        choices=SLIDING,
        default="elastic",
        help="contacts at the friction limit: elastic (default), or without tangential springs",
    )


def packing_of(options: argparse.Namespace, *, waves: bool = False) -> Network:
    """The packing of the command's file, remarks on it told, with the springs that it asks for.

    `waves` says that waves along z will be read, which need some length.
    """
    network = read_remarked(options.network, options.remarks.append, waves=waves)
    return with_sliding(network, options.sliding)
