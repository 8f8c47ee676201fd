"""What the rules need to know of a study: what a case starts from, its files, a job's command.

Read by the Snakefile alone. Which cases there are, and their settings, stands in the study's YAML
(`analysis.study.description`).
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import h5py
import pandas as pd
from commands import COLUMNS, FULL, FURTHER, OF_NETWORK, RULES, Commands, quoted

from analysis.expressions import short
from analysis.study.description import Study, part_of_name
from modal.tools.errors import InputError, refuse_unknown

ACROSS = 16
"""Spheres of a layer of a crystal."""
LEAST = 750
"""Spheres of the smallest packing that is wide enough."""
LAYERS = 40
"""Of the crystals of a reduced study."""
SETTLED = 1e-4
"""Residual of reduced packings, over contact force: where ten times as much is left, few contacts
creep so far as they come to rest that a stress can fall by a tenth."""
SMALL = 3000
"""Spheres, at most, of packings of which half of a job would be the start of its program."""
STAGES = RULES["stages"]
AS_TYPED = re.compile(r"[\w./+][\w./+-]*", re.ASCII)
"""Paths that stand in rules and commands, and in Snakemake's patterns."""
BEHIND = {
    *(kind.split(".")[0] for kinds in STAGES.values() for kind in kinds),
    *(kind.split(".")[0] for rule in OF_NETWORK.values() for kind in rule["makes"]),
    *(*FURTHER, "network", "agreement", "json", "log", "tsv"),
}
"""Words behind a case's name in the names of its files."""
NO_NAME = rf"\.({'|'.join(map(re.escape, sorted(BEHIND)))})|\dPa"
"""Ends of names that belong to files of cases, or to states."""
ANY = "[^/]+" + "".join(rf"(?<!\.{re.escape(word)})" for word in sorted(BEHIND)) + r"(?<!\dPa)"
"""Pattern of a case's name."""
NOTHING = "(?!)"
"""Pattern that nothing is like."""
ON_REQUEST = "linear.signals", "shear.signals", "moduli"


