"""A packing repeated sideways across its periods."""

from dataclasses import replace

from modal.cli.options import PACKING_ENDINGS, REQUIRED, Option, Options, Result, output
from modal.cli.reading import NETWORK
from modal.exchange.programs.own import is_sample
from modal.exchange.registry import read, read_remarked
from modal.packing.network import Network, write_network
from modal.packing.sample import Sample, read_sample, write_sample
from modal.packing.tiling import repeat, repeat_sample
from modal.tools.errors import InputError
from modal.tools.workload import refuse_above_memory

SAMPLE_BYTES, NETWORK_BYTES = 100.0, 1500.0
"""Memory for each sphere of the result, measured: of a sample without shear, of a network."""
EXAMPLE = "tile mine.network.h5 --repeat 2 2 -o wide.network.h5"
OPTIONS = (
    NETWORK,
    Option("--repeat", ("NX", "NY"), "how often along x and y", kind=int, more=REQUIRED),
    output("*.network.h5, or of a sample *.sample.h5", PACKING_ENDINGS, required=True),
)

read_product = read


def run(options: Options) -> Result:
    """Write the repeated packing; a sample stays one if the name of FILE says so."""
    times, source, output = options.repeat, options.network, options.output
    if is_sample(output) and not is_sample(source):
        raise InputError(
            "input", f"-o {output}: only a sample gives a sample", remedy="write *.network.h5"
        )
    packing: Sample | Network = read_remarked(source, options.remarks.append)
    packing = read_sample(source) if is_sample(output) else packing
    spheres = len(packing.position) * times[0] * times[1]
    light = isinstance(packing, Sample) and packing.shear is None
    task = f"repeating {source} {times[0]} by {times[1]} times"
    memory = spheres * (SAMPLE_BYTES if light else NETWORK_BYTES)
    refuse_above_memory(memory, task, "repeat it fewer times")
    made = options.made.attributes()
    if isinstance(packing, Sample):
        write_sample(output, replace(repeat_sample(packing, *times), provenance=made))
    else:
        write_network(output, replace(repeat(packing, *times), provenance=made))
    return {"spheres": spheres}
