"""The command `modes`: natural frequencies and mode shapes."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import SHORT, add_choice, add_flag, add_value, chosen, say
from modal.cli.reading import network_command, packing_of
from modal.modes.eigenmodes import eigenmodes
from modal.modes.first_order import shift_by_law
from modal.modes.mode_set import ModeSet, read_modes, write_modes
from modal.modes.observables import PLANAR
from modal.modes.zero_modes import by_structure
from modal.solvers.factor import SOLVERS
from modal.system.contacts import TANGENTS
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError

ASKED = (
    *("lowest", "highest", "below", "between", "all", "hours"),
    *("translations_only", "pre_stress", "solver"),
)
"""Options that `eigenmodes` has under the same names."""

read_product = read_modes


def add(commands: Any) -> None:
    """The options of `modes`."""
    text = "natural frequencies and mode shapes, their list proved complete by inertia counts"
    example = "modes mine.network.h5 --lowest 20 -o mine.modes.h5"
    command = network_command(commands, "modes", text, example, "*.modes.h5", TANGENTS)
    command.epilog = f"Exit status {SHORT}: the list lacks modes; it says how many."
    choice = command.add_mutually_exclusive_group()
    add_value(choice, "--lowest", "K", "the K lowest modes", kind=int)
    add_value(choice, "--highest", "K", "the K highest modes", kind=int)
    add_value(choice, "--below", "HZ", "all modes below HZ")
    add_value(choice, "--between", ("HZ", "HZ"), "all modes between two frequencies")
    add_flag(choice, "--all", "all modes; for small packings")
    add_value(command, "--hours", "H", "refuse what is estimated to take longer", 1.0)
    add_flag(command, "--translations-only", "hold rotations at zero")
    advanced = command.add_argument_group("advanced")
    add_flag(advanced, "--uncertified", "--highest without its inertia count: faster")
    add_choice(advanced, "--solver", SOLVERS, "factorisation (default: the fastest)")


def kept(options: argparse.Namespace) -> dict[str, Any]:
    """What a list that is kept fell short of when it was made: its exit status stays."""
    return {"missing": read_modes(options.output).missing}


def run(options: argparse.Namespace) -> dict[str, Any]:
    """The modes that are asked for, and whether their list is complete."""
    network = packing_of(options)
    if options.uncertified and options.highest is None:
        raise InputError("--uncertified is for --highest; other lists cost hardly less without")
    system = LinearSystem.of(
        network, pre_stress=options.pre_stress, translations_only=options.translations_only
    )
    asked = chosen(options, *ASKED)
    shapes, certify = bool(options.output), not options.uncertified
    modes = eigenmodes(network, **asked, shapes=shapes, certify=certify)
    if options.output:
        write_modes(options.output, modes, options.made)
    _say_what_is_not(modes, options.output)
    shift = shift_by_law(network, modes) if options.pre_stress == "none" else None
    return {
        "frequency_hz": modes.frequency.tolist(),
        "chi_z": modes.chi_z.tolist(),
        "residual": modes.residual.tolist(),
        "floppy_modes": modes.floppy_modes,
        "floppy_modes_by_kind": by_structure(system).kinds
        | {"collective": modes.floppy_modes - by_structure(system).total},
        "unstable_modes": modes.unstable_modes,
        "degrees_of_freedom": system.size,
        "certified": modes.certified,
        "missing": modes.missing,
        "uncertified_because": modes.attributes.get("uncertified_because", ""),
        "solver": modes.attributes["solver"],
        f"modes_with_chi_z_above_{PLANAR}": int((modes.chi_z > PLANAR).sum()),
    } | ({} if shift is None else {"shift_by_the_law_hz": shift.tolist()})


def _say_what_is_not(modes: ModeSet, output: str | None) -> None:
    """A line each on standard error for what the list of modes lacks."""
    reason = modes.attributes.get("uncertified_because")
    if reason:
        say(f"not certified: {reason}")
    if modes.unstable_modes:
        say(f"K has a negative direction: {modes.unstable_modes} unstable modes are left out")
    left_out = modes.attributes.get("shapes_left_out")
    if output and left_out:
        say(f"{output} has no mode shapes: {left_out}")
