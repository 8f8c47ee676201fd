"""What the rules need to know of the study: its cases, what each starts from, what a rule takes.

Read by the Snakefile alone. A case's line stands in cases/fcc.table or cases/random.table, its
compression in cases/compressions.table; the settings of all in workflow/study.yaml.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from functools import cache, cached_property
from pathlib import Path
from shlex import quote
from typing import Any

import h5py
import yaml
from cost import Cost, expected, resources
from jsonschema import Draft202012Validator

from analysis.batch_table import Line, cases, lines_by, short, value, word
from modal.cli.pack import option_of
from modal.preparation.protocol import STRESSES

FULL = 35201
"""Spheres of a random packing of the study, and of its walks by YADE."""
LAYERS = 200
"""Layers of its crystals."""
FIRST_SEED = 1
"""Of the committed samples; a study of another seed makes its packings itself."""
SAMPLES = Path("results/samples")
CRYSTAL_KINDS = {
    "sample": ["network"],
    "highest": ["highest.modes"],
    "wave": ["signals"],
    "linear": ["linear.signals"],
    "modes": ["modes", "translations.modes"],
    "response": ["response"],
    "shear": ["shear.signals"],
    "moduli": ["moduli"],
}
RANDOM_KINDS = CRYSTAL_KINDS | {
    "modes": ["modes"],
    "density": ["density"],
    "structure": ["structure"],
}
"""Stage of the front door: the files of a case that it makes."""
OF_WAVE = (
    *("AMPLITUDE", "FRACTION", "PASSAGE", "DURATION", "INTERVAL", "PARTICLES"),
    *("DIRECTION", "DAMPING", "MOTION"),
)
"""Settings that `yade_scripts/wave.py` takes from variables of these names after WAVE_."""
NEEDED = {"case", "mu_comp", "mu_wave", "stress", "input_frequency"}
WAVE = {"fraction", "passage", "amplitude", "duration", "interval", "particles", "direction"}
SHAPE = {"width", "layers"}
"""Columns of the cases: of all, of those whose wave is another, of crystals."""
COMPARED = "sample", "highest", "wave", "modes", "response"
REPORTED = *COMPARED, "density", "structure"
"""Stages of which a case's comparison, and a report, read the files."""
FURTHER = "shear", "moduli"
"""Stages that are no part of the study; a report reads their files where they are there."""


