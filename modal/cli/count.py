"""The command `count`: exact numbers of modes below frequencies."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import network_command, numbers
from modal.cli.reading import add_sliding, packing_of
from modal.modes.collective import summary_at_zero
from modal.modes.counts import counts_below
from modal.modes.problem import Eigenproblem


def add(commands: Any) -> None:
    """The options of `count`."""
    command = network_command(
        commands,
        "count",
        "exact number of modes below each frequency",
        "count mine.network.h5 --at 1000 5000",
    )
    command.add_argument(
        "--at", nargs="+", required=True, metavar="HZ", help="one or several frequencies"
    )
    command.add_argument(
        "--solver",
        choices=("pardiso", "superlu", "layers"),
        help="what factorises (default: the fastest)",
    )
    add_sliding(command)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Counts by the frequencies as they were typed."""
    network = packing_of(options)
    problem = Eigenproblem.of(network, solver=options.solver)
    counts = counts_below(problem, numbers(options.at))
    return {
        "count_below": dict(zip(options.at, counts.tolist(), strict=True)),
        **summary_at_zero(problem),
        "degrees_of_freedom": problem.size,
    }
