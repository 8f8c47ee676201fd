"""The same wave by linear propagation, by YADE and by LAMMPS: run time at the same error.

    python -m benchmarks.wave [--quick] [--network FILE]

The scene is the FCC crystal of case 2 (4 x 4 x 200 spheres; --quick: 4 x 4 x 40). YADE and LAMMPS
run with the same time step; its error is that of a linear leapfrog with this step against the exact
linear wave, relative L2 over the chain and all times. What they are apart from the exact linear
wave besides is their non-linear contact law. A program that is not installed is left
out. With --network the linear wave of that sample is timed too, over 0.6 ms, and repeated sideways
to a million spheres.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from modal import gallery
from modal.chain import wall_to_wall_chain
from modal.eigenproblem import Eigenproblem
from modal.hertz_mindlin import GLASS
from modal.leapfrog import leapfrog
from modal.mode_set import write_modes
from modal.modes import highest_modes
from modal.network import Network, read_network
from modal.signals import Signals, read_signals
from modal.source import AMPLITUDE, INPUT_FREQUENCY
from modal.wave import propagate

ROOT = Path(__file__).resolve().parents[1]
LAMMPS_SCRIPT = ROOT / "benchmarks" / "lammps" / "fcc_wave.in"
FRACTIONS = (0.05, 0.02)
"""Time steps over the limit 2 / omega_max: the default of the YADE wave run, and a finer one."""
MILLION = 1_000_000


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """Relative L2 difference of a from b at the times that both have."""
    count = min(len(a), len(b))
    a, b = a[:count], b[:count]
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def run_yade(folder: Path, layers: int, duration: float, fraction: float) -> Signals | None:
    """Signals of YADE's own run of the scene, by the scripts of the study; None without YADE."""
    if shutil.which("yade-batch") is None:
        return None
    table = folder / "scene.table"
    table.write_text(
        "case mu_comp mu_wave stress input_frequency width layers\n"
        f"2 0 0.1 1e5 {INPUT_FREQUENCY:g} 4 {layers}\n"
    )
    environment = os.environ | {
        "WAVE_PRODUCTS": str(folder),
        "WAVE_FRACTION": str(fraction),
        "WAVE_DURATION": str(duration),
    }
    for script in ("sample_fcc", "wave"):
        subprocess.run(
            ["yade-batch", "-j", "1", "--job-threads", "1", "--log", str(folder / f"{script}.log")]
            + [str(table), str(ROOT / "yade_scripts" / f"{script}.py")],
            env=environment,
            cwd=folder,
            check=True,
            capture_output=True,
        )
        if script == "sample_fcc":
            problem = Eigenproblem.of(read_network(folder / "case02.network.h5"))
            write_modes(folder / "case02.highest.modes.h5", highest_modes(problem, 1))
    return read_signals(folder / "case02.signals.h5")


def run_lammps(
    folder: Path, network: Network, time_step: float, duration: float, every: int
) -> tuple[np.ndarray, float] | None:
    """Chain displacements (nt, nc) and seconds of LAMMPS' own loops; None without LAMMPS."""
    program = shutil.which("lmp")
    if program is None:
        return None
    radius, cell = float(network.radius[0]), network.cell_size
    low, high = (float(z) for z in network.wall_position)
    bounds = zip("xyz", (0.0, 0.0, low - radius), (cell[0], cell[1], high + radius), strict=True)
    lines = ["FCC crystal", "", f"{network.n_particles} atoms", "1 atom types", ""]
    lines += [f"{float(a)!r} {float(b)!r} {axis}lo {axis}hi" for axis, a, b in bounds]
    lines += ["", "Atoms # sphere", ""]
    for k, (x, y, z) in enumerate(network.position.tolist()):
        lines.append(f"{k + 1} 1 {2 * radius!r} {GLASS.density!r} {x!r} {y!r} {z!r}")
    (folder / "scene.data").write_text("\n".join(lines) + "\n")
    chain = wall_to_wall_chain(network)
    pulse = round(1 / (INPUT_FREQUENCY * time_step))
    variables = {
        "data": "scene.data",
        "young": GLASS.young,
        "poisson": GLASS.poisson,
        "friction": 0.1,
        "low": low,
        "high": high,
        "amplitude": AMPLITUDE,
        "period": 1 / INPUT_FREQUENCY,
        "step": time_step,
        "pulse": pulse,
        "rest": round(duration / time_step) - pulse,
        "every": every,
        "records": "scene.dump",
        "chain": " ".join(str(k + 1) for k in chain),
    }
    command = [program, "-in", str(LAMMPS_SCRIPT), "-log", "scene.log", "-screen", "none"]
    for name, value in variables.items():
        command += ["-var", name, value if isinstance(value, str) else repr(value)]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    log = (folder / "scene.log").read_text().splitlines()
    seconds = sum(float(line.split()[3]) for line in log if line.startswith("Loop time"))
    z = []
    for block in (folder / "scene.dump").read_text().split("ITEM: TIMESTEP\n")[1:]:
        rows = np.array([line.split() for line in block.splitlines()[8:]], float)
        z.append(rows[:, 1])
    order = np.argsort(np.argsort(chain))  # dumped in the order of the ids
    return (np.array(z) - z[0])[:, order], seconds


