"""The command `response`: transfer functions from a source, and the gain factor."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import add_output, add_skip_current, network_command
from modal.cli.reading import add_springs, packing_of
from modal.cli.wave import add_source, source_of
from modal.formats.hdf5 import sha256
from modal.system.damping import ContactDamping
from modal.waves.response import frequency_response, write_response

read_product = None


def add(commands: Any) -> None:
    """The options of `response`."""
    text = "what passes at each frequency: gain from wall to wall, motion of chain and layers"
    command = network_command(
        commands,
        "response",
        text,
        "response mine.network.h5 --highest 20000 -o mine.response.h5",
    )
    command.add_argument(
        "--highest", type=float, metavar="HZ", help="up to here (default: the whole spectrum)"
    )
    command.add_argument(
        "--resolution", type=float, default=1e3, metavar="HZ", help="width of a peak (default 1000)"
    )
    add_source(command)
    command.add_argument(
        "--damping", nargs=2, type=float, metavar=("N", "T"),
        help="of the contacts, over the critical: normal, tangential; at real frequencies then",
    )  # fmt: skip
    add_springs(command)
    add_output(command, "write *.response.h5")
    add_skip_current(command)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """The response up to the highest frequency, and where the gain has its maxima."""
    found = frequency_response(
        packing_of(options),
        source=source_of(options),
        highest=options.highest,
        resolution=options.resolution,
        pre_stress=options.pre_stress,
        direction=options.direction,
        damping=ContactDamping(*options.damping) if options.damping else None,
    )
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
