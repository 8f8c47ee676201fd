"""Run a script inside YADE and measure it: time, memory, and what it wrote."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from benchmarks.measure import ROOT, Measured, median_of, run_command
from modal.eigenproblem import Eigenproblem
from modal.mode_set import write_modes
from modal.modes import highest_modes
from modal.network import Network, write_network
from modal.sample import Sample
from modal.signals import Signals, read_signals
from modal.source import INPUT_FREQUENCY

SCRIPTS = Path(__file__).resolve().parent / "yade"


def available() -> bool:
    """Whether YADE is installed."""
    return shutil.which("yade") is not None


def run_script(
    script: str, table: str, folder: Path, **environment: str
) -> tuple[str, float, float]:
    """One script of the study, as yade-batch would run it for a table of one line.

    Returns its log, processor time (s) and peak memory (MB). yade-batch itself looks only every
    second whether a job has ended.
    """
    path, log = folder / f"{script}.table", folder / f"{script}.log"
    path.write_text(table)
    seconds, peak = run_command(
        ["yade", "-n", "-x", "-j1", str(ROOT / "yade_scripts" / f"{script}.py")],
        folder,
        log,
        {"WAVE_PRODUCTS": str(folder), "YADE_BATCH": f"{path}:2"} | environment,
    )
    return log.read_text(), seconds, peak


def measured(script: str, folder: Path, *, whole: bool = False, **arguments: Any) -> Measured:
    """A script of benchmarks/yade, which times its own steps and writes JSON.

    With `whole` the seconds are those of the whole command, start and scene included. InputError
    if it fails.
    """
    result = folder / f"{script}.json"
    result.unlink(missing_ok=True)
    command = ["yade", "-n", "-x", "-j1", str(SCRIPTS / f"{script}.py"), str(result)]
    seconds, peak = run_command([*command, json.dumps(arguments)], folder, folder / f"{script}.log")
    found = json.loads(result.read_text())
    return Measured(found["value"], seconds if whole else found["seconds"], peak)


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
    duration: float | None = None,
    interval: float | None = None,
    particles: bool = False,
    times: int = 1,
) -> tuple[Signals, float, float]:
    """Signals of a wave run in a prepared folder, its processor time (s) and memory (MB).

    fraction of the time-step limit; amplitude A, m; duration and recording interval, s. The time
    includes YADE's start and the building of the scene; it is the median of `times` runs, of one
    if that is long.
    """
    table = f"case mu_wave input_frequency\n2 0.1 {INPUT_FREQUENCY:g}\n"
    settings = {"WAVE_FRACTION": fraction, "WAVE_AMPLITUDE": amplitude}
    optional = {"WAVE_DURATION": duration, "WAVE_INTERVAL": interval}
    settings |= {name: value for name, value in optional.items() if value is not None}
    written = folder / "case02.signals.h5"
    environment = {name: repr(float(value)) for name, value in settings.items()}
    environment["WAVE_PARTICLES"] = str(int(particles))

    def once() -> tuple[float, float]:
        written.unlink(missing_ok=True)
        return run_script("wave", table, folder, **environment)[1:]

    seconds, peak = median_of(times, once)
    return read_signals(written), seconds, peak


def wave_start(folder: Path, times: int) -> float:
    """Processor time, s, of a wave run of a single interval: what a start costs."""
    return wave(folder, fraction=0.5, amplitude=2.5e-9, duration=1.1e-5, times=times)[1]
