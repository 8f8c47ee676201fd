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
from modal.packing.network import Network
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
PLACES = (20, 62, 104)  # D, of the source above the lower wall; the packings are 147 D long
MARGIN = 10  # D, of the packing below the source and above the last receiver
DISTANCES = (6, 12, 18, 24)  # D, from the source to each receiver
RECEIVER_PAIRS = ((0, 2), (0, 3))  # numbers of receivers that are compared with each other
RADII = (1.5, 3, np.inf)  # D, of the discs; the last is a plane of all spheres at a height
D_OVER_WAVELENGTH = (0.04, 0.08, 0.12, 0.16)  # with the velocity by the moduli
DIRECTIONS = ("x", "z")
PASSAGES = 1.5  # length of a record, in passages to the last receiver, besides the burst

# %%
# **The test.** A disc of spheres moves by one period of a sine, discs above it receive. In a long
# packing tests at three places stand for three samples: the places share no sphere. The wave runs
# through the spheres near a place alone; velocities of the moduli are those of the whole packing.


def segment(packing, low, high):
    """Return the spheres of a packing between two heights, m, with the contacts among them."""
    inside = (packing.position[:, 2] > low) & (packing.position[:, 2] < high)
    number = np.cumsum(inside) - 1
    joined = inside[packing.particle_i] & inside[packing.particle_j] & (packing.particle_j >= 0)
    columns = {name: getattr(packing, name)[inside] for name in SPHERE_COLUMNS}
    columns |= {name: getattr(packing, name)[joined] for name in CONTACT_COLUMNS}
    for name in ("particle_i", "particle_j"):
        columns[name] = number[getattr(packing, name)[joined]]
    columns |= {name: getattr(packing, name) for name in CELL_COLUMNS}
    return Network(**columns)


SPHERE_COLUMNS = ("position", "radius", "mass", "inertia")
CONTACT_COLUMNS = (
    "cell_shift",
    "normal",
    "lever_i",
    "lever_j",
    "stiffness_normal",
    "stiffness_tangential",
)
CELL_COLUMNS = ("cell_size", "cell_periodic", "wall_position")


def measure(packing, velocities, place):
    """Yield the rows of all tests of a packing whose source is at a place."""
    diameter = 2 * float(packing.radius.mean())
    ends = np.array([place - MARGIN, place + DISTANCES[-1] + MARGIN]) * diameter
    spheres = segment(packing, *ends)
    for direction in DIRECTIONS:
        velocity = velocities[direction]
        for radius in RADII:
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


def gather():
    """Add all tests that are not in the table yet, and write the table after each place."""
    table = pd.read_csv(TABLE) if TABLE.exists() else pd.DataFrame(columns=["case", "place_over_d"])
    for case, (friction, stress) in SAMPLES.items():
        measured = table.loc[table["case"] == case, "place_over_d"]
        places = [place for place in PLACES if place not in set(measured)]
        if not places:
            continue
        packing = modal.read(RESULTS / f"samples/{case}.sample.h5")
        velocities = dict(zip("zx", modulus_velocities(packing, "x"), strict=True))
        for place in places:
            key = {"case": case, "friction": friction, "stress_pa": stress, "place_over_d": place}
            rows = [key | row for row in measure(packing, velocities, place)]
            table = pd.concat([table, pd.DataFrame(rows)]) if len(table) else pd.DataFrame(rows)
            table.to_csv(TABLE, index=False, float_format="%.3g")


if __name__ == "__main__" and len(sys.argv) == 3:
    gather()
