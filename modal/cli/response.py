"""What passes at each frequency: gain from wall to wall, motion of chain and layers."""

from modal.cli.options import Option, Options, Result, chosen_for
from modal.cli.reading import packing_of, springs
from modal.cli.wave import OF_SOURCE, source_of
from modal.waves.response import RESOLUTION, frequency_response, write_response

WIDTH = (
    f"width of a peak (default: {RESOLUTION:g} of the highest mode's frequency, at most a "
    "twentieth of --highest)"
)
EXAMPLE = "response mine.network.h5 --highest 20000 -o mine.response.h5"
OPTIONS = (
    *springs(".response.h5"),
    Option("--highest", "HZ", "up to here (default: the whole spectrum)"),
    Option("--resolution", "HZ", WIDTH),
    *OF_SOURCE,
)

read_product = None


def run(options: Options) -> Result:
    """The response up to the highest frequency, and where the gain has its maxima."""
    asked = chosen_for(frequency_response, options) | source_of(options)
    found = frequency_response(packing_of(options), **asked)
    if options.output:
        write_response(options.output, found, options.made)
    own: Result = {"resolution_hz": found.resolution}
    if found.damping:
        own = {"damping": [found.damping.normal, found.damping.tangential]}
    largest: Result = {"largest_displacement_per_unit": float(abs(found.layer_displacement).max())}
    if found.from_wall_to_wall:
        maxima = found.gain_maxima().tolist()
        largest = {"largest_gain": float(found.gain.max()), "gain_maxima_hz": maxima}
    return {
        **own,
        "frequencies": len(found.frequency),
        "highest_frequency_hz": float(found.frequency[-1]),
        "products_with_k": found.products,
        **largest,
    }
