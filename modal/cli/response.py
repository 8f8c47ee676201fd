"""The command `response`: transfer functions from a source, and the gain factor."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import add_value, chosen
from modal.cli.reading import network_command, packing_of
from modal.cli.wave import add_source, asked_of
from modal.formats.hdf5 import sha256
from modal.system.contacts import TANGENTS
from modal.waves.response import frequency_response, write_response

read_product = None


def add(commands: Any) -> None:
    """The options of `response`."""
    text = "what passes at each frequency: gain from wall to wall, motion of chain and layers"
    example = "response mine.network.h5 --highest 20000 -o mine.response.h5"
    command = network_command(commands, "response", text, example, "*.response.h5", TANGENTS)
    add_value(command, "--highest", "HZ", "up to here (default: the whole spectrum)")
    add_value(command, "--resolution", "HZ", "width of a peak", 1e3)
    add_source(command)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """The response up to the highest frequency, and where the gain has its maxima."""
    asked = asked_of(options) | chosen(options, "highest", "resolution")
    found = frequency_response(packing_of(options), **asked)
    if options.output:
        write_response(options.output, found, sha256(options.network), options.made)
    gain: dict[str, Any] = {}
    if found.from_wall_to_wall:
        gain["largest_gain"] = float(found.gain.max())
        gain["gain_maxima_hz"] = found.gain_maxima().tolist()
    else:
        gain["largest_displacement_per_unit"] = float(abs(found.layer_displacement).max())
    own = [found.damping.normal, found.damping.tangential] if found.damping else None
    return {
        **({"damping": own} if own else {"resolution_hz": found.resolution}),
        "frequencies": len(found.frequency),
        "highest_frequency_hz": float(found.frequency[-1]),
        "products_with_k": found.products,
        **gain,
    }
