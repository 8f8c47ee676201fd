"""Command line of modal: pack, relax, info, modes, count, density, wave, response, lattice."""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from typing import Any, NoReturn

from modal.cli.density import add_density_options, density
from modal.cli.packing import add_pack, add_relax, pack, relax_sample
from modal.formats.hdf5 import InputError, sha256
from modal.formats.provenance import is_current, made_by
from modal.modes.counts import count_below
from modal.modes.highest import all_modes, highest_modes, memory_of_all
from modal.modes.lowest import lowest_modes, modes_between
from modal.modes.mode_set import ModeSet, read_modes, write_modes
from modal.modes.problem import SMALL, Eigenproblem, slipping
from modal.packing.plausibility import plausibility, read_remarked
from modal.packing.sample import read_packing, read_sample
from modal.packing.state import contacts_per_particle, profile, summary, write_profile
from modal.solvers.factor import SOLVERS
from modal.stiffness.pre_stress import PRE_STRESS
from modal.theory.fcc import FccCrystal
from modal.waves.leapfrog import leapfrog, steps_between_records
from modal.waves.propagate import propagate
from modal.waves.response import frequency_response, write_response
from modal.waves.signals import read_signals, write_signals
from modal.waves.source import AMPLITUDE, INPUT_FREQUENCY, Pulse, read_motion

