"""
Do the contact forces change the soft modes?
============================================

The modes of `soft_modes.py` are those of springs at rest. Here packings of the same kind are made
again, and their modes below the first wave computed twice: without the contact forces, and with
their terms of the normal forces.

`python examples/soft_modes_forces.py FOLDER` makes twelve packings of 1,000 spheres in FOLDER, a
minute each, and goes on where it was. It writes `results/soft_modes/forces.csv`, which has all
modes, and `forces.md`.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from _committed import PEAK_SLOPE, RESULTS, write_page

import modal
from analysis.packing_data import PackingData
from analysis.quantities.soft_modes import lowest_wave
from modal.packing.rattlers import force_bearing
from modal.packing.state import contacts_per_particle

HOME = RESULTS / "soft_modes"
FRICTIONS = (0.2, 0.4, 1.0)
SEEDS = range(1, 5)
STRESS = 1e5
WIDTH = 9.556
"""Diameters: a cube of 1,000 spheres at the nominal density, as in `studies/soft_modes.yaml`."""
MARGIN = 1.1
"""Modes are computed up to the first wave times this, so that one that falls with the forces, or
rises, is seen in both lists."""
TERMS = ("none", "normal")
"""What the contact forces add to the stiffness."""
RANGE = (0.1, 0.5)
"""Range of f / f* in which the modes are compared."""


def run(*words):
    """Run a command of this project."""
    subprocess.run([sys.executable, "-m", *map(str, words)], check=True, capture_output=True)


def make_packing(folder, friction, seed):
    """Make a packing at rest with the friction of a wave, 0.1 more, and return its file."""
    states = folder / f"friction{friction:g}_seed{seed}"
    sample = folder / f"friction{friction:g}_seed{seed}.sample.h5"
    shape = ["--periodic", "--spheres", 1000, "--width", WIDTH, "--seed", seed]
    run("modal", "pack", "--friction", friction, *shape, "--stress", STRESS, "-o", states)
    (state,) = states.glob("*.sample.h5")
    wave_friction = friction + 0.1
    run("modal", "relax", state, "--friction", wave_friction, "--stress", STRESS, "-o", sample)
    return sample


def measure_modes(path, friction, seed):
    """Return rows of the soft modes of a packing, with and without the contact forces."""
    network = modal.read(path)
    bearing = force_bearing(network)
    contacts = contacts_per_particle(network)
    wave = lowest_wave(PackingData(network)).frequency
    (f_max,) = modal.eigenmodes(network, highest=1, shapes=False).frequency
    rows = []
    for pre_stress in TERMS:
        modes = modal.eigenmodes(network, below=MARGIN * wave, pre_stress=pre_stress)
        square = (modes.mode_shape[:, :, :3] ** 2).sum(axis=2)
        for frequency, mover in zip(modes.frequency, square.argmax(axis=1), strict=True):
            rows.append(
                {
                    "friction": friction,
                    "seed": seed,
                    "z": contacts[bearing].mean(),
                    "f_max_hz": f_max,
                    "first_wave_hz": wave,
                    "forces": pre_stress,
                    "unstable": modes.unstable_modes,
                    "frequency_hz": frequency,
                    "contacts": contacts[mover],
                }
            )
    return pd.DataFrame(rows)


def gather(folder):
    """Make what is missing, and return the table of all modes."""
    folder.mkdir(parents=True, exist_ok=True)
    tables = []
    for seed in SEEDS:
        for friction in FRICTIONS:
            table = folder / f"friction{friction:g}_seed{seed}.csv"
            if not table.exists():
                rows = measure_modes(make_packing(folder, friction, seed), friction, seed)
                rows.to_csv(table, index=False, float_format="%.7g")
            tables.append(pd.read_csv(table))
    return pd.concat(tables, ignore_index=True)


def compare(modes):
    """Return a row for each friction: how the forces change the modes from 0.1 to 0.5 f*.

    The k-th mode without forces is compared with the k-th one with them. A slope of the change
    against ln f changes the power of D(f) by about as much with the opposite sign.
    """
    rows = []
    for friction, some in modes.groupby("friction"):
        f_star = PEAK_SLOPE * (some["z"].mean() - 4) * some["f_max_hz"].mean()
        pairs = []
        for _, of_packing in some.groupby("seed"):
            lists = [
                np.sort(of_packing.loc[of_packing["forces"] == term, "frequency_hz"])
                for term in TERMS
            ]
            count = min(map(len, lists))
            pairs.append(np.array([frequencies[:count] for frequencies in lists]))
        without, with_forces = np.hstack(pairs)
        inside = (without > RANGE[0] * f_star) & (without < RANGE[1] * f_star)
        change = np.log(with_forces / without)
        row = {"friction": friction, "z": some["z"].mean(), "packings": len(pairs)}
        row |= {"modes": inside.sum(), "modes_below_first_wave": len(without)}
        row |= {"change": np.mean(change[inside]), "scatter": np.std(change[inside])}
        row["change_of_all"] = np.mean(change)
        row["slope"] = np.polyfit(np.log(without), change, 1)[0]
        row["unstable"] = some.groupby("seed")["unstable"].max().mean()
        rows.append(row)
    return pd.DataFrame(rows)


if __name__ == "__main__" and len(sys.argv) == 2:
    gather(Path(sys.argv[1])).to_csv(HOME / "forces.csv", index=False, float_format="%.7g")

compared = compare(pd.read_csv(HOME / "forces.csv"))
print(compared.to_string(index=False, float_format="%.4g"))

if __name__ == "__main__" and len(sys.argv) == 2:
    page = {"z": "{z:.2f}", "friction": "{friction:g}", "packings": "{packings}"}
    page |= {"modes, 0.1 to 0.5 f*": "{modes}", "change, %": "{change_percent:.2f}"}
    page |= {"scatter, %": "{scatter_percent:.2f}", "slope of the change": "{slope:.4f}"}
    page["motions that release energy, a packing"] = "{unstable:.1f}"
    percent = {f"{name}_percent": 100 * compared[name] for name in ("change", "scatter")}
    write_page(HOME / "forces.md", compared.assign(**percent), page)
