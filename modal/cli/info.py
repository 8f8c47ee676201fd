"""The command `info`: what is in a packing."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import network_command
from modal.modes.problem import Eigenproblem
from modal.packing.plausibility import plausibility
from modal.packing.sample import read_packing
from modal.packing.state import contacts_per_particle, profile, summary, write_profile


def add(commands: Any) -> None:
    """The options of `info`."""
    text = "what is in a packing: stresses, density, coordination"
    command = network_command(commands, "info", text)
    command.add_argument("--layers", metavar="FILE", help="write the layers along z, *.csv")


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Numbers of the packing as a whole, and its layers where they are asked for."""
    network = read_packing(options.network)
    touching = contacts_per_particle(network)
    floppy = Eigenproblem.of(network).floppy
    if options.layers:
        write_profile(options.layers, profile(network))
    return {
        "particles": network.n_particles,
        "contacts": network.n_contacts,
        "wall_contacts": int(network.with_wall.sum()),
        "length_m": network.length,
        "particles_with_0_1_2_contacts": [int((touching == few).sum()) for few in range(3)],
        **summary(network, network.noted("mu_wave")),
        **plausibility(network),
        "degrees_of_freedom": 6 * network.n_particles,
        "floppy_modes": floppy.total,
        "floppy_modes_by_kind": floppy.by_kind(),
        "study": {key: str(value) for key, value in network.study.items()},
    }
