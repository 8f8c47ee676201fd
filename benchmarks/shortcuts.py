"""What skipping saves: each short cut on and off, the seconds it saves and the error it makes."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import eigh

from analysis.exact_chain import Chain
from benchmarks import diagram, yade_job
from benchmarks.measure import Measured, measured
from benchmarks.report import Finding
from modal import gallery
from modal.eigenproblem import Eigenproblem, frequency_of
from modal.intervals import lowest_modes
from modal.lattice import FccCrystal
from modal.modes import all_modes, highest_modes
from modal.network import read_network, write_network
from modal.random_packing import random_network
from modal.sample import Sample, read_sample, write_sample
from modal.wave import propagate

TITLE = "What skipping saves: seconds saved, error made"
STRESS = 1e5
SIZES = {
    True: {"layers": 12, "spheres": 250, "long": 40, "steps": 100, "compressed": 10},
    False: {"layers": 40, "spheres": 600, "long": 200, "steps": 400, "compressed": 40},
}
"""Layers of the crystal whose modes are found, spheres of the random packing, layers of the crystal
that carries the wave, YADE steps, layers of the crystal that is compressed."""
LOWEST = 20
DURATION_PER_LAYER = 2e-6
APART = 1.0005
"""Spacing of the crystal that is compressed, over the diameter."""


def spectrum(path: str, how: str, translations_only: bool = False) -> Callable[[], list[float]]:
    """Task: frequencies, Hz; how = symmetry, dense, lowest, highest."""
    network = read_network(path)

    def action() -> list[float]:
        problem = Eigenproblem.of(network, translations_only=translations_only)
        if how == "dense":
            return frequency_of(eigh(problem.scaled.toarray())[0]).tolist()
        if how == "symmetry":
            modes = all_modes(problem)
        elif how == "lowest":
            modes = lowest_modes(problem, LOWEST)
        else:
            modes = highest_modes(problem, 1, certify=False)
        return modes.frequency.tolist()

    return action


def planar(path: str, translations_only: bool) -> Callable[[], list[float]]:
    """Task: all modes of a crystal by symmetry; its P resonances, Hz."""
    network = read_network(path)

    def action() -> list[float]:
        problem = Eigenproblem.of(network, translations_only=translations_only)
        return all_modes(problem).resonance_frequency.tolist()

    return action


def recorded(path: str, duration: float, particles: bool, output: str) -> Callable[[], None]:
    """Task: a linear wave with the chain's rows only, or with those of every particle."""
    network = read_network(path)
    propagate(network, 1e-5, interval=1e-6)  # compiles the loop

    def action() -> None:
        np.save(
            output, propagate(network, duration, particles=particles).signals.chain_displacement
        )

    return action


def line(
    what: str, system: str, without: Measured, with_: Measured, error: float, of: str
) -> dict[str, Any]:
    """One row: `without` the short cut and `with_` it."""
    return {
        "short cut": what,
        "system": system,
        "seconds_without": without.seconds,
        "seconds_with": with_.seconds,
        "times_faster": without.seconds / with_.seconds,
        "mb_without": without.peak_mb,
        "mb_with": with_.peak_mb,
        "error": error,
        "error_of": of,
    }