class Study:
    """The cases of a study with its settings; ValueError where they do not fit together."""

    def __init__(self, config: Mapping[str, Any]) -> None:
        check(config)
        self.config = config
        self.folder = config["products"]
        self.crystals, self.random = cases(Path("cases")).values()
        self.compressions = lines_by("cases/compressions.table", "mu_comp")
        self.rows = self.crystals | self.random
        for case, row in self.rows.items():
            self.refuse_unknown(case, row)
        self.cases = [f"case{int(case):02d}" for case in config["cases"]]
        self.reduced = config["spheres"] != FULL
        self.another_seed = config["seed"] != FIRST_SEED
        for case in self.cases:
            if case not in self.rows:
                raise ValueError(f"{case}: no line in cases/fcc.table or cases/random.table")
            mu = short(self.rows[case]["mu_comp"])
            if case in self.random and mu != "0" and mu not in self.compressions:
                raise ValueError(
                    f"{case}: no compression with friction {mu}; add a line to "
                    "cases/compressions.table"
                )

    def refuse_unknown(self, case: str, row: Line) -> None:
        """ValueError where a column of a case is missing, or its cell means nothing."""
        known = NEEDED | WAVE | (SHAPE if case in self.crystals else set())
        if lacking := NEEDED - row.keys():
            raise ValueError(f"{case}: its table lacks the column {', '.join(sorted(lacking))}")
        if unknown := row.keys() - known:
            raise ValueError(
                f"{case}: column {', '.join(sorted(unknown))} means nothing; known are "
                f"{', '.join(sorted(known))}"
            )
        for name in row.keys() - {"direction"}:
            if not isinstance(value(row[name]), float):
                raise ValueError(f"{case}: {name} {row[name]} is no number")
        if case in self.random and float(row["stress"]) not in STRESSES:
            states = ", ".join(f"{stress:g}" for stress in STRESSES)
            raise ValueError(
                f"{case}: stress {row['stress']} Pa; a compression has states at {states} Pa"
            )

    def product(self, case: str, kind: str) -> str:
        """File of a case's product."""
        return f"{self.folder}/{case}.{kind}.h5"

    def state(self, case: str) -> str:
        """The state of its compression under the stress of a case."""
        row = self.random[case]
        mu, stress = short(row["mu_comp"]), short(row["stress"])
        return f"{self.folder}/compression_mu{mu}/{stress}Pa.sample.h5"

    @property
    def stresses(self) -> list[str]:
        """Stresses of the random cases, Pa, and the lowest, of which the paper has numbers too."""
        return sorted({"1000", *(short(r["stress"]) for r in self.random.values())}, key=float)

    def committed(self, case: str) -> str | None:
        """The committed sample that a case starts from; not where it has a state of its own."""
        own = self.reduced or self.another_seed or self.config["from_scratch"]
        if own or Path(self.state(case)).exists():
            return None
        path, row = SAMPLES / f"{case}.sample.h5", self.random[case]
        if not path.exists() or any(
            noted(path, name) not in (None, float(row[name])) for name in ("stress", "mu_comp")
        ):
            return None
        return str(path)

    def ready(self, case: str) -> bool:
        """Whether the committed sample is at rest with the friction of the wave."""
        path = self.committed(case)
        friction = float(self.random[case]["mu_wave"])
        return path is not None and noted(Path(path), "mu_wave") in (None, friction)

    def start(self, case: str) -> str:
        """What the sample of a random case is made from."""
        return self.committed(case) or self.state(case)

    def settings(self, *columns: str) -> Callable[[Any], dict[str, str]]:
        """Settings of a case's line that shape a product: a change of one makes it again."""
        return lambda w: {name: self.rows[w.case].get(name, "") for name in columns}

    def width(self, mu: str) -> float:
        """Width of a compression, diameters: as long for its width as that of the table."""
        full = float(self.compressions[mu]["width"])
        return round(full * (self.config["spheres"] / FULL) ** (1 / 3), 4)

    def compression(self, mu: str) -> dict[str, str]:
        """The line of a compression with friction, of the study's size and seed."""
        row = self.compressions[mu]
        if not (self.reduced or self.another_seed):
            return row
        own = {"spheres": self.config["spheres"], "width": self.width(mu)}
        return row | {n: str(v) for n, v in (own | {"seed": self.config["seed"]}).items()}

    def noted_of(self, mu: str) -> str:
        """What each state of a compression notes of it, as link_states.py takes it."""
        row = self.compression(mu)
        return " ".join(f"{name}={quote(word(cell))}" for name, cell in row.items())

    def walk(self, mu: str) -> str:
        """Command of a compression with friction, which keeps its states in walks/."""
        table, row, made = "cases/compressions.table", self.compression(mu), ""
        walks = f"{self.folder}/walks"
        if row != self.compressions[mu]:  # a line of its own in the place of the table's
            table = f"{walks}/mu{mu}.table"
            made = f"printf '%s\\n' '{' '.join(row)}' '{' '.join(row.values())}' > {table} && "
        if self.config["preparation"] == "yade":
            log = f"{self.folder}/log/states/{mu}.yade.log"
            last = f"{walks}/compression_mu{mu}/{self.stresses[-1]}Pa.sample.h5"
            job = f"workflow/yade_job.sh {table} {mu} yade_scripts/compress.py {walks} {log}"
            return f"{made}{job} {last}"
        own = {name: word(cell) for name, cell in row.items() if name != "mu_comp"}
        given = " ".join(f"{option_of(name)} {text}" for name, text in own.items())
        return f"{PYTHON} -m modal pack --friction {mu} {given} -o {walks}/compression_mu{mu}"

    def of_yade(self) -> set[str]:
        """Rules that need YADE."""
        walks = {"states"} if self.config["preparation"] == "yade" else set()
        return {"crystal", "network", "yade_wave", "further_wave"} | walks

    def amplitude(self, case: str) -> str:
        """Half the wall's stroke, m: the case's own, or the study's."""
        return str(self.rows[case].get("amplitude", self.config["amplitude"]))

    def of_wave(self, case: str) -> str:
        """Environment of a YADE wave: its amplitude, and what the caller has set."""
        found = {f"WAVE_{name}": os.environ.get(f"WAVE_{name}") for name in OF_WAVE}
        found["WAVE_AMPLITUDE"] = found["WAVE_AMPLITUDE"] or self.amplitude(case)
        return " ".join(f"{name}={quote(text)}" for name, text in found.items() if text)

    def band(self, case: str) -> tuple[float, float]:
        """Hz between which the modes of a case's band lie."""
        low, high = self.config["bands"].get(case, self.config["band"])
        if not low < high:
            raise ValueError(f"{case}: band {low:g} to {high:g} Hz is empty; give low, high")
        return low, high

    def bands(self) -> list[str]:
        """Modes of a band, of the cases whose band the study shows."""
        return [
            self.product(case, "band.modes") for case in self.cases if case in self.config["bands"]
        ]

    def duration(self, case: str) -> float:
        """Seconds in which a wave goes from wall to wall, and somewhat more."""
        stress = float(self.rows[case]["stress"])
        slowest = 1.2e-3 * (self.config["spheres"] / FULL) ** (1 / 3)
        if case in self.crystals:
            layers = float(self.rows[case].get("layers", self.config["crystal_layers"]))
            slowest = 5e-4 * layers / LAYERS
        return round(slowest * (1e5 / stress) ** (1 / 6), 7)

    def files(self, case: str, stage: str) -> list[str]:
        """Files that a stage makes of a case; none where it has no such stage."""
        if stage == "state":
            return [self.state(case)] if case in self.random and not self.committed(case) else []
        kinds = CRYSTAL_KINDS if case in self.crystals else RANDOM_KINDS
        return [self.product(case, kind) for kind in kinds.get(stage, [])]

    def whole(self, *stages: str) -> list[str]:
        """Files of these stages, of all cases."""
        return [path for case in self.cases for stage in stages for path in self.files(case, stage)]

    def further(self) -> list[str]:
        """Files of the further stages that are there."""
        return [path for path in self.whole(*FURTHER) if Path(path).exists()]

    def shown(self) -> list[str]:
        """What the study's page shows where it is there: splits, other seeds, states at 1 kPa."""
        splits = [path for path in self.splits() if Path(path).exists()]
        patterns = "seed_*/case*.h5", "compression_mu*/1000Pa.sample.h5"
        found = [path for pattern in patterns for path in Path(self.folder).glob(pattern)]
        return [*splits, *self.further(), *sorted(map(str, found))]

    def splits(self) -> list[str]:
        """Differences of each case between YADE's wave and the linear one, by cause."""
        return [f"{self.folder}/{case}.agreement.md" for case in self.cases]

    def other_pulses(self) -> list[str]:
        """Waves with the pulse of 100 kHz, of the cases whose own pulse is another."""
        cases = (c for c in self.cases if float(self.rows[c]["input_frequency"]) != 1e5)
        return [self.product(case, "100kHz.signals") for case in cases]

    def targets(self) -> list[str]:
        """What is asked for by the cases and the stage."""
        stage = self.config["stage"]
        if stage == "analysis":
            return [f"{self.folder}/report/{case}.txt" for case in self.cases]
        if stage == "report":
            return [f"{self.folder}/report/report.html"]
        if stage == "study":
            return [f"{self.folder}/study/study.html", *self.whole("linear")]
        if stage == "split":
            return self.splits()
        return self.whole(stage)

    def kind(self, case: str | None) -> str:
        """What a case's costs are like; walks, and what is made of many cases, are as random."""
        return "crystal" if case in self.crystals else "random"

    @cached_property
    def costs(self) -> dict[tuple[str, str], Cost]:
        """What a job of each rule may take, by the kind of its case."""
        layers = self.config["crystal_layers"] / LAYERS
        sizes = {"random": self.config["spheres"] / FULL, "crystal": layers}
        return expected(Path(self.folder), sizes, self.kind)

    def expected(self) -> dict[str, float]:
        """Seconds that a job of each rule may take, the mean over the study's cases."""
        kinds = [self.kind(case) for case in self.cases]
        found: dict[str, float] = {}
        for rule in {rule for rule, _ in self.costs}:
            of = {kind: cost.seconds for (name, kind), cost in self.costs.items() if name == rule}
            seconds = [of[kind] for kind in kinds if kind in of] or [*of.values()]
            found[rule] = sum(seconds) / len(seconds)
        return found

    def needs(self, rule: str) -> dict[str, Any]:
        """What a rule's jobs ask for."""
        return resources(lambda w: self.costs[rule, self.kind(getattr(w, "case", None))])


def check(config: Mapping[str, Any]) -> None:
    """ValueError, in one line, where settings are not as study.schema.yaml says."""
    path = Path(__file__).with_name("study.schema.yaml")
    schema = Draft202012Validator(yaml.safe_load(path.read_text()))
    for error in schema.iter_errors(config):
        name = ".".join(str(part) for part in error.path) or "settings"
        raise ValueError(f"{name}: {error.message}; workflow/{path.name} says what may stand there")


@cache
def noted(path: Path, name: str) -> float | None:
    """What a sample notes of itself in its study; None where that cannot be read."""
    try:
        with h5py.File(path) as file:
            return float(file["study"].attrs[name])
    except (OSError, KeyError):
        return None


def one_of(names: Any) -> str:
    """Pattern of a wildcard that is one of these; none is like nothing."""
    return "|".join(names) or "none"


PYTHON = ".venv/bin/python" if Path(".venv/bin/python").exists() else sys.executable
"""The project's Python, on every node; by the same name wherever the project lies."""
