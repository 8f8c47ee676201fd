"""The command `tile`: a packing repeated sideways."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from modal.cli.options import add_output, add_value
from modal.cli.reading import network_command
from modal.exchange.registry import read_packing
from modal.packing.network import write_network
from modal.packing.sample import read_sample, write_sample
from modal.packing.tiling import repeat, repeat_sample
from modal.tools.errors import InputError
from modal.tools.workload import refuse_above_memory

SAMPLE_BYTES, NETWORK_BYTES = 100.0, 1500.0
"""Memory for each sphere of the result, measured: of a sample without shear, of a network."""


def add(commands: Any) -> None:
    """The options of `tile`."""
    text = "a packing repeated sideways across its periods"
    example = "tile mine.network.h5 --repeat 2 2 -o wide.network.h5"
    command = network_command(commands, "tile", text, example)
    text = "how often along x and y"
    add_value(command, "--repeat", ("NX", "NY"), text, kind=int, required=True)
    add_output(command, "*.network.h5, or of a sample *.sample.h5", required=True)


def read_product(path: str) -> object:
    """The packing that was written."""
    return read_packing(path)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Write the repeated packing; a sample stays one if the name of FILE says so."""
    times, output = options.repeat, options.output
    made = options.made.attributes() if options.made else {}
    task = f"repeating {options.network} {times[0]} by {times[1]} times"
    if output.endswith(".sample.h5"):
        if not options.network.endswith(".sample.h5"):
            raise InputError(f"-o {output}: only a sample gives a sample; write *.network.h5")
        sample = read_sample(options.network)
        spheres = len(sample.position) * times[0] * times[1]
        each = SAMPLE_BYTES if sample.shear is None else NETWORK_BYTES
        refuse_above_memory(each * spheres, task, "repeat it fewer times")
        write_sample(output, replace(repeat_sample(sample, *times), provenance=made))
    elif output.endswith(".network.h5"):
        network = read_packing(options.network)
        spheres = network.n_particles * times[0] * times[1]
        refuse_above_memory(NETWORK_BYTES * spheres, task, "repeat it fewer times")
        write_network(output, replace(repeat(network, *times), provenance=made))
    else:
        raise InputError(f"-o {output}: its name must end in .network.h5 or .sample.h5")
    return {"spheres": spheres}
