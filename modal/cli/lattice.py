"""The command `lattice`: the analytic FCC crystal."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import add_command, add_value
from modal.theory.fcc import FccLattice


def add(commands: Any) -> None:
    """The options of `lattice`."""
    text = "the face-centred cubic crystal in theory: stiffness, velocity, low-pass frequency"
    command = add_command(commands, "lattice", text, "lattice --stress 1e5")
    add_value(command, "--stress", "PA", "isotropic", 1e5)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Stiffnesses, f_low-pass and the velocity of long waves at this stress."""
    crystal = FccLattice(options.stress)
    return {
        "stress_pa": crystal.stress,
        "overlap_m": crystal.overlap,
        "stiffness_normal_n_per_m": crystal.kn,
        "stiffness_tangential_n_per_m": crystal.kt,
        "layer_stiffness_n_per_m": crystal.C,
        "layer_distance_m": crystal.layer_distance,
        "f_low_pass_hz": crystal.low_pass_frequency,
        "long_wave_velocity_m_per_s": crystal.velocity,
    }
