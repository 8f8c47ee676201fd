"""A random packing with friction in YADE against the linear wave of its contacts.

    python -m benchmarks.agreement [--quick] [--folder DIR]

Makes a packing of 2,400 spheres (--quick: 300) with friction 0.4 at 100 kPa by the scripts of the
study, brings it to rest with friction 0.5, and sends waves through it: 5 nm and 0.05 nm, each with
the wall's motion as it is and reversed, and 5 nm with sliding suppressed. Prints the difference by
cause and the contacts that have opened or slipped. With --folder the files stay there, and what is
finished is not made again.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from analysis.agreement import Agreement, Difference, as_table, split_by_cause
from benchmarks.measure import ROOT
from benchmarks.yade_job import run_script
from modal.network import read_network
from modal.signals import Signals, read_signals
from modal.storage import InputError

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


def modal(*arguments: str | Path) -> None:
    """Run one command of modal quietly; InputError with what it says if it fails."""
    command = [sys.executable, "-m", "modal", *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        raise InputError(f"modal {arguments[0]} failed: {done.stderr.strip()}")


def make_sample(folder: Path, spheres: int, width: float) -> None:
    """caseNN.network.h5 and the highest mode of case 30, a packing at rest."""
    chain = f"mu_comp spheres width seed highest\n0.4 {spheres} {width} 1 1e5\n"
    case = "case mu_comp mu_wave stress\n30 0.4 0.5 1e5\n"
    state, sample = folder / "chain_mu0.4" / "100000Pa.sample.h5", folder / "case30.sample.h5"
    network = folder / "case30.network.h5"
    if not network.exists():
        run_script("chain", chain, folder)
        modal("relax", state, "--friction", 0.5, "-o", sample)
        run_script("export_random", case, folder)
    highest = folder / "case30.highest.modes.h5"
    modal("modes", network, "--highest", 1, "-o", highest)


def wave(folder: Path, name: str, duration: float) -> tuple[Signals, str]:
    """Signals of one of `RUNS`, and what its log says of the contacts."""
    amplitude, friction = RUNS[name]
    table = f"case mu_wave input_frequency fraction\n30 {friction} 1e5 {FRACTION}\n"
    written, kept = folder / "case30.signals.h5", folder / f"{name}.signals.h5"
    if not kept.exists():
        settings = {
            "WAVE_AMPLITUDE": str(amplitude),
            "WAVE_DURATION": str(duration),
            "WAVE_PARTICLES": "1",
        }
        log, _, _ = run_script("wave", table, folder, **settings)
        written.rename(kept)
        (folder / f"{name}.log").write_text(log)
    lines = (folder / f"{name}.log").read_text().splitlines()
    contacts = next((line.split(": ", 1)[1] for line in lines if " contacts " in line), "")
    return read_signals(kept), contacts


def agreement(folder: Path, quick: bool) -> tuple[list[Difference], dict[str, str]]:
    """Differences by cause, and the contacts of each run."""
    make_sample(folder, *((300, 4.2) if quick else (2400, 8.0)))
    network = read_network(folder / "case30.network.h5")
    found = {name: wave(folder, name, 1e-4 if quick else 2e-4) for name in RUNS}
    signals = {name: record for name, (record, _) in found.items()}
    rows = split_by_cause(Agreement(network, signals.pop("run")), **signals)
    return rows, {name: contacts for name, (_, contacts) in found.items()}


def run(quick: bool = False) -> list[dict[str, Any]]:
    """Rows of the table by cause."""
    with tempfile.TemporaryDirectory() as name:
        rows, _ = agreement(Path(name), quick)
    return [vars(row) for row in rows]


def main(argv: list[str] | None = None) -> int:
    """Print the table and the contacts; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a packing of 300 spheres")
    parser.add_argument("--folder", metavar="DIR", help="keep the files there")
    options = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(options.folder or name).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        rows, contacts = agreement(folder, options.quick)
    print(as_table(rows))
    print("\n| run | amplitude, m | friction | contacts |\n|---|---|---|---|")
    for name, text in contacts.items():
        print(f"| {name} | {RUNS[name][0]:g} | {RUNS[name][1]:g} | {text} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