PRODUCERS = {
    "modes": read_modes,
    "density": None,
    "wave": read_signals,
    "response": None,
    "relax": read_sample,
}
"""Commands that write one product, made from sources with settings, and who reads it."""
SHORT = 3
"""Exit status where a product is written but falls short: a list of modes that lacks some, a sample
that has not come to rest within the tolerance."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f"{self.prog}: {message}; see {self.prog} --help")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="python -m modal", description="Eigenmodes of granular packings")
    commands = parser.add_subparsers(dest="command", required=True, parser_class=_Parser)

    def network_command(name: str, text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.add_argument("network", help="*.network.h5, or *.sample.h5")
        command.add_argument("--json", action="store_true", help="print one JSON object")
        return command

    add_pack(commands)
    add_relax(commands)
    info = network_command("info", "what is in a packing: stresses, density, coordination")
    info.add_argument("--layers", metavar="FILE", help="write the layers along z, *.csv")
    modes = network_command("modes", "natural frequencies and mode shapes")
    modes.epilog = f"Exit status {SHORT}: modes are missing from the list; it says how many."
    choice = modes.add_mutually_exclusive_group()
    choice.add_argument("--lowest", type=int, metavar="K")
    choice.add_argument("--highest", type=int, metavar="K")
    choice.add_argument("--below", type=float, metavar="HZ")
    choice.add_argument("--between", type=float, nargs=2, metavar="HZ")
    choice.add_argument("--all", action="store_true")
    modes.add_argument(
        "--uncertified", action="store_true", help="--highest without its exact count: faster"
    )
    modes.add_argument(
        "--hours",
        type=float,
        default=1.0,
        metavar="H",
        help="refuse what would take longer, as estimated; default 1",
    )
    modes.add_argument("--translations-only", action="store_true", help="hold rotations at zero")
    modes.add_argument("--solver", choices=SOLVERS, help="factorisation; default: the fastest")
    modes.add_argument("--sliding", choices=("elastic", "slip"), default="elastic")
    modes.add_argument("-o", "--output", metavar="FILE", help="write *.modes.h5")
    count = network_command("count", "exact number of modes below each frequency")
    count.add_argument("--at", nargs="+", required=True, metavar="HZ")
    add_density_options(network_command("density", "how all modes are distributed"))
    count.add_argument("--solver", choices=("pardiso", "superlu", "layers"))
    wave = network_command("wave", "signals of a wave in the linear network")
    wave.add_argument("--amplitude", type=float, default=AMPLITUDE, metavar="A", help="m")
    wave.add_argument("--input-frequency", type=float, default=INPUT_FREQUENCY, metavar="HZ")
    wave.add_argument("--duration", type=float, default=5e-4, metavar="S")
    wave.add_argument("--source", metavar="FILE", help="wall motion, two columns: s, m")
    wave.add_argument("--interval", type=float, metavar="S", help="between records; 1e-6")
    wave.add_argument("--tolerance", type=float, default=1e-9, help="relative; 1e-9")
    wave.add_argument("--pre-stress", choices=PRE_STRESS, default="none")
    wave.add_argument("--particles", action="store_true", help="record every particle")
    wave.add_argument("--method", choices=("chebyshev", "leapfrog"), default="chebyshev")
    wave.add_argument("--time-step", type=float, metavar="S", help="of the leapfrog")
    wave.add_argument("-o", "--output", metavar="FILE", help="write *.signals.h5")
    response = network_command("response", "transfer functions from the source wall, gain factor")
    response.add_argument("--highest", type=float, metavar="HZ", help="default: whole spectrum")
    response.add_argument("--resolution", type=float, default=1e3, metavar="HZ")
    response.add_argument("--pre-stress", choices=PRE_STRESS, default="none")
    response.add_argument("-o", "--output", metavar="FILE", help="write *.response.h5")
    for name in PRODUCERS:
        commands.choices[name].add_argument(
            "--if-stale", action="store_true", help="keep FILE if sources and settings are the same"
        )
    lattice = commands.add_parser("lattice", help="the analytic FCC crystal (Eqs. 5-10)")
    lattice.add_argument("--stress", type=float, default=1e5, metavar="PA")
    lattice.add_argument("--json", action="store_true", help="print one JSON object")
    return parser


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


def _info(options: argparse.Namespace) -> dict[str, Any]:
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


def _modes(options: argparse.Namespace) -> dict[str, Any]:
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
        print(f"all {problem.size} modes: {memory_of_all(problem)}", file=sys.stderr)
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


def _say_what_is_not(modes: ModeSet, output: str | None) -> None:
    """A line each on standard error for what the list of modes lacks."""
    reason = modes.attributes.get("uncertified_because")
    if reason:
        print(f"not certified: {reason}", file=sys.stderr)
    left_out = modes.attributes.get("shapes_left_out")
    if output and left_out:
        print(f"{output} has no mode shapes: {left_out}", file=sys.stderr)


def _count(options: argparse.Namespace) -> dict[str, Any]:
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


def _wave(options: argparse.Namespace) -> dict[str, Any]:
    network = read_remarked(options.network, options.remarks.append)
    motion = Pulse(options.amplitude, options.input_frequency)
    if options.source:
        motion = read_motion(options.source)
    settings = {
        "motion": motion,
        "pre_stress": options.pre_stress,
        "particles": options.particles,
        "network_sha256": sha256(options.network),
    }
    interval = 1e-6 if options.interval is None else options.interval
    step = options.time_step
    if options.method == "leapfrog":
        if step is None:
            raise InputError("--method leapfrog needs --time-step; give it in s")
        every = steps_between_records(interval, step)
        signals = leapfrog(network, options.duration, step, every=every, **settings)
        accuracy = {"time_step_s": step}
    else:
        if step is not None:
            raise InputError("--time-step is for --method leapfrog; chebyshev takes --tolerance")
        wave = propagate(
            network, options.duration, interval=interval, tolerance=options.tolerance, **settings
        )
        signals = wave.signals
        accuracy = {"products_with_k": wave.products, "truncation": wave.truncation}
    if options.output:
        write_signals(options.output, signals, options.made)
    return {
        "particles_of_the_chain": len(signals.chain_particle),
        "times": len(signals.time),
        **accuracy,
        "largest_displacement_m": float(abs(signals.chain_displacement).max()),
        "degrees_of_freedom": 6 * network.n_particles,
    }


def _response(options: argparse.Namespace) -> dict[str, Any]:
    found = frequency_response(
        read_remarked(options.network, options.remarks.append),
        highest=options.highest,
        resolution=options.resolution,
        pre_stress=options.pre_stress,
    )
    if options.output:
        write_response(options.output, found, sha256(options.network), options.made)
    return {
        "resolution_hz": found.resolution,
        "frequencies": len(found.frequency),
        "highest_frequency_hz": float(found.frequency[-1]),
        "products_with_k": found.products,
        "largest_gain": float(found.gain.max()),
        "gain_maxima_hz": found.gain_maxima().tolist(),
    }


def _lattice(options: argparse.Namespace) -> dict[str, Any]:
    if not 0 < options.stress < 1e9:
        raise InputError(f"--stress {options.stress:g}: outside 0 to 1e9 Pa; give it in Pa")
    crystal = FccCrystal(options.stress)
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


def _short_of(command: str, path: str) -> dict[str, Any]:
    """What a product that is kept fell short of when it was made: its exit status stays."""
    if command == "modes":
        return {"missing": int(read_modes(path).attributes.get("missing", 0))}
    if command == "relax":
        return {"at_rest": bool(read_sample(path).study.get("at_rest", True))}
    return {}


def _say(text: str) -> None:
    print(text, file=sys.stderr)


def _print(result: dict[str, Any]) -> None:
    for key, value in result.items():
        if isinstance(value, list) and len(value) > 12:
            head = ", ".join(f"{item:.6g}" for item in value[:5])
            tail = ", ".join(f"{item:.6g}" for item in value[-5:])
            value = f"{head}, ... {tail} ({len(value)} values)"
        elif isinstance(value, list):
            value = ", ".join(i if isinstance(i, str) else f"{i:.9g}" for i in value)
        elif isinstance(value, dict):
            value = ", ".join(f"{name}: {item}" for name, item in value.items())
        elif isinstance(value, float):
            value = f"{value:.9g}"
        print(f"{key.replace('_', ' '):34s} {value}")


def main(argv: list[str] | None = None) -> int:
    """Run one command; returns the exit status.

    2 for a user's mistake (one line on stderr), 3 for a product that falls short of what was asked.
    """
    commands = {
        "pack": pack,
        "relax": relax_sample,
        "info": _info,
        "modes": _modes,
        "count": _count,
        "density": density,
        "wave": _wave,
        "response": _response,
        "lattice": _lattice,
    }
    start = time.perf_counter()
    try:
        options = _parser().parse_args(argv)
        options.made, options.remarks = None, []
        if options.command in PRODUCERS and options.output:
            arguments = sys.argv[1:] if argv is None else argv
            options.made = made_by(options.command, vars(options), arguments)
        elif getattr(options, "if_stale", False):
            raise InputError("--if-stale is about the file of -o; give one")
        if getattr(options, "if_stale", False) and is_current(
            options.output, options.made, _say, PRODUCERS[options.command]
        ):
            result = {"current": options.output} | _short_of(options.command, options.output)
        else:
            result = commands[options.command](options)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, SystemError) as error:
        # Ctrl-C in the middle of compiled code arrives as a SystemError that it has caused.
        if not isinstance(error.__cause__ or error, KeyboardInterrupt):
            raise
        print("interrupted; files are whole or absent", file=sys.stderr)
        return 130
    # With an error its one line is enough.
    for remark in options.remarks:
        _say(remark)
    result["seconds"] = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    result["peak_memory_bytes"] = peak * (1 if sys.platform == "darwin" else 1024)
    if options.json:
        print(json.dumps(result))
    else:
        _print(result)
    return SHORT if result.get("missing") or not result.get("at_rest", True) else 0


if __name__ == "__main__":
    sys.exit(main())
