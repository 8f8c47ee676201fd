"""Compose the commands of a study's jobs from the settings of their cases."""

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import Any

import yaml

from analysis.study.description import Study
from modal.cli.options import FALLS_SHORT_STATUS
from modal.cli.pack import option_of
from modal.preparation.study import FRICTION_PARAMETERS
from modal.tools.errors import InputError

PYTHON = ".venv/bin/python" if Path(".venv/bin/python").exists() else sys.executable
"""The project's Python on every node; the relative path holds wherever the project lies."""
IN_TURN = f"{PYTHON} -m workflow.in_turn"
RULES = yaml.safe_load(Path(__file__).with_name("rules.yaml").read_text())
OF_NETWORK = RULES["of_network"]
FURTHER = RULES["further_waves"]
COLUMNS = RULES["columns"]
FULL = 35201
"""Number of spheres of the packings for which costs.tsv lists costs."""
DEFAULTS_OF_YADE = {"fraction": 0.05, "passage": 1.0}
"""Values that yade_scripts/wave.py uses for columns that a line does not have."""
LINEAR_INTERVAL = 1e-6
"""Time between records of a linear wave, s, where a study does not say it; committed results have
been made with it."""
REFERENCE_STRESS = 1e5
"""Stress, Pa, of the packings from which the durations of waves are scaled."""


