"""The command `count`: exact numbers of modes below frequencies."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import add_choice
from modal.cli.reading import frequencies, network_command, packing_of, remark_on_ends
from modal.modes.collective import summary_at_zero
from modal.modes.counts import counts_below
from modal.solvers.factor import SOLVERS
from modal.system.contacts import SYMMETRIC
from modal.system.linear_system import LinearSystem


def add(commands: Any) -> None:
    """The options of `count`."""
    text = "exact number of modes below each frequency, by inertia counts"
    example = "count mine.network.h5 --at 1000 5000"
    command = network_command(commands, "count", text, example, springs=SYMMETRIC)
    text = "one or several frequencies"
    command.add_argument("--at", nargs="+", required=True, metavar="HZ", help=text)
    text = "what factorises (default: the fastest)"
    add_choice(command.add_argument_group("advanced"), "--solver", SOLVERS, text)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Counts by the frequencies as they were typed."""
    network = packing_of(options)
    system = LinearSystem.of(network, pre_stress=options.pre_stress, solver=options.solver)
    at = frequencies(options.at)
    counts, at_zero = counts_below(system, at), summary_at_zero(system)
    floppy = at_zero["floppy_modes"] + at_zero["unstable_modes"]
    for f, count in zip(at, counts, strict=True):
        remark_on_ends(options, float(f), f > 0 and count <= floppy, count == system.size)
    return {
        "count_below": dict(zip(options.at, counts.tolist(), strict=True)),
        **at_zero,
        "degrees_of_freedom": system.size,
    }
