"""A random packing with friction in YADE against the linear wave of its contacts.

Makes a packing of 2,400 spheres (--quick: 300) with friction 0.4 at 100 kPa by the scripts of the
study, brings it to rest with friction 0.5, and sends waves through it: 5 nm and 0.05 nm, each with
the wall's motion as it is and reversed, and 5 nm with sliding suppressed. Gives the difference by
cause and the contacts that have opened or slipped.
"""

from __future__ import annotations

from pathlib import Path

from analysis.agreement import Agreement, split_by_cause
from benchmarks import yade_job
from benchmarks.modes import modal
from benchmarks.report import Finding
from modal.network import read_network
from modal.signals import Signals, read_signals
from modal.storage import InputError

TITLE = "YADE against the linear wave, random packing with friction"
SIZE = {True: (300, 4.2, 1e-4), False: (2400, 8.0, 2e-4)}
"""Spheres, width in diameters, duration, s."""
NO_SLIP = 10.0
"""Coefficient of friction that suppresses sliding."""
FRACTION = 0.1
"""Time step over its limit; the linear wave takes the same, so the choice does not matter."""
AMPLITUDE, SMALL = 2.5e-9, 2.5e-11
RUNS = {
    "run": (AMPLITUDE, 0.5),
    "reverse": (-AMPLITUDE, 0.5),
    "small": (SMALL, NO_SLIP),
    "small_reverse": (-SMALL, NO_SLIP),
    "no_slip": (AMPLITUDE, NO_SLIP),
}
"""Amplitude, m, and friction of each run, named as in `analysis.agreement`."""


def make_sample(folder: Path, spheres: int, width: float) -> None:
    """caseNN.network.h5 and the highest mode of case 30, a packing at rest."""
    chain = f"mu_comp spheres width seed highest\n0.4 {spheres} {width} 1 1e5\n"
    case = "case mu_comp mu_wave stress\n30 0.4 0.5 1e5\n"
    state, sample = folder / "chain_mu0.4" / "100000Pa.sample.h5", folder / "case30.sample.h5"
    yade_job.run_script("chain", chain, folder)
    modal("relax", state, "--friction", 0.5, "-o", sample)
    yade_job.run_script("export_random", case, folder)
    network, highest = folder / "case30.network.h5", folder / "case30.highest.modes.h5"
    modal("modes", network, "--highest", 1, "--uncertified", "-o", highest)


def wave(folder: Path, name: str, duration: float) -> tuple[Signals, str]:
    """Signals of one of `RUNS`, and what its log says of the contacts."""
    amplitude, friction = RUNS[name]
    table = f"case mu_wave input_frequency fraction\n30 {friction} 1e5 {FRACTION}\n"
    settings = {
        "WAVE_AMPLITUDE": str(amplitude),
        "WAVE_DURATION": str(duration),
        "WAVE_PARTICLES": "1",
    }
    written = folder / "case30.signals.h5"
    written.unlink(missing_ok=True)
    log, _, _ = yade_job.run_script("wave", table, folder, **settings)
    said = next((line for line in log.splitlines() if " contacts " in line), ": ")
    return read_signals(written), said.split(": ", 1)[1]


def run(quick: bool, folder: Path) -> Finding:
    """Differences by cause, and the contacts of each run."""
    if not yade_job.available():
        raise InputError("YADE is not installed; apt-get install yade")
    spheres, width, duration = SIZE[quick]
    make_sample(folder, spheres, width)
    network = read_network(folder / "case30.network.h5")
    found = {name: wave(folder, name, duration) for name in RUNS}
    signals = {name: record for name, (record, _) in found.items()}
    causes = split_by_cause(Agreement(network, signals.pop("run")), **signals)
    task = (
        f"{spheres} spheres, compressed with friction 0.4 to 100 kPa and brought to rest with 0.5; "
        f"pulse of 100 kHz and 2A = 5 nm, {1e3 * duration:g} ms. Relative L2 norms over all times, "
        "of the chain, the layers' means and all spheres, and of the median sphere."
    )
    notes = [
        f"{name} (A = {1e9 * RUNS[name][0]:g} nm, friction {RUNS[name][1]:g}): {contacts}."
        for name, (_, contacts) in found.items()
    ]
    return Finding(TITLE, task, [vars(row) for row in causes], notes)