def relative(a: Any, b: Any) -> float:
    """Largest difference over the largest value."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    return float(abs(a - b).max() / abs(b).max())


def modes_rows(folder: Path, size: dict[str, int], times: int) -> list[dict[str, Any]]:
    """Symmetry, translations only, and the wanted part of the spectrum."""
    crystal, packing = folder / "crystal.network.h5", folder / "packing.network.h5"
    write_network(crystal, gallery.fcc(4, size["layers"]))
    network = random_network(size["spheres"], STRESS, seed=1, aspect=5.0)
    write_network(packing, network)
    floppy = Eigenproblem.of(network).floppy.total

    def cost(task: str, path: Path, **arguments: Any) -> Measured:
        often = 1 if arguments.get("how") == "dense" else times
        return measured(f"benchmarks.shortcuts:{task}", times=often, path=str(path), **arguments)

    fcc = f"FCC 4 x 4 x {size['layers']}"
    random = f"random, {size['spheres']} spheres"
    dense = cost("spectrum", crystal, how="dense")
    blocks = cost("spectrum", crystal, how="symmetry")
    rows = [
        line(
            "lateral symmetry",
            fcc + ", all modes",
            dense,
            blocks,
            relative(blocks.value, dense.value),
            "frequencies over the highest",
        )
    ]
    full = cost("planar", crystal, translations_only=False)
    half = cost("planar", crystal, translations_only=True)
    error = relative(half.value, full.value)
    rows.append(line("no rotations", fcc + ", P resonances", full, half, error, "P resonances"))
    whole = cost("spectrum", packing, how="dense")
    low = cost("spectrum", packing, how="lowest")
    elastic = np.array(whole.value)[floppy : floppy + LOWEST]
    rows.append(
        line(
            f"lowest {LOWEST} modes only",
            random,
            whole,
            low,
            float(abs(np.array(low.value) / elastic - 1).max()),
            "frequencies",
        )
    )
    high = cost("spectrum", packing, how="highest")
    error = abs(high.value[-1] / whole.value[-1] - 1)
    rows.append(line("highest mode only", random, whole, high, error, "frequency"))
    still = cost("spectrum", packing, how="lowest", translations_only=True)
    error = float(abs(np.array(still.value) / np.array(low.value) - 1).max())
    rows.append(
        line(
            "no rotations (wrong here)", random + ", lowest modes", low, still, error, "frequencies"
        )
    )
    return rows


def record_rows(folder: Path, size: dict[str, int], times: int) -> list[dict[str, Any]]:
    """Recorded rows only, in the linear wave and in YADE."""
    layers = size["long"]
    network = yade_job.in_yades_order(gallery.fcc(3, layers))
    path, duration = folder / "long.network.h5", DURATION_PER_LAYER * layers
    write_network(path, network)
    runs, found = {}, {}
    for particles in (True, False):
        output = folder / f"chain{particles}.npy"
        runs[particles] = measured(
            "benchmarks.shortcuts:recorded",
            times=times,
            path=str(path),
            duration=duration,
            particles=particles,
            output=str(output),
        )
        found[particles] = np.load(output)
    system = f"FCC 3 x 3 x {layers}"
    error = relative(found[False], found[True])
    rows = [
        line("recorded rows only", system + ", linear", runs[True], runs[False], error, "signals")
    ]
    if yade_job.available():
        yade_job.prepare_wave(network, folder)
        for particles in (True, False):
            signals, seconds, peak = yade_job.wave(
                folder,
                fraction=0.2,
                amplitude=2.5e-9,
                duration=duration,
                particles=particles,
                times=times,
            )
            runs[particles] = Measured(None, seconds, peak)
            found[particles] = signals.chain_displacement
        error = relative(found[False], found[True])
        rows.append(
            line("recorded rows only", system + ", YADE", runs[True], runs[False], error, "signals")
        )
    return rows


def step_rows(folder: Path, size: dict[str, int], times: int) -> list[dict[str, Any]]:
    """Lazy and sleeping collider, and blocked rotations, in YADE's steps."""
    network = gallery.fcc(3, size["long"])
    sample = Sample(network.position, network.cell_size[:2], network.wall_position, friction=0.1)
    path = folder / "steps.sample.h5"
    write_sample(path, sample)
    runs, moved = [], []
    system = f"FCC 3 x 3 x {size['long']}, a YADE step"
    for collider, rotations in (
        ("every step", True),
        ("when needed", True),
        ("asleep", True),
        ("asleep", False),
    ):
        output = folder / "moved.npy"
        each = [
            yade_job.measured(
                "steps",
                folder,
                sample=str(path),
                kind="wave",
                stress=STRESS,
                steps=size["steps"],
                collider=collider,
                rotations=rotations,
                output=str(output),
            )
            for _ in range(times)
        ]
        seconds = statistics.median(run.seconds for run in each)
        runs.append(Measured(None, seconds, each[0].peak_mb))
        moved.append(np.load(output) - sample.position)
    names = ("collider sorts when needed", "collider asleep", "no rotations")
    return [
        line(name, system, runs[k], runs[k + 1], relative(moved[k + 1], moved[k]), "displacements")
        for k, name in enumerate(names)
    ]


