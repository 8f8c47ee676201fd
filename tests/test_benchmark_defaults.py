"""The defaults of the programs are the knees of the committed benchmarks."""

from __future__ import annotations

import csv
import inspect
import re
from pathlib import Path

from benchmarks import density, fcc_time_step, preparation, random_time_step, wave
from modal.density import density_of_states
from modal.preparation.protocol import SETTLED
from modal.wave import propagate

ROOT = Path(__file__).resolve().parents[1]


def committed(name: str) -> list[dict]:
    """Rows of a benchmark, numbers as numbers."""
    with open(ROOT / "results" / "benchmarks" / f"{name}.csv") as file:
        return [{k: number(v) for k, v in row.items()} for row in csv.DictReader(file)]


def number(text: str):
    try:
        return float(text)
    except ValueError:
        return text or None


def assigned(script: str, pattern: str) -> tuple[float, ...]:
    """Numbers that a script of YADE sets, which only YADE could import."""
    text = (ROOT / "yade_scripts" / script).read_text()
    return tuple(float(value) for value in re.search(pattern, text, re.MULTILINE).groups())


def test_time_step_of_the_crystal():
    rows = [row for row in committed("fcc_time_step") if row["method"] == "time step, 2A = 5 nm"]
    knee = fcc_time_step.default_step(rows)["time_step_over_limit"]
    assert assigned("wave.py", r"^    fraction=([\d.]+),") == (knee,)


def test_time_step_of_random_packings():
    knee = random_time_step.largest_step(committed("random_time_step"), "error")
    lines = (ROOT / "cases" / "random.table").read_text().splitlines()
    names, *cases = [line.split() for line in lines if not line.startswith("#")]
    used = {float(case[names.index("fraction")]) for case in cases}
    assert used == {knee["time_step_over_limit"]}


def test_density_of_states():
    default = inspect.signature(density_of_states).parameters
    moments = [row for row in committed("density") if str(row["method"]).endswith("more moments")]
    knee = density.default_resolution(moments)
    assert default["resolution"].default == knee["resolution_hz"]
    assert default["tolerance"].default == density.TOLERANCE[False]


def test_wave_and_settled_state_are_measured_at_their_defaults():
    assert inspect.signature(propagate).parameters["tolerance"].default == wave.DEFAULT
    stress, residual = SETTLED
    assert residual == preparation.DEFAULT
    assert stress == 3 * preparation.DEFAULT
