"""The command `modes`: natural frequencies and mode shapes."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import SHORT, add_if_stale, network_command, say
from modal.formats.hdf5 import InputError
from modal.modes.highest import all_modes, highest_modes, memory_of_all
from modal.modes.lowest import lowest_modes, modes_between
from modal.modes.mode_set import ModeSet, read_modes, write_modes
from modal.modes.problem import SMALL, Eigenproblem, slipping
from modal.packing.plausibility import read_remarked
from modal.solvers.factor import SOLVERS

read_product = read_modes


def add(commands: Any) -> None:
    """The options of `modes`."""
    command = network_command(commands, "modes", "natural frequencies and mode shapes")
    command.epilog = f"Exit status {SHORT}: modes are missing from the list; it says how many."
    choice = command.add_mutually_exclusive_group()
    choice.add_argument("--lowest", type=int, metavar="K")
    choice.add_argument("--highest", type=int, metavar="K")
    choice.add_argument("--below", type=float, metavar="HZ")
    choice.add_argument("--between", type=float, nargs=2, metavar="HZ")
    choice.add_argument("--all", action="store_true")
    command.add_argument(
        "--uncertified", action="store_true", help="--highest without its exact count: faster"
    )
    command.add_argument(
        "--hours",
        type=float,
        default=1.0,
        metavar="H",
        help="refuse what would take longer, as estimated; default 1",
    )
    command.add_argument("--translations-only", action="store_true", help="hold rotations at zero")
    command.add_argument("--solver", choices=SOLVERS, help="factorisation; default: the fastest")
    command.add_argument("--sliding", choices=("elastic", "slip"), default="elastic")
    command.add_argument("-o", "--output", metavar="FILE", help="write *.modes.h5")
    add_if_stale(command)


def short_of(path: str) -> dict[str, Any]:
    """What a list that is kept fell short of when it was made: its exit status stays."""
    return {"missing": int(read_modes(path).attributes.get("missing", 0))}


def run(options: argparse.Namespace) -> dict[str, Any]:
    """The modes that are asked for, and whether their list is complete."""
    network = read_remarked(options.network, options.remarks.append)
    if options.sliding == "slip":
        network = slipping(network)
    problem = Eigenproblem.of(
        network,
        translations_only=options.translations_only,
        solver=options.solver,
        shapes=bool(options.output),
        hours=options.hours,
    )
    if options.all and problem.size > SMALL:
        say(f"all {problem.size} modes: {memory_of_all(problem)}")
    modes = _solve(problem, options)
    floppy = problem.floppy
    modes.attributes["floppy_modes"] = floppy.total
    if options.output:
        write_modes(options.output, modes, options.made)
    _say_what_is_not(modes, options.output)
    return {
        "frequency_hz": modes.frequency.tolist(),
        "residual": modes.residual.tolist(),
        "floppy_modes": floppy.total,
        "floppy_modes_by_kind": floppy.by_kind(),
        "degrees_of_freedom": problem.size,
        "certified": bool(modes.attributes["certified"]),
        "missing": int(modes.attributes["missing"]),
        "uncertified_because": modes.attributes.get("uncertified_because", ""),
        "solver": modes.attributes["solver"],
        "p_wave_resonances": 0
        if modes.resonance_frequency is None
        else len(modes.resonance_frequency),
    }


def _solve(problem: Eigenproblem, options: argparse.Namespace) -> ModeSet:
    if options.highest is not None:
        return highest_modes(problem, options.highest, certify=not options.uncertified)
    if options.uncertified:
        raise InputError("--uncertified is for --highest; other lists cost hardly less without")
    if options.all:
        return all_modes(problem)
    if options.below is not None:
        return modes_between(problem, 0.0, options.below)
    if options.between is not None:
        return modes_between(problem, *options.between)
    default = min(10, problem.size - problem.floppy.total)
    return lowest_modes(problem, default if options.lowest is None else options.lowest)


def _say_what_is_not(modes: ModeSet, output: str | None) -> None:
    """A line each on standard error for what the list of modes lacks."""
    reason = modes.attributes.get("uncertified_because")
    if reason:
        say(f"not certified: {reason}")
    left_out = modes.attributes.get("shapes_left_out")
    if output and left_out:
        say(f"{output} has no mode shapes: {left_out}")
