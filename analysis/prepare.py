"""What the report of a case needs beside the products of its run: gain, densities, ridge.

Each is made from the contact network alone and kept in a file, because it takes longer than a
report should.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from analysis.gain import RESOLUTION as GAIN_RESOLUTION
from analysis.products import Products
from analysis.structure_factor import structure_factor, write_structure
from modal.density import density_of_states, write_density
from modal.eigenproblem import Eigenproblem
from modal.response import frequency_response, write_response
from modal.storage import sha256

GAIN_REACH = 18
"""Highest frequency of the gain, in f_1 = V / 2 L of the affine wave, as its resolution is."""
RESOLUTION, DENSITY_RESOLUTION = 1e3, 2e3
"""Hz, of the structure factor and of the density of states."""


def prepare(case: Products) -> list[Path]:
    """Make what is missing: the gain, and for a random case density and structure factor."""
    network, made = case.network, []
    digest = sha256(next(case.path(k) for k in ("network", "sample") if case.has(k)))
    if not case.has("response"):
        first = 0.5 / case.passage
        found = frequency_response(
            network, highest=GAIN_REACH * first, resolution=GAIN_RESOLUTION * first
        )
        made.append(case.path("response"))
        write_response(made[-1], found, digest)
    if not case.is_crystal and not case.has("density"):
        made.append(case.path("density"))
        zero = Eigenproblem.of(network).floppy.basis
        states = density_of_states(network, resolution=DENSITY_RESOLUTION, zero_modes=zero)
        write_density(made[-1], states, digest)
    if not case.is_crystal and not case.has("structure"):
        layers = int(network.length / case.diameter)
        highest = 1.5 * layers / (2 * case.passage)
        made.append(case.path("structure"))
        found = structure_factor(network, standing_orders(layers), RESOLUTION, highest)
        write_structure(made[-1], found, digest)
    return made


def standing_orders(layers: int) -> np.ndarray:
    """Every order at long waves, then steps of a tenth of kappa, to one order a layer."""
    orders = np.round(1.1 ** np.arange(0, np.log(layers) / np.log(1.1)))
    orders = np.union1d(np.arange(1, 31), orders)
    return orders[orders <= layers].astype(int)