def lattice_row(folder: Path, layers: int) -> dict[str, Any]:
    """A crystal placed in balance against one that YADE compresses to the stress."""
    table = f"case mu_comp mu_wave stress input_frequency width layers\n2 0 0.1 {STRESS:g} 1e5 3 "
    _, seconds, peak = yade_job.run_script("sample_fcc", table + f"{layers}\n", folder)
    placed = Measured(None, seconds, peak)
    network = gallery.fcc(3, layers)
    stretch = APART * 2 * network.radius[0] / FccCrystal(STRESS).spacing
    apart = Sample(
        stretch * network.position,
        stretch * network.cell_size[:2],
        stretch * network.wall_position,
        friction=0.1,
    )
    write_sample(folder / "apart.sample.h5", apart)
    compressed = yade_job.measured(
        "compress",
        folder,
        whole=True,
        sample=str(folder / "apart.sample.h5"),
        output=str(folder / "compressed.sample.h5"),
        stress=STRESS,
        inertial_number=0.003,
        steps=3000,
    )
    after = Chain.of_network(read_sample(folder / "compressed.sample.h5").network())
    made = read_network(folder / "case02.network.h5")
    right = Chain.of_network(made).low_pass_frequency
    theory = FccCrystal(STRESS).low_pass_frequency
    return line(
        "lattice placed, not compressed",
        f"FCC 3 x 3 x {layers}, YADE",
        compressed,
        placed,
        abs(right / theory - 1),
        f"f_low-pass (compressed: {abs(after.low_pass_frequency / theory - 1):.1e})",
    )


def run(quick: bool, folder: Path) -> Finding:
    """Every short cut."""
    size, times = SIZES[quick], 1 if quick else 3
    rows = modes_rows(folder, size, times) + record_rows(folder, size, times)
    if yade_job.available():
        rows += step_rows(folder, size, times)
        rows.append(lattice_row(folder, size["compressed"]))
    task = (
        "The same task with and without each short cut; the error is that of the result with the "
        "short cut, relative to the one without. The collider asleep is compared with one that "
        "sorts when needed, that one with one that sorts in every step."
    )
    return Finding(TITLE, task, rows, notes(rows), {"shortcuts": draw(rows)})


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Seconds without and with each short cut, and the error beside them."""
    figure, axes = diagram.panels(1, 1, width=7.2, height=0.34 * len(rows) + 0.5)
    ax = axes[0, 0]
    for k, row in enumerate(rows):
        pair = [row["seconds_with"], row["seconds_without"]]
        ax.plot(pair, [k, k], "-", color="0.6", lw=1.5)
        first = k == 0
        ax.plot(pair[1], k, "o", mfc="white", mec="k", label="without" if first else None)
        ax.plot(pair[0], k, "ks", label="with the short cut" if first else None)
        text = f"error {row['error']:.0e}" if row["error"] else "error 0"
        ax.text(1.02, k, text, transform=ax.get_yaxis_transform(), va="center", fontsize=8)
    names = [f"{row['short cut']}\n{row['system']}" for row in rows]
    ax.set_yticks(range(len(rows)), names, fontsize=7)
    ax.set(xscale="log", xlabel="processor time (s)", ylim=(len(rows) - 0.5, -0.5))
    ax.legend(fontsize=8, loc="lower left")
    return figure


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """The largest saving, and the short cut that is wrong."""
    free = [row for row in rows if row["error"] < 1e-6]
    best = max(free, key=lambda row: row["times_faster"])
    said = [
        f"{best['short cut']} ({best['system']}) saves most of those without an error that "
        f"matters: {best['times_faster']:.3g} times faster, error {best['error']:.0e}."
    ]
    for row in rows:
        if row["error"] > 1e-3:
            said.append(
                f"{row['short cut']}, {row['system']}: error {row['error']:.1g}. Not a short cut "
                "but another system: there the spheres do turn."
            )
        if row["times_faster"] < 1.05:
            said.append(
                f"{row['short cut']}, {row['system']}: saves nothing "
                f"({row['times_faster']:.2g} times)."
            )
    return said
