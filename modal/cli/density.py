"""Density of states (DOS): modes per frequency, for each component of motion."""

import numpy as np

from modal.cli.options import Option, Options, Result, chosen_for
from modal.cli.reading import packing_of, remark_on_ends, springs
from modal.modes.density import RESOLUTION, density_of_states, write_density
from modal.tools.arguments import frequencies
from modal.tools.display import quantity

COMPONENTS = ("u_x", "u_y", "u_z", "theta_x", "theta_y", "theta_z", "all")
QUARTILES = (0.25, 0.5, 0.75)
RESOLUTION_HELP = f"width of a peak (default: {RESOLUTION:g} of the highest frequency)"
EXAMPLE = "density mine.network.h5 --resolution 2000 -o mine.density.h5"
OPTIONS = (
    *springs(".density.h5"),
    Option("--resolution", "HZ", RESOLUTION_HELP),
    Option("--tolerance", "T", "error of counts over all modes", 1e-3),
    Option("--at", "HZ ...", "print how many modes lie below", [], str),
)

read_product = None


def run(options: Options) -> Result:
    """Compute the density of states, and estimate how many modes lie below each frequency."""
    limits = frequencies(options.at)
    network = packing_of(options)
    states = density_of_states(network, **chosen_for(density_of_states, options))
    if options.output:
        write_density(options.output, states, options.made)
    if states.resolution > states.highest:
        options.remarks.append(
            f"--resolution {options.resolution:g}: wider than all of the spectrum, which ends at "
            f"{quantity(states.highest, 'Hz')}; give less, or leave it out"
        )
    frequency = states.grid()
    below = states.count_below(frequency)[0]
    quartiles = {}
    for name, count in zip(COMPONENTS, below.T, strict=True):
        quartiles[name] = np.interp(QUARTILES, count / count[-1], frequency).tolist()
    value, error = states.count_below(limits)
    for limit in limits:
        remark_on_ends(options, float(limit), False, limit > states.highest)
    return {
        "resolution_hz": states.resolution,
        "random_vectors": states.random_vectors,
        "products_with_k": states.products,
        "quartiles_hz": quartiles,
        "estimated_count_below": dict(zip(options.at, value[:, -1].tolist(), strict=True)),
        "standard_error": dict(zip(options.at, error[:, -1].tolist(), strict=True)),
        "floppy_modes": round(float(states.zero_modes.sum())),
        "floppy_modes_counted": states.counted,
        "degrees_of_freedom": network.degrees_of_freedom,
    }
