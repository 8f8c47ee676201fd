"""The command `density`: how all modes of a packing are distributed."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from modal.cli.options import add_value, chosen
from modal.cli.reading import frequencies, network_command, packing_of, remark_on_ends
from modal.formats.hdf5 import sha256
from modal.modes.density import density_of_states, write_density
from modal.system.contacts import SYMMETRIC

COMPONENTS = ("u_x", "u_y", "u_z", "theta_x", "theta_y", "theta_z", "all")
QUARTILES = (0.25, 0.5, 0.75)

read_product = None


def add(commands: Any) -> None:
    """The options of `density`."""
    text = "density of states (DOS): modes per frequency, for each component of motion"
    example = "density mine.network.h5 --resolution 2000 -o mine.density.h5"
    command = network_command(commands, "density", text, example, "*.density.h5", SYMMETRIC)
    add_value(command, "--resolution", "HZ", "width of a peak", 2e3)
    add_value(command, "--tolerance", "T", "error of counts over all modes", 1e-3)
    text = "print how many modes lie below"
    command.add_argument("--at", nargs="+", default=[], metavar="HZ", help=text)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Run the command; the result as it is printed."""
    at = frequencies(options.at)
    network = packing_of(options)
    asked = chosen(options, "resolution", "tolerance", "pre_stress")
    states = density_of_states(network, **asked)
    if options.output:
        write_density(options.output, states, sha256(options.network), options.made)
    frequency = states.grid()
    below = states.count_below(frequency)[0]
    size = 6 * network.n_particles
    value, error = states.count_below(at)
    for f in at:
        remark_on_ends(options, float(f), False, f > states.highest)
    return {
        "resolution_hz": states.resolution,
        "random_vectors": states.random_vectors,
        "products_with_k": states.products,
        "quartiles_hz": {
            name: np.interp(QUARTILES, below[:, c] / below[-1, c], frequency).tolist()
            for c, name in enumerate(COMPONENTS)
        },
        "estimated_count_below": dict(zip(options.at, value[:, -1].tolist(), strict=True)),
        "standard_error": dict(zip(options.at, error[:, -1].tolist(), strict=True)),
        "floppy_modes": round(float(states.zero_modes.sum())),
        "floppy_modes_counted": states.counted,
        "degrees_of_freedom": size,
    }
