"""The exact lattice of the crystal under 100 kPa, and its records, for tests of estimators."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.estimators.layer_lattice import LayerLattice, lattice_signals
from modal.packing.crystal import fcc
from modal.packing.network import Network, write_network
from modal.waves.motions import Pulse
from modal.waves.response import Response, frequency_response, write_response
from modal.waves.signals import Signals, write_signals

CHAIN = LayerLattice.of_network(fcc(cells=(1, 1, 200)))
LENGTH = (CHAIN.layers - 1) * CHAIN.distance + 2 * CHAIN.wall_gap
PASSAGE = LENGTH / CHAIN.velocity
"""Time in which the longest waves pass from wall to wall, s."""


def record(passages: float = 1.0, step: float = 4e-7, **settings: float) -> Signals:
    """Return the exact record of so many passages, every `step`, s."""
    return lattice_signals(CHAIN, np.arange(0, passages * PASSAGE, step), Pulse(**settings))


def coarse_gain(network: Network) -> Response:
    """Return a gain that resolves no single maximum of a column of 200 layers.

    It stands in for the gain where that is not the point: with its default resolution it takes
    several seconds, more than all other numbers of the column together.
    """
    return frequency_response(network, highest=1e5, resolution=1e4)


def write_crystal(folder: Path, name: str, stress: float = 1e5, recorded: bool = True) -> Network:
    """Write a column of 200 layers, a coarse gain and, if `recorded`, its exact record."""
    network = fcc(stress, (1, 1, 200))
    write_network(folder / f"{name}.network.h5", network)
    write_response(folder / f"{name}.response.h5", coarse_gain(network))
    if recorded:
        lattice = LayerLattice.of_network(network)
        signals = lattice_signals(lattice, np.arange(0, network.length / lattice.velocity, 4e-7))
        write_signals(folder / f"{name}.signals.h5", signals)
    return network


def moved(found: Signals, displacement: np.ndarray) -> Signals:
    """Return the record with other displacements of the chain."""
    return replace(found, chain_displacement=displacement)


def noisy(found: Signals, share: float, random: np.random.Generator) -> Signals:
    """Return the record with white noise, a `share` of the largest displacement."""
    u = found.chain_displacement
    return moved(found, u + share * abs(u).max() * random.standard_normal(u.shape))


def part_of_chain(found: Signals, at: np.ndarray | slice) -> Signals:
    """Return the record of some of the particles, or of all in another order."""
    return replace(
        found,
        chain_position=found.chain_position[at],
        chain_displacement=found.chain_displacement[:, at],
        chain_particle=found.chain_particle[at],
    )