def crystal_rows(layers: int, duration: float, fraction: float) -> list[dict[str, Any]]:
    """Linear, YADE and LAMMPS on one crystal with one time step."""
    network = gallery.fcc(4, layers)
    highest = highest_modes(Eigenproblem.of(network), 1).frequency[-1]
    # A step that divides the period of the pulse: LAMMPS changes its wall fix between two steps.
    steps = math.ceil(math.pi * highest / (fraction * INPUT_FREQUENCY))
    time_step, every = 1 / (INPUT_FREQUENCY * steps), max(1, steps // 20)
    interval = time_step * every
    propagate(network, 1e-5, interval=1e-6)  # compiles the loop before anything is timed
    timed = [propagate(network, duration, interval=interval).signals for _ in range(3)]
    linear = min(timed, key=lambda signals: signals.run_time)
    exact = propagate(network, duration, interval=interval, tolerance=1e-13).signals
    reference = exact.chain_displacement
    same_step = leapfrog(network, duration, time_step, every=every)
    step_error = relative(same_step.chain_displacement, reference)
    rows = []

    def add(program: str, seconds: float, error: float, to_linear: float | None = None) -> None:
        rows.append(
            {
                "program": program,
                "spheres": network.n_particles,
                "duration_ms": 1e3 * duration,
                "time_step_us": None if program.endswith("Chebyshev") else 1e6 * time_step,
                "error_in_time": error,
                "apart_from_linear": to_linear,
                "seconds": seconds,
                "times_linear": seconds / linear.run_time,
            }
        )

    error = relative(linear.chain_displacement, reference)
    add("linear, Chebyshev", linear.run_time, error)
    add("linear, leapfrog", same_step.run_time, step_error)
    with tempfile.TemporaryDirectory() as name:
        yade = run_yade(Path(name), layers, duration, fraction)
        if yade is not None:
            twin = propagate(network, duration, interval=float(yade.time[1])).signals
            # Every chain of the crystal carries the same wave, layer by layer.
            have = yade.chain_displacement[:, np.argsort(yade.chain_position)]
            want = twin.chain_displacement[:, np.argsort(twin.chain_position)]
            add("YADE, one core", yade.run_time, step_error, relative(have, want))
        lammps = run_lammps(Path(name), network, time_step, duration, every)
        if lammps is not None:
            motion, seconds = lammps
            count = min(len(motion), len(reference))
            add(
                "LAMMPS, one core", seconds, step_error, relative(motion[:count], reference[:count])
            )
    return rows


def sample_rows(path: str) -> list[dict[str, Any]]:
    """The linear wave of a sample over 0.6 ms, as it is and repeated to a million spheres."""
    rows = []
    sample = read_network(path)
    for times in (1, math.ceil(math.sqrt(MILLION / sample.n_particles))):
        network = gallery.repeat(sample, times, times)
        start = time.perf_counter()
        wave = propagate(network, 6e-4, tolerance=1e-8)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        rows.append(
            {
                "spheres": network.n_particles,
                "contacts": network.n_contacts,
                "duration_ms": 0.6,
                "products": wave.products,
                "seconds": time.perf_counter() - start,
                "peak_gb": peak * (1 if sys.platform == "darwin" else 1024) / 1e9,
            }
        )
    return rows


def run(quick: bool = False) -> list[dict[str, Any]]:
    """Rows of the crystal's table, for each time step."""
    if quick:
        return crystal_rows(40, 8e-5, FRACTIONS[0])
    return [row for fraction in FRACTIONS for row in crystal_rows(200, 3.7e-4, fraction)]


def table(rows: list[dict[str, Any]]) -> str:
    """Rows as a Markdown table; the columns are the keys of the first."""
    names = list(rows[0])
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    for values in rows:
        cells = [values[name] for name in names]
        shown = ["" if v is None else f"{v:.3g}" if isinstance(v, float) else str(v) for v in cells]
        lines.append("| " + " | ".join(shown) + " |")
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Print the tables; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a crystal of 640 spheres")
    parser.add_argument("--network", metavar="FILE", help="time the linear wave of this sample")
    options = parser.parse_args(argv)
    print(table(run(options.quick)))
    if options.network:
        print("\n" + table(sample_rows(options.network)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
