"""Gain from wall to wall, and motions of chain and layers, at each frequency."""

from modal.cli.options import Option, Options, Result, chosen_for
from modal.cli.reading import packing_of, springs
from modal.cli.wave import SOURCE_OPTIONS, source_arguments
from modal.waves.response import RESOLUTION, frequency_response, write_response

RESOLUTION_HELP = (
    f"width of a peak (default: {RESOLUTION:g} of the highest mode's frequency, at most a "
    "twentieth of --highest)"
)
EXAMPLE = "response mine.network.h5 --highest 20000 -o mine.response.h5"
OPTIONS = (
    *springs(".response.h5"),
    Option("--highest", "HZ", "up to here (default: the whole spectrum)"),
    Option("--resolution", "HZ", RESOLUTION_HELP),
    *SOURCE_OPTIONS,
)

read_product = None


def run(options: Options) -> Result:
    """Compute the response up to the highest frequency, and find the maxima of the gain."""
    network = packing_of(options)
    arguments = chosen_for(frequency_response, options) | source_arguments(options, network)
    response = frequency_response(network, **arguments)
    if options.output:
        write_response(options.output, response, options.made)
    result: Result = {}
    if response.damping:
        result["damping"] = [response.damping.normal, response.damping.tangential]
    else:
        result["resolution_hz"] = response.resolution
    result["frequencies"] = len(response.frequency)
    result["highest_frequency_hz"] = float(response.frequency[-1])
    result["products_with_k"] = response.products
    if response.from_wall_to_wall:
        result["largest_gain"] = float(response.gain.max())
        result["gain_maxima_hz"] = response.gain_maxima().tolist()
    else:
        largest = float(abs(response.layer_displacement).max())
        result["largest_displacement_per_unit"] = largest
    return result
