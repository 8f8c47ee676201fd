"""
Two transducers in packings
===========================

How far are velocities read from travel times from those of the elastic moduli? By rule, distance,
wavelength, radius of the discs and stress, for P- and S-waves, in packings of two frictions.

`python examples/transducers.py FOLDER` writes the figure and the tables into a folder. It reads
`bias.csv` in `results/transducers`; `python examples/transducers.py FOLDER measure` first makes
this table from the committed samples, place by place, and leaves out what the table has already.
`measure PACKINGS` does so with the packings in further folders, `PACKINGS/MU_SEED`, with friction
and seed in the place of MU and SEED, as `python -m modal pack` writes them.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _committed import RESULTS, write, write_page
from _cut import segment

import modal
from analysis.bench import modulus_velocities
from analysis.estimators.arrival_rules import MIN_WAVELENGTHS, RULES, RecordPair, travel_time
from analysis.transducer_pair import MAX_REFLECTION_DELAY_IN_PERIODS
from modal.motions import SineBurst
from modal.sources import Disc
from modal.waves.propagate import propagate_motions

TABLE = RESULTS / "transducers/bias.csv"
# The committed samples with their friction and stress in Pa
SAMPLES = {
    "case06": (0.0, 1e5),
    "case07": (0.0, 1e6),
    "case05": (0.0, 1e4),
    "case08": (0.0, 1e7),
    "case30": (0.4, 1e5),
    "case31": (0.4, 1e6),
    "case29": (0.4, 1e4),
    "case32": (0.4, 1e7),
}
PLACES = (20, 62, 104)  # D, of the source above the lower wall, in these packings 143 D long
MARGIN = 10  # D, of the packing below the source and above the last receiver
DISTANCES = (6, 12, 18, 24)  # D, from the source to each receiver
RECEIVER_PAIRS = ((0, 2), (0, 3))  # numbers of receivers that are compared with each other
RADII = (1.5, 3, np.inf)  # D, of the discs; the last is a plane of all spheres at a height
MIN_WIDTH_OF_DISCS = 12  # D, of a packing with discs; narrower ones have planes alone
D_OVER_WAVELENGTH = (0.04, 0.08, 0.12, 0.16)  # with the velocity by the moduli
DIRECTIONS = ("x", "z")
PASSAGES = 1.5  # length of a record, in passages to the last receiver, besides the burst

WIDTHS = {0.0: 14.1, 0.4: 14.7}  # D, by friction, of the packings, which are periodic sideways

# %%
# **The test.** A disc of spheres moves by one period of a sine, discs above it receive: at three
# places of a long packing, which share no sphere, or in the middle of a shorter one. The wave runs
# through the spheres near a place alone; velocities of the moduli are those of the whole packing.


def measure(packing, velocities, place):
    """Yield the rows of all tests of a packing whose source is at a place."""
    diameter = 2 * float(packing.radius.mean())
    ends = np.array([place - MARGIN, place + DISTANCES[-1] + MARGIN]) * diameter
    spheres = segment(packing, *ends)
    radii = RADII
    if packing.cell_size[:2].min() < MIN_WIDTH_OF_DISCS * diameter:
        radii = [np.inf]
    for direction in DIRECTIONS:
        velocity = velocities[direction]
        for radius in radii:
            yield from test(spheres, direction, velocity, radius, place)


def test(packing, direction, velocity, radius, place):
    """Yield the rows of one source: a row for each pair of discs and each frequency."""
    diameter = 2 * float(packing.radius.mean())
    discs = []
    for distance in (0, *DISTANCES):
        centre = (*packing.cell_size[:2] / 2, (place + distance) * diameter)
        discs.append(Disc(centre, min(radius * diameter, packing.length), direction))
    bursts = [SineBurst(1e-9, each * velocity / diameter) for each in D_OVER_WAVELENGTH]
    waves = propagate_motions(
        packing,
        PASSAGES * DISTANCES[-1] * diameter / velocity + bursts[0].corners[-1],
        bursts,
        interval=1 / (40 * bursts[-1].frequency),
        source=discs[0],
        receivers=discs[1:],
    )
    tips = np.array([disc.position_in(packing) for disc in discs])
    pairs = [(None, number) for number in range(len(DISTANCES))]
    for first, second in (*pairs, *RECEIVER_PAIRS):
        start = tips[0 if first is None else first + 1]
        distance = float(np.linalg.norm(tips[second + 1] - start))
        for wave in waves:
            record = RecordPair.of(wave.signals, second, first)
            row = {"direction": direction, "velocity": velocity, "radius_over_d": radius}
            row["from"] = "source" if first is None else "receiver"
            row["distance_over_d"] = distance / diameter
            row["d_over_wavelength"] = record.frequency * diameter / velocity
            yield row | readings(record, distance / velocity)


def readings(record, exact):
    """Return velocity over that of the moduli, minus 1, and its error, by each rule."""
    row = {}
    for rule in RULES:
        time = travel_time(record, rule)
        row[rule] = exact / time.value - 1
        row[f"{rule}_error"] = exact * time.error / time.value**2
    return row


def committed_packings():
    """Yield key, file and places of the source, D, of each committed sample."""
    for case, (friction, stress) in SAMPLES.items():
        key = {"case": case, "seed": 1, "friction": friction, "stress_pa": stress}
        yield key, RESULTS / f"samples/{case}.sample.h5", PLACES


def further_packings(folder):
    """Yield key, file and place of the source of each packing in a folder, in its middle."""
    for path in sorted(Path(folder).glob("*_*/*Pa.sample.h5")):
        friction, seed = path.parent.name.split("_")
        key = {"case": path.parent.name, "seed": int(seed), "friction": float(friction)}
        key["stress_pa"] = float(path.name.removesuffix("Pa.sample.h5"))
        packing = modal.read(path)
        length = packing.length / (2 * float(packing.radius.mean()))
        yield key, path, (round((length - DISTANCES[-1]) / 2),)


def gather(packings):
    """Add all tests that are not in the table yet, and write the table after each place."""
    table = pd.read_csv(TABLE) if TABLE.exists() else pd.DataFrame(columns=["case", "stress_pa"])
    for key, path, places in packings:
        is_packing = (table["case"] == key["case"]) & (table["stress_pa"] == key["stress_pa"])
        measured = set(table.loc[is_packing, "place_over_d"]) if is_packing.any() else set()
        places = [place for place in places if place not in measured]
        if not places:
            continue
        packing = modal.read(path)
        velocities = dict(zip("zx", modulus_velocities(packing, "x"), strict=True))
        for place in places:
            place_key = key | {"place_over_d": place}
            rows = pd.DataFrame(place_key | row for row in measure(packing, velocities, place))
            table = pd.concat([table, rows]) if len(table) else rows
            table.to_csv(TABLE, index=False, float_format="%.3g")


if __name__ == "__main__" and len(sys.argv) == 3:
    gather(committed_packings())
if __name__ == "__main__" and len(sys.argv) == 4:
    gather(further_packings(sys.argv[3]))

# %%
# **What decides.** Waves by way of the sides, or from the images of a disc across the periods of
# the cell, make a detour: in wavelengths it is their delay in periods, and below a period
# `transducers` has a caveat. A plane has no sides, and no near field.

bias = pd.read_csv(TABLE)
bias = bias[bias["from"] == "source"]
distance = bias["distance_over_d"]
bias["wavelengths"] = distance * bias["d_over_wavelength"]
detour = np.hypot(distance, bias["friction"].map(WIDTHS)) - distance
bias["side_delay"] = detour * bias["d_over_wavelength"]
is_plane = np.isinf(bias["radius_over_d"])
is_late = bias["side_delay"] >= MAX_REFLECTION_DELAY_IN_PERIODS
GROUPS = {
    "planes": is_plane,
    "discs, sides a period later": is_late & ~is_plane,
    "discs, sides earlier": ~is_late & ~is_plane,
}
WAVES = {"x": "S", "z": "P"}


def spreads(rows, key):
    """Yield for each rule a row with median and limits of the middle 80 % of its bias, per cent."""
    for rule in RULES:
        low, median, high = np.nanpercentile(100 * rows[rule], (10, 50, 90))
        numbers = {"readings": len(rows), "low": low, "median": median, "high": high}
        yield key | {"rule": rule} | numbers


group_spreads = []
seed_spreads = []
for group, chosen in GROUPS.items():
    for (friction, direction), rows in bias[chosen].groupby(["friction", "direction"]):
        key = {"transducers": group, "friction": friction, "wave": WAVES[direction]}
        group_spreads.extend(spreads(rows, key))
        for seed, rows_of_seed in rows.groupby("seed"):
            seed_spreads.extend(spreads(rows_of_seed, key | {"seed": seed}))
group_spreads = pd.DataFrame(group_spreads)
seed_spreads = pd.DataFrame(seed_spreads)
print(group_spreads.to_string(index=False, float_format="%.1f"))

# %%
# **The figure**: the bias without friction, medians over stresses and places. Left and middle: over
# the distance in wavelengths, of planes and of discs, open if the sides come within a period.
# Right: over the delay of the sides.

MARKS = dict(zip(RULES, "vso^D", strict=True))
COLORS = dict.fromkeys(RULES, "k") | {"first_arrival": "0.6"}
figure, axes = plt.subplots(2, 3, figsize=(7.2, 4.6), sharey=True, layout="constrained")
dense = bias[bias["friction"] == 0]
for line, (direction, wave) in zip(axes, WAVES.items(), strict=True):
    of_wave = dense[dense["direction"] == direction]
    plane = of_wave[np.isinf(of_wave["radius_over_d"])]
    discs = of_wave[~np.isinf(of_wave["radius_over_d"])]
    panels = ((plane, "wavelengths"), (discs, "wavelengths"), (discs, "side_delay"))
    for ax, (rows, abscissa) in zip(line, panels, strict=True):
        groups = rows.groupby([rows["distance_over_d"].round(), "d_over_wavelength"])
        medians = groups[[*RULES, "wavelengths", "side_delay"]].median()
        is_open = medians["side_delay"] < MAX_REFLECTION_DELAY_IN_PERIODS
        if rows is plane:
            is_open[:] = False
        for rule, mark in MARKS.items():
            color = COLORS[rule]
            for shown, face in ((medians[~is_open], color), (medians[is_open], "w")):
                look = {"color": color, "mfc": face, "mew": 0.6, "ms": 3.5, "ls": ""}
                ax.plot(shown[abscissa], 100 * shown[rule], mark, **look)
        ax.axhline(0, color="k", lw=0.5, ls=":")
    line[0].set_ylabel(f"bias of V_{wave}, %")
    line[1].axvline(MIN_WAVELENGTHS, color="k", lw=0.5, ls="--")
    line[2].axvline(MAX_REFLECTION_DELAY_IN_PERIODS, color="k", lw=0.5, ls="--")
for rule, mark in MARKS.items():
    label = rule.replace("_", " ")
    axes[0, 0].plot([], [], mark, color=COLORS[rule], ms=3.5, label=label)
axes[0, 0].legend(frameon=False, fontsize=6, loc="lower right")
axes[0, 0].set(title="planes", ylim=(-65, 45))
axes[0, 1].set_title("discs")
axes[0, 2].set_title("discs")
for ax in axes[1, :2]:
    ax.set_xlabel("distance / wavelength")
axes[1, 2].set_xlabel("delay of the sides, periods")
plt.show()

if __name__ == "__main__" and len(sys.argv) >= 2:
    tables = {"bias_groups": group_spreads, "bias_seeds": seed_spreads}
    write(sys.argv[1], {"bias": figure}, tables, float_format="%.1f")
    cell = "{median:+.1f} ({low:+.0f} to {high:+.0f})"
    rows = group_spreads.to_dict("records")
    group_spreads["cell"] = [cell.format(**row) for row in rows]
    names = ["transducers", "friction", "wave", "readings"]
    page = group_spreads.pivot_table(
        "cell", names, "rule", aggfunc="first", sort=False
    ).reset_index()
    columns = {name: "{" + name + "}" for name in names}
    columns |= {rule.replace("_", " "): "{" + rule + "}" for rule in RULES}
    write_page(f"{sys.argv[1]}/bias.md", page, columns)
