"""Waves by the study's script inside YADE: their signals, time and memory."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from benchmarks.harness.measure import ROOT, Measured, median_of, run_command
from modal.modes.highest import highest_modes
from modal.modes.mode_set import write_modes
from modal.modes.problem import Eigenproblem
from modal.packing.network import Network
from modal.packing.network_file import write_network
from modal.packing.sample import Sample
from modal.waves.signals import Signals, read_signals
from modal.waves.source import INPUT_FREQUENCY

YADE = ["yade", "-n", "-x", "-j1"]


def available() -> bool:
    """Whether YADE is installed."""
    return shutil.which("yade") is not None


def run_script(script: str, table: str, folder: Path, **environment: str) -> Measured:
    """What a script of the study costs, run as yade-batch would for a table of one line.

    yade-batch itself looks only every second whether a job has ended.
    """
    path, log = folder / f"{script}.table", folder / f"{script}.log"
    path.write_text(table)
    command = [*YADE, str(ROOT / "yade_scripts" / f"{script}.py")]
    settings = {"WAVE_PRODUCTS": str(folder), "YADE_BATCH": f"{path}:2"}
    return run_command(command, folder, log, settings | environment)


def in_yades_order(network: Network, friction: float = 0.1) -> Network:
    """The network of equal spheres with its contacts in the order that the scripts expect."""
    sample = Sample(
        network.position, network.cell_size[:2], network.wall_position, friction=friction
    )
    return sample.network()


def prepare_wave(network: Network, folder: Path) -> None:
    """The two files that the wave script needs, as case 2."""
    folder.mkdir(parents=True, exist_ok=True)
    write_network(folder / "case02.network.h5", network)
    highest = highest_modes(Eigenproblem.of(network), 1, certify=False)
    write_modes(folder / "case02.highest.modes.h5", highest)


def wave(
    folder: Path,
    *,
    fraction: float,
    amplitude: float,
    times: int,
    **optional: float,
) -> tuple[Signals, Measured]:
    """Signals of a wave run in a prepared folder, and what it has cost: the median of `times` runs.

    fraction of the time-step limit; amplitude A, m; optional duration and recording interval, s.
    The cost includes YADE's start and the building of the scene.
    """
    table = f"case mu_wave input_frequency\n2 0.1 {INPUT_FREQUENCY:g}\n"
    settings = {"fraction": fraction, "amplitude": amplitude, **optional}
    environment = {f"WAVE_{name.upper()}": repr(float(v)) for name, v in settings.items()}
    written = folder / "case02.signals.h5"

    def once() -> Measured:
        written.unlink(missing_ok=True)
        return run_script("wave", table, folder, **environment)

    spent = median_of(times, once)
    return read_signals(written), spent


def steps_alone(spent: Measured, start: Measured) -> Measured:
    """The cost of a wave without that of a start."""
    return replace(spent, seconds=max(spent.seconds - start.seconds, 1e-2))


def wave_start(folder: Path, times: int) -> Measured:
    """What a wave run of a single interval costs: a start."""
    return wave(folder, fraction=0.5, amplitude=2.5e-9, duration=1.1e-5, times=times)[1]