class Jobs(Commands):
    """The jobs of a study in one folder of products; `config` is Snakemake's."""

    def __init__(self, config: Mapping[str, Any]) -> None:
        for name in ("study", "products"):
            refuse_other_path(f"--{name}", config[name])
        self.study = Study(config["study"])
        own = self.study.settings
        self.folder, self.stage = config["products"], config.get("stage", "page")
        refuse_unknown("--stage", self.stage, (*STAGES, "split", "result", "page"))
        if int(config.get("spheres", LEAST)) < LEAST:
            raise InputError(
                "input", f"--spheres {config['spheres']}", f"at least {LEAST}, 4 diameters across"
            )
        self.reduced = "spheres" in config
        self.seed = int(config["seed"]) if "seed" in config else None
        # All of a case in one process, whose start would be half of each of many jobs.
        few = self.reduced and int(config["spheres"]) <= SMALL and not own["forget"]
        self.at_once = few and self.stage in ("result", "page")
        self.scratch = bool(config.get("from_scratch")) or self.reduced or self.seed is not None
        self.prepare = "modal" if self.reduced else own["prepare"]
        self.rows = self.study.rows
        for case in self.rows:
            if re.search(rf"({NO_NAME})$", case):
                raise InputError("name", f"case {case}", "ends as a file of a case", "rename it")
        for number, row in enumerate(self.rows.values(), 1):
            full = row.setdefault("spheres", own["spheres"])
            row |= {"case": number, "seed": self.seed or row.get("seed", own["seed"])}
            row.setdefault("amplitude", own["amplitude"])
            if row["kind"] == "fcc":
                row["layers"] = LAYERS if self.reduced else row.get("layers", own["layers"])
                row["spheres"] = ACROSS * row["layers"]
            elif self.reduced:
                row["spheres"] = int(config["spheres"])
                row.setdefault("residual", SETTLED)
                if row.get("width") is not None:
                    row["width"] = round(row["width"] * (row["spheres"] / full) ** (1 / 3), 4)
        costs = Path(__file__).with_name("costs.tsv")
        self.costs = pd.read_csv(costs, sep="\t", comment="#", index_col="rule")
        self.cases = _chosen(config.get("cases"), self.rows)

    def of_kind(self, kind: str) -> list[str]:
        """Names of all cases of a kind."""
        return self._by_kind[kind]

    @cached_property
    def _by_kind(self) -> dict[str, list[str]]:
        """Names of all cases of each kind."""
        return {
            kind: [name for name, row in self.rows.items() if row["kind"] == kind]
            for kind in ("fcc", "random")
        }

    def pattern(self, cases: Iterable[str]) -> str:
        """Regular expression of the names of some cases.

        Snakemake tries it on each file, so it does not name thousands: of more than half of all
        cases it names those that are left out.
        """
        wanted = set(cases)
        others = [case for case in self.rows if case not in wanted]
        if not wanted:
            return NOTHING
        if not others:
            return ANY
        if len(wanted) <= len(others):
            return one_of(case for case in self.rows if case in wanted)
        behind = "|".join(map(re.escape, sorted(BEHIND)))
        return rf"(?!({one_of(others)})\.({behind})\b){ANY}"

    def walk_of(self, case: str) -> str:
        """Name of the compression that a random case's state is of."""
        row = self.rows[case]
        parts = [part_of_name(n, row[n]) for n in self.varied if row.get(n) is not None]
        return "_".join([f"mu{row['mu_comp']:g}", *parts])

    @cached_property
    def varied(self) -> list[str]:
        """Columns that tell compressions of one friction apart: a study has several values of them.

        None where cases have numbers: their compressions differ in friction alone.
        """
        random = [self.rows[case] for case in self.of_kind("random")]
        kinds = {
            n: {str(row.get(n)) for row in random} for n in (*COLUMNS["walk"][1:], *COLUMNS["pack"])
        }
        return [n for n in kinds if len(kinds[n]) > 1 and self.study.settings["names"] == ""]

    @cached_property
    def walks(self) -> dict[str, list[str]]:
        """Cases of each compression."""
        found: dict[str, list[str]] = {}
        for case in self.of_kind("random"):
            found.setdefault(self.walk_of(case), []).append(case)
        return found

    @cached_property
    def stresses(self) -> list[float]:
        """Stresses, Pa, of the states of every compression."""
        own = {float(self.rows[case]["stress"]) for case in self.of_kind("random")}
        return sorted(own | set(map(float, self.study.settings["states"])))

    def state(self, walk: str, stress: float) -> str:
        """File of a state."""
        return f"{self.folder}/states/{walk}/{stress:g}Pa.sample.h5"

    def committed(self, case: str) -> str | None:
        """The finished sample that a case starts from; not where it has a state of its own."""
        folder, row = self.study.settings["samples"], self.rows[case]
        path = Path(folder) / f"{case}.sample.h5"
        own = Path(self.state(self.walk_of(case), row["stress"])).exists()
        if self.scratch or own or not folder or not path.exists():
            return None
        same = all(_noted(path, n) in (None, float(row[n])) for n in ("stress", "mu_comp"))
        return str(path) if same else None

    def ready(self, case: str) -> bool:
        """Whether the finished sample is at rest with the friction of the wave."""
        path, friction = self.committed(case), float(self.rows[case]["mu_wave"])
        return path is not None and _noted(Path(path), "mu_wave") in (None, friction)

    def start(self, case: str) -> str:
        """What the sample of a random case is made from."""
        walk = self.walk_of(case)
        return self.committed(case) or self.state(walk, float(self.rows[case]["stress"]))

    @cached_property
    def forgotten(self) -> list[str]:
        """Cases whose packings are removed as soon as they are measured."""
        if not self.study.settings["forget"]:
            return []
        if len(self.stresses) > 1 or not all(row["mu_comp"] > 0 for row in self.rows.values()):
            raise InputError(
                "input", "forget", "is for one stress, and with friction", "leave it out"
            )
        return list(self.rows)

    def made(self, case: str) -> list[str]:
        """Kinds of product that a case's result is measured from."""
        kinds = list(self.study.settings["make"].get(self.rows[case]["kind"], []))
        kinds += ["band.modes"] if case in self.study.settings["bands"] else []
        if self.rows[case].get("input_frequency", 1e5) != 1e5 and "signals" in kinds:
            kinds.append("100kHz.signals")
        if self.seed is not None:
            kinds = [kind for kind in kinds if kind in ("sample", "network", "highest.modes")]
        return kinds or ["sample"]

    def outputs(self, rule: str) -> list[str]:
        """Files of a rule that needs a network alone, as a pattern of its cases each."""
        kinds = OF_NETWORK[rule]["cases"]
        cases = self.pattern(case for case, row in self.rows.items() if row["kind"] in kinds)
        return [self.product(f"{{case,{cases}}}", kind) for kind in OF_NETWORK[rule]["makes"]]

    def on_the_way(self, case: str) -> list[str]:
        """Commands that make all that a case's result is measured from."""
        kind, made = self.rows[case]["kind"], self.made(case)
        random, waves = kind == "random", "signals" in made
        first = f"- {self.rest(case, self.start(case))}"
        commands = [first if random else self.yade(case, "sample_fcc", "network", "crystal")]
        if waves or "highest.modes" in made:
            found_in = "sample" if random else "network"
            commands.append(self.of_network("highest_mode", case, found_in))
        if random and waves:
            commands.append(self.yade(case, "sample_and_wave", "signals", "export", "wave"))
        elif random and made != ["sample"]:
            commands.append(self.yade(case, "export_sample", "network", "export"))
        elif waves:
            commands.append(self.yade(case, "wave", "signals", "wave"))
        commands += [self.further(case, run) for run in FURTHER if f"{run}.signals" in made]
        for rule, own in OF_NETWORK.items():
            if rule != "highest_mode" and kind in own["cases"] and own["makes"][0] in made:
                commands.append(self.of_network(rule, case))
        return commands

    def read(self, case: str) -> list[str]:
        """Files that a case's result is made of: those of its kind, and on request, if there."""
        kinds = dict.fromkeys(self.made(case))
        further = [path for kind in ON_REQUEST if Path(path := self.product(case, kind)).exists()]
        return [*(self.product(case, kind) for kind in kinds), *further]

    def measured_from(self, case: str) -> list[str]:
        """Files that have to be there before."""
        if not self.at_once:
            return self.read(case)
        return [self.start(case)] if self.rows[case]["kind"] == "random" else []

    def measure(self, case: str, files: Sequence[str]) -> list[str]:
        """Commands that measure a case from its files, after what they are made by at once."""
        scatter = self.seed is not None and not self.study.settings["measure"]
        words = ["analysis", "study", self.study.path, *files, "--measure", case]
        words += ["--products", self.folder, "-o", f"{self.results}/{case}.json"]
        if scatter:
            words.append("--scatter")
        own = quoted(*words)
        return [*(self.on_the_way(case) if self.at_once else []), own]

    def from_cloud(self, case: str) -> list[str]:
        """Commands that make a packing, bring it to rest and measure it."""
        walk = self.walk_of(case)
        state = f"{self.walk_folder(walk)}/{self.rows[case]['stress']:g}Pa.sample.h5"
        own = self.measure(case, [self.product(case, "sample")])
        return [f"- {self.pack(walk)}", self.rest(case, state), *own]

    @property
    def results(self) -> str:
        """Folder of the results; other seeds' stand in one of theirs, among the study's own."""
        folder, seed = Path(self.folder), self.seed
        return str(folder / "results" if seed is None else folder.parent / f"results/seed_{seed}")

    def of_page(self) -> list[str]:
        """Results that the page is made of: of all cases and states, and what else is there."""
        found = [f"{self.results}/{case}.json" for case in self.cases]
        random = [case for case in self.cases if self.rows[case]["kind"] == "random"]
        walks = set(map(self.walk_of, random))
        extra = set(map(float, self.study.settings["states"])) if self.seed is None else ()
        # Of a case that starts from a finished sample no compression is made for a state alone.
        found += [
            f"{self.results}/{walk}_{stress:g}Pa.json"
            for walk in sorted(walks)
            for stress in sorted(extra)
            if self.finished(walk, stress) or not all(map(self.committed, self.walks[walk]))
        ]
        there = ("seed_*/*.json", "*.agreement.csv")
        return found + sorted(str(p) for text in there for p in Path(self.results).glob(text))

    def finished(self, walk: str, stress: float) -> str | None:
        """A finished sample of a state that is no case."""
        path = Path(self.study.settings["samples"]) / f"{walk}_{stress / 1e3:g}kPa.sample.h5"
        return str(path) if path.exists() and not self.scratch else None

    def targets(self) -> list[str]:
        """What is asked for, by the cases and the stage."""
        if self.stage == "page":
            return [f"{self.folder}/study/study.html"]
        if end := {"result": "json", "split": "agreement.csv"}.get(self.stage):
            return [f"{self.results}/{case}.{end}" for case in self.cases]
        return [
            self.product(case, kind)
            for case in self.cases
            for kind in STAGES[self.stage]
            if kind in {*self.made(case), *ON_REQUEST}
        ]

    def needs(self, rule: str) -> dict[str, Callable[..., int]]:
        """What a rule's jobs ask for, by their size: memory, MB, and minutes, times the try."""

        row = self.costs.loc[rule]

        def size(w: Any) -> float:
            case = getattr(w, "case", None) or self.walks.get(getattr(w, "walk", ""), [None])[0]
            return self.rows[case or self.cases[0]]["spheres"] / FULL

        def mem_mb(wildcards: Any, attempt: int) -> int:
            return int(attempt * 1.5 * (row["m"] + row["n"] * size(wildcards)))

        def runtime(wildcards: Any, attempt: int) -> int:
            seconds = row["s"] + row["b"] * size(wildcards) ** row["p"]
            return int(attempt * (10 + seconds / 30))

        return {"mem_mb": mem_mb, "runtime": runtime}


