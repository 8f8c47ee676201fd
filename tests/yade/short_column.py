"""A short FCC column in YADE, and scripts of the study that run on it."""

from pathlib import Path

from in_yade import run

WIDTH = 3
LAYERS = 30
STRESS = 1e5
TABLE = {
    "case": 2,
    "mu_comp": 0,
    "mu_wave": 0.1,
    "stress": STRESS,
    "input_frequency": 1e5,
    "width": WIDTH,
    "layers": LAYERS,
}


def batch(script: str, folder: Path, columns: dict | None = None, **environment: str) -> str:
    """Run a script on the table, with other `columns`, and return its log."""
    values = TABLE | (columns or {})
    names = " ".join(values)
    numbers = " ".join(str(value) for value in values.values())
    return run(script, f"{names}\n{numbers}\n", folder, **environment)
