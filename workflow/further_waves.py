"""Further YADE waves of a case: which there are, and what sets each apart from the case's own.

`100kHz` is the pulse that all other cases have, where the case's own is another (Fig. 4 of the
paper); `shear_yade` an S-wave, whose wall slides along x. The others split the difference between
the case's wave and the linear one by its causes (`python -m analysis agreement`): other amplitudes,
no sliding, half the time step.
"""

from __future__ import annotations

from collections.abc import Mapping

AMPLITUDES = {"reverse": -1.0, "tenth": 0.1, "small": 0.01, "small_reverse": -0.01}
"""In parts of the study's."""
SPLIT = *AMPLITUDES, "no_slip", "half_step"
ALL = "100kHz", "shear_yade", *SPLIT
SLOWER = 1.75
"""Times that an S-wave needs, in those of the P-wave: a record of one passage or more."""
FRACTION, PASSAGE = 0.05, 1.0
"""What `yade_scripts/wave.py` takes where a line has none: time step over its limit, passages."""


def table(row: Mapping[str, str], run: str, amplitude: float) -> tuple[str, str]:
    """Header and line of a table for YADE, from the case's own line and the study's amplitude, m.

    >>> table({"case": "3", "input_frequency": "2e5"}, "100kHz", 2.5e-9)
    ('case input_frequency amplitude', '3 1e5 2.5e-09')
    """
    found = dict(row) | {"amplitude": f"{AMPLITUDES.get(run, 1.0) * amplitude:g}"}
    if run == "100kHz":
        found["input_frequency"] = "1e5"
    elif run == "shear_yade":
        found["direction"] = '"x"'  # YADE takes the cells of its tables for Python
        found["passage"] = f"{SLOWER * float(row.get('passage', PASSAGE)):g}"
    elif run == "no_slip":
        found["mu_wave"] = "10"
    elif run == "half_step":
        # Every step is recorded, and for somewhat longer: the case's own times are then among them.
        found["fraction"] = f"{0.5 * float(row.get('fraction', FRACTION)):g}"
        found["passage"] = f"{1.02 * float(row.get('passage', PASSAGE)):g}"
        found["interval"] = "0"
    return " ".join(found), " ".join(found.values())


def options(files: Mapping[str, str]) -> str:
    """Options of `python -m analysis agreement` for these files, by the name of their run."""
    return " ".join(f"--{run.replace('_', '-')} {path}" for run, path in files.items())