class Commands:
    """Commands for the cases `rows`, by name, whose products are in `folder`.

    The subclass `Jobs` sets the attributes. `walks` are the cases of each compression, which has a
    state at each of `stresses`, Pa.
    """

    study: Study
    folder: str
    prepare: str
    rows: dict[str, dict[str, Any]]

    def walk_folder(self, walk: str) -> str:
        """Return the folder of the states of a compression."""
        return f"{self.folder}/walks/compression_{walk}"

    def walk_command(self, walk: str) -> str:
        """Return the shell's command of a compression, by YADE or by `modal pack`.

        Raises InputError if YADE's compressions lack a setting of the case.
        """
        row = self.rows[self.walks[walk][0]]
        if self.prepare != "yade" or row["mu_comp"] == 0:
            # A state that was not reached is kept, and says so.
            return f"({PYTHON} -m {self.pack_command(walk)} || [ $? = {FALLS_SHORT_STATUS} ])"
        settings = [name for name in COLUMNS["pack"] if row.get(name)]
        if settings:
            raise InputError(
                "not_in_yade",
                f"{', '.join(settings)}: not in YADE's compressions",
                remedy="write prepare: modal",
            )
        table = f"{self.folder}/walks/{walk}.table"
        log = f"{self.folder}/log/states/{walk}.yade.log"
        last_state = f"{self.walk_folder(walk)}/{self.stresses[-1]:g}Pa.sample.h5"
        job = quoted(
            "workflow/yade_job.sh",
            table,
            row["mu_comp"],
            "yade_scripts/compress.py",
            f"{self.folder}/walks",
            log,
            last_state,
        )
        return f"{write_line(self.shape_of(row), table)} && {job}"

    def pack_command(self, walk: str) -> str:
        """Return the command of a compression by `modal pack`."""
        row = self.rows[self.walks[walk][0]]
        stresses = self.stresses
        if row["mu_comp"] == 0:  # without friction a packing is unloaded from its highest stress
            stresses = stresses[::-1]
        settings = self.shape_of(row)
        settings = {"friction": settings.pop("mu_comp")} | settings
        settings |= {name: row[name] for name in COLUMNS["pack"] if row.get(name)}
        words = ["modal", "pack"]
        for name, value in settings.items():
            words.append(option_of(name))
            if value is not True:
                words += str(value).split()
        words += ["--stress", *(f"{stress:g}" for stress in stresses)]
        return quoted(*words, "-o", self.walk_folder(walk))

    def shape_of(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """Return the settings of a case that its compression depends on."""
        unused = FRICTION_PARAMETERS if row["mu_comp"] == 0 else ()
        settings = {name: row.get(name) for name in COLUMNS["walk"] if name not in unused}
        return {name: value for name, value in settings.items() if value is not None}

    def line(self, case: str, *parts: str, run: str = "") -> dict[str, Any]:
        """Return the settings of a case in the columns of `COLUMNS`, for a table of one line.

        `parts` select groups of the columns. `run` names a further wave of the case, which changes
        some of the cells.
        """
        row = self.rows[case]
        changes = FURTHER.get(run, {})
        names = [name for part in parts for name in COLUMNS[part]]
        line = {name: row[name] for name in names if row.get(name) is not None}
        for name, factor in changes.get("times", {}).items():
            line[name] = factor * line.get(name, DEFAULTS_OF_YADE.get(name))
        return line | changes.get("set", {})

    def yade_command(self, case: str, script: str, kind: str, *parts: str, run: str = "") -> str:
        """Return the shell's command of one of YADE's jobs.

        The job runs `script` on a table of these `parts` of `COLUMNS`, and makes the product
        `kind`. Its log is the shell's variable `$log`.
        """
        folder = f"{self.folder}/waves/{run}" if run else self.folder
        table = f"{folder}/tables/{case}.{parts[-1]}.table"
        line = write_line(self.line(case, *parts, run=run), table)
        number = self.rows[case]["case"]
        job = quoted("workflow/yade_job.sh", table, number, f"yade_scripts/{script}.py", folder)
        product = quoted(f"{folder}/{case}.{kind}.h5")
        return f'mkdir -p {quoted(f"{folder}/tables")}; {line}; {job} "$log" {product}'

    def further_wave_command(self, case: str, run: str) -> str:
        """Return the shell's command of a further wave of a case.

        The wave runs in its own folder, in which wave.py finds the case under its name.
        """
        folder = f"{self.folder}/waves/{run}"
        sources = [f"../../{case}.{kind}.h5" for kind in ("network", "highest.modes")]
        make_folder = quoted("mkdir", "-p", folder)
        link = quoted("ln", "-sf", *sources, folder)
        wave = self.yade_command(case, "wave", "signals", "wave", run=run)
        product = self.product(case, f"{run}.signals")
        move = quoted("mv", f"{folder}/{case}.signals.h5", product)
        return f"unset ${{!WAVE_@}}; {make_folder}; {link}; {wave} && {move}"

    def product(self, case: str, kind: str) -> str:
        """Return the path of the file of a case's product of one kind."""
        return f"{self.folder}/{case}.{kind}.h5"

    def relax_command(self, case: str, state: str) -> str:
        """Return the command that brings a state to rest with the friction of the case's wave.

        A compression with friction goes on while its contacts still slide: its state creeps under
        its stress before the cell is fixed.
        """
        row = self.rows[case]
        options = ["--friction", row["mu_wave"]]
        is_isotropic = not row.get("oedometric") and float(row.get("stress_ratio") or 1) == 1
        if row["mu_comp"] > 0 and is_isotropic:
            options += ["--stress", row["stress"]]
        command = quoted("modal", "relax", state, *options, "-o", self.product(case, "sample"))
        return f"{command} --skip-current"

    def network_command(self, rule: str, case: str, packing: str = "network") -> str:
        """Return the command of a rule that needs only a packing, one of `OF_NETWORK`.

        `packing` tells whether the rule takes the case's network or its sample.
        """
        command = OF_NETWORK[rule]["command"]
        parts = {
            "folder": quoted(self.folder),
            "network": quoted(self.product(case, packing)),
            "product": quoted(self.product(case, OF_NETWORK[rule]["makes"][0])),
        }
        if "{lowest}" in command:
            parts["lowest"] = self.study.settings["lowest_modes"]
        if "{band}" in command:
            parts["band"] = self.band_options(case)
        if "{linear}" in command:
            parts["linear"] = self.linear_wave_options(case, 1)
        if "{shear}" in command:
            parts["shear"] = self.linear_wave_options(case, 2, "--direction x")
        return command.format(**parts)

    def duration(self, case: str) -> float:
        """Return the time in which a wave passes from wall to wall, with a margin, s."""
        row = self.rows[case]
        slowest = 1.2e-3 * (row["spheres"] / FULL) ** (1 / 3)
        if row["kind"] == "fcc":
            slowest = 5e-4 * row["layers"] / 200
        return round(slowest * (REFERENCE_STRESS / row["stress"]) ** (1 / 6), 7)

    def linear_wave_options(self, case: str, durations: float, options: str = "") -> str:
        """Return the options of a linear wave with the settings of the case's wave.

        The wave is as long as `durations` passages of a P-wave.
        """
        row = self.rows[case]
        direction = row.get("direction", "z")
        if direction != "z":
            options = f"--direction {direction}"
            durations = 2
        pulse = f"--amplitude {row['amplitude']} --input-frequency {row['input_frequency']}"
        # An interval of 0 asks YADE for every step; the linear wave has no such step.
        interval = float(row.get("interval") or 0) or LINEAR_INTERVAL
        duration = durations * self.duration(case)
        return f"{options} {pulse} --interval {interval:g} --duration {duration}"

    def band_options(self, case: str) -> str:
        """Return the options of the modes of a case's band; shapes are kept if they fit."""
        low, high = self.study.settings["bands"].get(case, self.study.settings["band"])
        if low > 0:
            return f"--hours 4 --between {low} {high}"
        return f"--hours 4 --below {high}"


def quoted(*words: object) -> str:
    """Return words as one text, quoted safely for the shell and for `in_turn`."""
    return " ".join(quote(str(word)) for word in words)


def write_line(line: Mapping[str, Any], path: str) -> str:
    """Return the command that writes a table of one line for yade-batch.

    yade-batch evaluates cells as Python; texts are quoted for that.
    """
    cells = []
    for cell in line.values():
        if isinstance(cell, str):
            cells.append(json.dumps(cell.replace(" ", "_")))
        else:
            cells.append(f"{cell:.12g}")
    write = quoted("printf", "%s\\n", " ".join(line), " ".join(cells))
    return f"{write} > {quote(path)}"


def environment() -> str:
    """Return the shell's text that passes the caller's variables WAVE_* on to YADE's waves."""
    names = sorted(name for name in os.environ if name.startswith("WAVE_") and name.isidentifier())
    settings = [f"{name}={quote(os.environ[name])}" for name in names]
    return f"export {' '.join(settings)}" if settings else ":"
