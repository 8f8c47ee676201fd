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

SAMPLE_BYTES_PER_SPHERE = 100.0
"""Memory for each sphere of a repeated sample without shear forces, as measured."""
NETWORK_BYTES_PER_SPHERE = 1500.0
"""Memory for each sphere of a repeated network, or of a sample with shear forces, as measured."""
EXAMPLE = "tile mine.network.h5 --repeat 2 2 -o wide.network.h5"
OPTIONS = (
    NETWORK,
    Option("--repeat", ("NX", "NY"), "how often along x and y", kind=int, more=REQUIRED),
    output("*.network.h5, or of a sample *.sample.h5", PACKING_ENDINGS, required=True),
)

read_product = read


def run(options: Options) -> Result:
    """Write the repeated packing; a sample is written as a sample if the name of FILE says so."""
    n_x, n_y = options.repeat
    source = options.network
    target = options.output
    if is_sample(target) and not is_sample(source):
        raise InputError(
            "not_a_sample",
            f"-o {target}: only a sample gives a sample",
            remedy="write *.network.h5",
        )
    packing: Sample | Network = read_remarked(source, options.remarks.append)
    if is_sample(target):
        packing = read_sample(source)
    _refuse_above_memory(packing, source, n_x, n_y)
    provenance = options.made.attributes()
    if isinstance(packing, Sample):
        repeated = replace(repeat_sample(packing, n_x, n_y), provenance=provenance)
        write_sample(target, repeated)
    else:
        write_network(target, replace(repeat(packing, n_x, n_y), provenance=provenance))
    return {"spheres": len(packing.position) * n_x * n_y}


def _refuse_above_memory(packing: Sample | Network, source: str, n_x: int, n_y: int) -> None:
    """Raise InputError if the repeated packing needs more than the free memory."""
    bytes_per_sphere = NETWORK_BYTES_PER_SPHERE
    if isinstance(packing, Sample) and packing.shear is None:
        bytes_per_sphere = SAMPLE_BYTES_PER_SPHERE
    spheres = len(packing.position) * n_x * n_y
    task = f"repeating {source} {n_x} by {n_y} times"
    refuse_above_memory(spheres * bytes_per_sphere, task, "repeat it fewer times")
