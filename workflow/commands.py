"""Commands of a study's jobs, from the settings of their cases."""

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import Any

import yaml

from modal.cli.options import FALLS_SHORT_STATUS
from modal.cli.pack import option_of
from modal.preparation.protocol import FRICTION_PARAMETERS
from modal.tools.errors import InputError

PYTHON = ".venv/bin/python" if Path(".venv/bin/python").exists() else sys.executable
"""The project's Python, on every node; by the same name wherever the project lies."""
IN_TURN = f"{PYTHON} -m workflow.in_turn"
RULES = yaml.safe_load(Path(__file__).with_name("rules.yaml").read_text())
OF_NETWORK, FURTHER, COLUMNS = RULES["of_network"], RULES["further_waves"], RULES["columns"]
FULL = 35201
"""Spheres of the packings that costs.tsv is of."""
OF_YADE = {"fraction": 0.05, "passage": 1.0}
"""What yade_scripts/wave.py takes where a line does not say it."""


LINEAR_INTERVAL = 1e-6
"""Between records of a linear wave, s, where a study does not say it; the results are of this."""


class Commands:
    """Of the cases `rows`, by name, whose products are in `folder`; `Jobs` says which there are.

    `walks` are the cases of each compression, which has a state at each of `stresses`, Pa.
    """

    def walk_folder(self, walk: str) -> str:
        """Folder of a compression's own states."""
        return f"{self.folder}/walks/compression_{walk}"

    def walk_command(self, walk: str) -> str:
        """Shell's command of a compression, by YADE or its twin."""
        row, made = self.rows[self.walks[walk][0]], self.walk_folder(walk)
        if self.prepare != "yade" or row["mu_comp"] == 0:
            # A state that was not reached is kept, and says so.
            return f"({PYTHON} -m {self.pack(walk)} || [ $? = {FALLS_SHORT_STATUS} ])"
        if own := [name for name in COLUMNS["pack"] if row.get(name)]:
            raise InputError(
                "input",
                f"{', '.join(own)}: not in YADE's compressions",
                remedy="write prepare: modal",
            )
        own = f"{self.folder}/walks/{walk}.table"
        last = f"{made}/{self.stresses[-1]:g}Pa.sample.h5"
        log = f"{self.folder}/log/states/{walk}.yade.log"
        job = "workflow/yade_job.sh", own, row["mu_comp"], "yade_scripts/compress.py"
        job = quoted(*job, f"{self.folder}/walks", log, last)
        return f"{write_line(self.shape_of(row), own)} && {job}"

    def pack(self, walk: str) -> str:
        """Command of a compression by the twin."""
        row, stresses = self.rows[self.walks[walk][0]], self.stresses
        if row["mu_comp"] == 0:  # from the peak on it is unloaded
            stresses = stresses[::-1]
        shape = self.shape_of(row)
        given = {"friction": shape.pop("mu_comp")} | shape
        given |= {name: row[name] for name in COLUMNS["pack"] if row.get(name)}
        words = ["modal", "pack"]
        for name, value in given.items():
            words.append(option_of(name))
            words += [] if value is True else str(value).split()
        words += ["--stress", *(f"{stress:g}" for stress in stresses)]
        return quoted(*words, "-o", self.walk_folder(walk))

    def shape_of(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """What of a case shapes its compression."""
        unused = FRICTION_PARAMETERS if row["mu_comp"] == 0 else ()
        line = {name: row.get(name) for name in COLUMNS["walk"] if name not in unused}
        return {name: cell for name, cell in line.items() if cell is not None}

    def line(self, case: str, *parts: str, run: str = "") -> dict[str, Any]:
        """What a case has of some `COLUMNS`, as one line of a table; of `run`, a further wave."""
        row, changed = self.rows[case], FURTHER.get(run, {})
        names = [name for part in parts for name in COLUMNS[part]]
        line = {name: row[name] for name in names if row.get(name) is not None}
        for name, factor in changed.get("times", {}).items():
            line[name] = factor * line.get(name, OF_YADE.get(name))
        return line | changed.get("set", {})

    def yade(self, case: str, script: str, kind: str, *parts: str, run: str = "") -> str:
        """Shell's command of one of YADE's jobs, on a table of these `parts`; its log is `$log`."""
        folder = f"{self.folder}/waves/{run}" if run else self.folder
        own = f"{folder}/tables/{case}.{parts[-1]}.table"
        line = write_line(self.line(case, *parts, run=run), own)
        number, script = self.rows[case]["case"], f"yade_scripts/{script}.py"
        job = quoted("workflow/yade_job.sh", own, number, script, folder)
        job += f' "$log" {quoted(f"{folder}/{case}.{kind}.h5")}'
        return f"mkdir -p {quoted(f'{folder}/tables')}; {line}; {job}"

    def further(self, case: str, run: str) -> str:
        """The same of a further wave, in a folder where wave.py finds the case under its name."""
        folder, kinds = f"{self.folder}/waves/{run}", ("network", "highest.modes")
        wave = self.yade(case, "wave", "signals", "wave", run=run)
        links = quoted("ln", "-sf", *(f"../../{case}.{kind}.h5" for kind in kinds), folder)
        made = f"{folder}/{case}.signals.h5"
        move = quoted("mv", made, self.product(case, f"{run}.signals"))
        make = quoted("mkdir", "-p", folder)
        return f"unset ${{!WAVE_@}}; {make}; {links}; {wave} && {move}"

    def product(self, case: str, kind: str) -> str:
        """File of a case's product."""
        return f"{self.folder}/{case}.{kind}.h5"

    def rest(self, case: str, state: str) -> str:
        """Command that brings a state to rest with the friction of the case's wave."""
        friction, sample = self.rows[case]["mu_wave"], self.product(case, "sample")
        command = quoted("modal", "relax", state, "--friction", friction, "-o", sample)
        return f"{command} --skip-current"

    def of_network(self, rule: str, case: str, packing: str = "network") -> str:
        """Command of one of the rules `OF_NETWORK`, for a network or a sample."""
        command, made = OF_NETWORK[rule]["command"], OF_NETWORK[rule]["makes"]
        options = {
            "lowest": lambda: self.study.settings["lowest_modes"],
            "band": lambda: self.band(case),
            "linear": lambda: self.linear(case, 1),
            "shear": lambda: self.linear(case, 2, "--direction x"),
        }
        given = {name: of() for name, of in options.items() if f"{{{name}}}" in command}
        given |= {
            "folder": quoted(self.folder),
            "network": quoted(self.product(case, packing)),
            "product": quoted(self.product(case, made[0])),
        }
        return command.format(**given)

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
        interval = float(row.get("interval") or 0) or LINEAR_INTERVAL
        return f"{own} {pulse} --interval {interval:g} --duration {slower * self.duration(case)}"

    def band(self, case: str) -> str:
        """Options of the modes of a case's band; shapes are kept as far as they fit."""
        low, high = self.study.settings["bands"].get(case, self.study.settings["band"])
        return "--hours 4 " + (f"--between {low} {high}" if low > 0 else f"--below {high}")


def quoted(*words: object) -> str:
    """Return words as the shell, and `in_turn`, read them: each is one, whatever is in it."""
    return " ".join(quote(str(word)) for word in words)


def write_line(line: Mapping[str, Any], path: str) -> str:
    """Command that writes a table of one line for yade-batch, which takes cells for Python."""
    cells = [
        json.dumps(cell.replace(" ", "_")) if isinstance(cell, str) else f"{cell:.12g}"
        for cell in line.values()
    ]
    write = quoted("printf", "%s\\n", " ".join(line), " ".join(cells))
    return f"{write} > {quote(path)}"


def environment() -> str:
    """Shell's command that sets for YADE's waves what the caller has set."""
    names = sorted(name for name in os.environ if name.startswith("WAVE_") and name.isidentifier())
    settings = [f"{name}={quote(os.environ[name])}" for name in names]
    return f"export {' '.join(settings)}" if settings else ":"
