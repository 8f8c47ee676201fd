"""
Two transducers in packings
===========================

How far are velocities read from travel times from those of the elastic moduli? By rule, distance,
wavelength, radius of the discs and stress, for P- and S-waves, in packings of two frictions.

`python examples/transducers.py FOLDER` writes the figure and the tables into a folder. It reads
`bias.csv` in `results/transducers`; `python examples/transducers.py FOLDER measure` first makes
this table from the committed samples, place by place, and leaves out what the table has already.
"""

import sys

import numpy as np
import pandas as pd
from _committed import RESULTS

import modal
from analysis.bench import modulus_velocities
from analysis.estimators.arrival_rules import RULES, RecordPair, travel_time
from modal.motions import SineBurst
from modal.sources import Disc
from modal.waves.propagate import propagate_motions

TABLE = RESULTS / "transducers/bias.csv"
SAMPLES = {0.0: (5, 6, 7, 8), 0.4: (29, 30, 31, 32)}  # cases of a friction, at 10 kPa to 10 MPa
STRESSES = (1e4, 1e5, 1e6, 1e7)  # Pa
PLACES = (16, 57, 98)  # D, of the source above the lower wall; the packings are 147 D long
DISTANCES = (6, 12, 24, 36)  # D, from the source to each receiver
RECEIVER_PAIRS = ((0, 2), (1, 3))  # numbers of receivers that are compared with each other
RADII = (1.5, 3, np.inf)  # D, of the discs; the last is a plane of all spheres at a height
D_OVER_WAVELENGTH = (0.04, 0.08, 0.12, 0.16)  # with the velocity by the moduli
DIRECTIONS = ("x", "z")

# %%
# **The test.** A disc of spheres moves by one period of a sine, discs above it receive. In a long
# packing tests at three places stand for three samples: the places share no sphere.


def measure(packing, place):
    """Yield the rows of all tests of a packing whose source is at a place."""
    diameter = 2 * float(packing.radius.mean())
    v_p, v_s = modulus_velocities(packing, "x")
    for direction in DIRECTIONS:
        velocity = v_p if direction == "z" else v_s
        bursts = [SineBurst(1e-9, each * velocity / diameter) for each in D_OVER_WAVELENGTH]
        longest = DISTANCES[-1] * diameter / velocity
        for radius in RADII:
            discs = []
            for distance in (0, *DISTANCES):
                centre = (*packing.cell_size[:2] / 2, (place + distance) * diameter)
                discs.append(Disc(centre, min(radius * diameter, packing.length), direction))
            waves = propagate_motions(
                packing,
                2 * longest + bursts[0].corners[-1],
                bursts,
                interval=1 / (40 * bursts[-1].frequency),
                source=discs[0],
                receivers=discs[1:],
            )
            heights = np.array([disc.position_in(packing) for disc in discs])
            pairs = [(None, number) for number in range(len(DISTANCES))]
            for first, second in (*pairs, *RECEIVER_PAIRS):
                start = heights[0 if first is None else first + 1]
                distance = float(np.linalg.norm(heights[second + 1] - start))
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


def gather():
    """Add all tests that are not in the table yet, and write the table after each place."""
    tables = [pd.read_csv(TABLE)] if TABLE.exists() else []
    for friction, cases in SAMPLES.items():
        for place in PLACES:
            for stress, case in zip(STRESSES, cases, strict=True):
                key = {"friction": friction, "stress_pa": stress, "place_over_d": place}
                if any((table[list(key)] == pd.Series(key)).all(axis=1).any() for table in tables):
                    continue
                packing = modal.read(RESULTS / f"samples/case{case:02}.sample.h5")
                rows = pd.DataFrame(measure(packing, place))
                tables.append(pd.DataFrame([key] * len(rows)).join(rows))
                table = pd.concat(tables)
                table.to_csv(TABLE, index=False, float_format="%.3g")


if __name__ == "__main__" and len(sys.argv) == 3:
    gather()
