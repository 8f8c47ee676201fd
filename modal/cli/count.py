"""The command `count`: exact numbers of modes below frequencies."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import network_command
from modal.formats.hdf5 import InputError
from modal.modes.counts import count_below
from modal.modes.problem import Eigenproblem
from modal.packing.plausibility import read_remarked


def add(commands: Any) -> None:
    """The options of `count`."""
    command = network_command(commands, "count", "exact number of modes below each frequency")
    command.add_argument("--at", nargs="+", required=True, metavar="HZ")
    command.add_argument("--solver", choices=("pardiso", "superlu", "layers"))


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Counts by the frequencies as they were typed."""
    problem = Eigenproblem.of(
        read_remarked(options.network, options.remarks.append), solver=options.solver
    )
    counts = {}
    for typed in options.at:
        try:
            frequency = float(typed)
        except ValueError:
            raise InputError(f"--at {typed}: not a number; give frequencies in Hz") from None
        counts[typed] = count_below(problem, frequency)
    return {
        "count_below": counts,
        "floppy_modes": problem.floppy.total,
        "degrees_of_freedom": problem.size,
    }