def one_of(names: Iterable[str]) -> str:
    """Pattern of a wildcard that is one of these; of none, one that nothing is like."""
    return "|".join(map(re.escape, names)) or NOTHING


def refuse_other_path(name: str, path: object) -> None:
    """InputError for a path that rules and commands cannot have in them as it stands."""
    if not (isinstance(path, str) and AS_TYPED.fullmatch(path)):
        raise InputError(
            "path", f"{name} {short(path)}", remedy="give a path of letters, digits and _ . - + /"
        )


def _chosen(wanted: Any, rows: Mapping[str, Any]) -> list[str]:
    """Cases by name, number or kind; all where none is asked for."""
    called = {name: (name, str(row["case"]), row["kind"], "all") for name, row in rows.items()}
    found: dict[str, None] = {}
    by_word: dict[str, list[str]] = {}
    for name, words in called.items():
        for word in dict.fromkeys(words):
            by_word.setdefault(word, []).append(name)
    for one in wanted or ["all"]:
        some = by_word.get(str(one)) or by_word.get(str(one).lstrip("0"))
        if not some:
            raise InputError(
                "unknown_case",
                f"case {short(one)}",
                f"none of the study's: {[*rows][0]} to {[*rows][-1]}",
            )
        found |= dict.fromkeys(some)
    return list(found)


@cache
def _noted(path: Path, name: str) -> float | None:
    """What a sample notes of itself in its study; None where that cannot be read."""
    try:
        with h5py.File(path) as file:
            return float(file["study"].attrs[name])
    except (OSError, KeyError, TypeError, ValueError):
        return None
