"""Commands of a study's jobs, from the settings of their cases."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import Any

from analysis.study.description import Study
from modal.cli.pack import option_of
from modal.preparation.protocol import OF_FRICTION
from modal.tools.errors import InputError

PYTHON = ".venv/bin/python" if Path(".venv/bin/python").exists() else sys.executable
"""The project's Python, on every node; by the same name wherever the project lies."""
FULL = 35201
"""Spheres of the packings that costs.tsv is of."""
OF_CRYSTAL = "case", "mu_comp", "mu_wave", "stress", "width", "layers", "crystal"
OF_EXPORT = "case", "mu_wave", "stress", "sample"
"""Columns of YADE's other jobs; the last names their table."""
OF_WAVE = (
    *("case", "mu_wave", "input_frequency", "fraction", "passage", "amplitude", "duration"),
    *("interval", "particles", "direction"),
)
"""Columns of a case that yade_scripts/wave.py takes."""
OF_WALK = (
    *("mu_comp", "spheres", "width", "seed", "sizes", "densities", "approach_rate", "hot_stress"),
    *("agitated_damping", "inertial_number", "damping", "residual"),
)
"""Columns that shape a compression, by YADE or its twin."""
OF_PACK = "contact_model", "periodic", "stress_ratio", "oedometric", "dilate", "time_step_fraction"
"""Those that only the twin, `modal pack`, knows; none says of its states what was asked for."""
AMPLITUDES = {"reverse": -1.0, "tenth": 0.1, "small": 0.01, "small_reverse": -0.01}
"""Further YADE waves that split the difference to the linear one: in parts of the amplitude."""
SLOWER = 1.75
"""Times that an S-wave needs, in those of the P-wave: a record of one passage or more."""


class Commands:
    """Of the cases `rows`, by name, whose products are in `folder`; `Jobs` says which there are.

    `walks` are the cases of each compression, which has a state at each of `stresses`, Pa.
    """

    study: Study
    folder: str
    prepare: str
    rows: dict[str, dict[str, Any]]
    walks: dict[str, list[str]]
    stresses: list[float]

    def walk_command(self, walk: str) -> str:
        """Command of a compression, which keeps its states in walks/."""
        row = self.rows[self.walks[walk][0]]
        own = {name: row[name] for name in OF_PACK if row.get(name)}
        if own and self.prepare == "yade":
            raise InputError(f"{', '.join(own)}: not in YADE's compressions; write prepare: modal")
        only = " ".join(option_of(n) + ("" if x is True else f" {x}") for n, x in own.items())
        line, stresses = self.shape_of(row), self.stresses
        folder, log = f"{self.folder}/walks", f"{self.folder}/log/states/{walk}.yade.log"
        if self.prepare == "yade" and row["mu_comp"] > 0:
            made = f"{folder}/compression_mu{row['mu_comp']:g}"
            last, own = f"{made}/{self.stresses[-1]:g}Pa.sample.h5", f"{folder}/{walk}.table"
            job = f"workflow/yade_job.sh {own} {row['mu_comp']} yade_scripts/compress.py"
            return f"{write_line(line, own)} && {job} {folder} {log} {last}"
        if row["mu_comp"] == 0:  # from the peak on it is unloaded
            stresses = stresses[::-1]
        given = " ".join(f"{option_of(n)} {cell}" for n, cell in line.items() if n != "mu_comp")
        given += f" {only} --stress " + " ".join(f"{stress:g}" for stress in stresses)
        friction = f"{PYTHON} -m modal pack --friction {row['mu_comp']}"
        return f"{friction} {given} -o {folder}/compression_{walk}"

    def shape_of(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """What of a case shapes its compression."""
        unused = OF_FRICTION if row["mu_comp"] == 0 else ()
        line = {name: row.get(name) for name in OF_WALK if name not in unused}
        return {name: cell for name, cell in line.items() if cell is not None}

    def noted_of(self, walk: str) -> str:
        """What each state of a compression notes of it, as link_states.py takes it."""
        noted = self.shape_of(self.rows[self.walks[walk][0]])
        return " ".join(f"{name}={quote(str(cell))}" for name, cell in noted.items())

    def table(self, case: str, columns: Sequence[str]) -> str:
        """Command that writes the table of one of YADE's jobs, and its path as shell variable."""
        line = {n: v for n in columns if (v := self.rows[case].get(n)) is not None}
        path = f"{self.folder}/tables/{case}.{columns[-1]}.table"
        return f"own={path}; mkdir -p {self.folder}/tables; {write_line(line, '$own')}"

    def wave(self, case: str, run: str = "") -> str:
        """The same of a wave, or of one of its further waves, in its folder."""
        folder = f"{self.folder}/waves/{run}" if run else f"{self.folder}/tables"
        line = write_line(self.wave_line(case, run), "$own")
        return f"mkdir -p {folder}; own={folder}/{case}.wave.table; {line}"

    def wave_line(self, case: str, run: str = "") -> dict[str, Any]:
        """Line of a case's YADE wave, or of one of its further waves."""
        line = {n: v for n in OF_WAVE if (v := self.rows[case].get(n)) is not None}
        line["amplitude"] *= AMPLITUDES.get(run, 1.0)
        if run == "100kHz":
            line["input_frequency"] = 1e5
        elif run == "shear_yade":
            line |= {"direction": "x", "passage": SLOWER * line.get("passage", 1.0)}
        elif run == "no_slip":
            line["mu_wave"] = 10
        elif run == "half_step":
            # Every step is recorded, and for longer: the case's own times are then among them.
            line["fraction"] = 0.5 * line.get("fraction", 0.05)
            line |= {"passage": 1.02 * line.get("passage", 1.0), "interval": 0}
        return line

    def duration(self, case: str) -> float:
        """Seconds in which a wave goes from wall to wall, and somewhat more."""
        row = self.rows[case]
        slowest = 1.2e-3 * (row["spheres"] / FULL) ** (1 / 3)
        if row["kind"] == "fcc":
            slowest = 5e-4 * row["layers"] / 200
        return round(slowest * (1e5 / row["stress"]) ** (1 / 6), 7)

    def linear(self, case: str, times: float, options: str = "") -> str:
        """Options of a linear wave as the case's, so many times as long as a P-wave needs."""
        row, direction = self.rows[case], self.rows[case].get("direction", "z")
        own, slower = (options, times) if direction == "z" else (f"--direction {direction}", 2)
        pulse = f"--amplitude {row['amplitude']} --input-frequency {row['input_frequency']}"
        # Every step of YADE's, which a line may ask for as 0, is none of the linear wave's.
        interval = f"--interval {row['interval']}" if float(row.get("interval") or 0) > 0 else ""
        return f"{own} {pulse} {interval} --duration {slower * self.duration(case)}"

    def band(self, case: str) -> str:
        """Options of the modes of a case's band; shapes are kept as far as they fit."""
        low, high = self.study.settings["bands"].get(case, self.study.settings["band"])
        return "--hours 4 " + (f"--between {low} {high}" if low > 0 else f"--below {high}")


def write_line(line: Mapping[str, Any], path: str) -> str:
    """Command that writes a table of one line for yade-batch, which takes cells for Python."""
    cells = [
        f'"{cell.replace(" ", "_")}"' if isinstance(cell, str) else f"{cell:.12g}"
        for cell in line.values()
    ]
    return f"printf '%s\\n' '{' '.join(line)}' '{' '.join(cells)}' > {path}"


def environment() -> str:
    """What the caller has set for YADE's waves, as shell assignments."""
    return " ".join(f"{n}={quote(v)}" for n, v in sorted(os.environ.items()) if n[:5] == "WAVE_")
