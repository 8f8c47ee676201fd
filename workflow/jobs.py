"""Find what the rules need to know of a study: files, commands and resources of its cases.

The Snakefile and run.py read this module. The cases and their settings are defined in the study's
YAML (`analysis.study.description`).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
from case_names import choose_cases, pattern_of_cases, refuse_other_path, refuse_reserved_name
from commands import FULL, FURTHER, OF_NETWORK, RULES, quoted
from starting_states import StartingStates

from analysis.study.description import Study
from modal.tools.errors import InputError, refuse_unknown

SPHERES_PER_LAYER = 16
"""Number of spheres in a layer of a crystal."""
MIN_SPHERES = 750
"""Number of spheres of the smallest packing that is wide enough: 4 diameters across."""
REDUCED_LAYERS = 40
"""Number of layers of the crystals of a reduced study."""
REDUCED_RESIDUAL = 1e-4
"""Residual of reduced packings, divided by the contact force. Where ten times as much is left, few
contacts creep so far as they come to rest that a stress can fall by a tenth."""
MAX_SPHERES_AT_ONCE = 3000
"""Largest number of spheres of packings that are made and measured in one process: the start of a
program would take half of each of their jobs."""
STUDY_FREQUENCY = 1e5
"""Frequency of the pulse, Hz, that crystals of other frequencies have as well, for one figure."""
STAGES = RULES["stages"]
ON_REQUEST = ("linear.signals", "shear.signals", "moduli")
"""Products that are made only if their stage is requested."""


class Jobs(StartingStates):
    """The jobs of a study in one folder of products.

    `config` is Snakemake's configuration: study, products and, if set, stage, cases, spheres, seed
    and from_scratch. Raises InputError if one of these settings, or the study, is invalid.

    Attributes
    ----------
    rows : dict
        Settings of all cases by name.
    cases : list of str
        Names of the requested cases.
    stage : str
        The last stage to be made for the requested cases.
    reduced : bool
        Whether random packings have the number of spheres in `config`.
    from_scratch : bool
        Whether random cases start from a cloud, not from committed samples.
    at_once : bool
        Whether one process makes and measures a case.
    """

    def __init__(self, config: Mapping[str, Any]) -> None:
        for name in ("study", "products"):
            refuse_other_path(f"--{name}", config[name])
        self.study = Study(config["study"])
        settings = self.study.settings
        self.folder = config["products"]
        self.stage = config.get("stage", "page")
        refuse_unknown("--stage", self.stage, (*STAGES, "split", "result", "page"))
        self.reduced = "spheres" in config
        spheres = int(config.get("spheres", MIN_SPHERES))
        if spheres < MIN_SPHERES:
            raise InputError(
                "too_few_spheres",
                f"--spheres {config['spheres']}",
                f"at least {MIN_SPHERES}, 4 diameters across",
            )
        self.seed = int(config["seed"]) if "seed" in config else None
        few = self.reduced and spheres <= MAX_SPHERES_AT_ONCE and not settings["forget"]
        self.at_once = few and self.stage in ("result", "page")
        self.from_scratch = (
            bool(config.get("from_scratch")) or self.reduced or self.seed is not None
        )
        self.prepare = "modal" if self.reduced else settings["prepare"]
        self.rows = self.study.rows
        for number, case in enumerate(self.rows, 1):
            refuse_reserved_name(case)
            self._complete_row(number, self.rows[case], spheres)
        costs = Path(__file__).with_name("costs.tsv")
        self.costs = pd.read_csv(costs, sep="\t", comment="#", index_col="rule")
        self.cases = choose_cases(config.get("cases"), self.rows)

    def _complete_row(self, number: int, row: dict[str, Any], spheres: int) -> None:
        """Add a case's number and the study's defaults to its settings.

        A case of a reduced study has the number of `spheres`.
        """
        settings = self.study.settings
        full_spheres = row.setdefault("spheres", settings["spheres"])
        row["case"] = number
        row["seed"] = self.seed or row.get("seed", settings["seed"])
        row.setdefault("amplitude", settings["amplitude"])
        if row["kind"] == "fcc":
            row["layers"] = row.get("layers", settings["layers"])
            if self.reduced:
                row["layers"] = REDUCED_LAYERS
            row["spheres"] = SPHERES_PER_LAYER * row["layers"]
        elif self.reduced:
            row["spheres"] = spheres
            row.setdefault("residual", REDUCED_RESIDUAL)
            if row.get("width") is not None:
                scale = (row["spheres"] / full_spheres) ** (1 / 3)
                row["width"] = round(row["width"] * scale, 4)

    def pattern(self, cases: Iterable[str]) -> str:
        """Return a regular expression of the names of some cases of the study."""
        return pattern_of_cases(cases, self.rows)

    @cached_property
    def forgotten(self) -> list[str]:
        """Return the cases whose packings are removed as soon as they are measured, to save space.

        Raises InputError if the study has several stresses, or cases without friction.
        """
        if not self.study.settings["forget"]:
            return []
        if len(self.stresses) > 1 or not all(row["mu_comp"] > 0 for row in self.rows.values()):
            raise InputError(
                "forget", "forget", "is for one stress, and with friction", "leave it out"
            )
        return list(self.rows)

    def product_kinds(self, case: str) -> list[str]:
        """Return the kinds of product that a case's result is measured from."""
        row = self.rows[case]
        kinds = list(self.study.settings["make"].get(row["kind"], []))
        if case in self.study.settings["bands"]:
            kinds.append("band.modes")
        if row.get("input_frequency", STUDY_FREQUENCY) != STUDY_FREQUENCY and "signals" in kinds:
            kinds.append("100kHz.signals")
        if self.seed is not None:
            kinds = [kind for kind in kinds if kind in ("sample", "network", "highest.modes")]
        return kinds or ["sample"]

    def outputs(self, rule: str) -> list[str]:
        """Return the files that a rule of `OF_NETWORK` makes, as patterns for all cases."""
        kinds = OF_NETWORK[rule]["cases"]
        cases = self.pattern(case for case, row in self.rows.items() if row["kind"] in kinds)
        return [self.product(f"{{case,{cases}}}", kind) for kind in OF_NETWORK[rule]["makes"]]

    def product_commands(self, case: str) -> list[str]:
        """Return the commands that make all products that a case's result is measured from."""
        kind = self.rows[case]["kind"]
        kinds = self.product_kinds(case)
        has_wave = "signals" in kinds
        if kind == "random":
            packing = "sample"
            commands = [f"- {self.relax_command(case, self.starting_state(case))}"]
        else:
            packing = "network"
            commands = [self.yade_command(case, "sample_fcc", "network", "crystal")]
        if has_wave or "highest.modes" in kinds:
            commands.append(self.network_command("highest_mode", case, packing))
        if kind == "random" and has_wave:
            commands.append(self.yade_command(case, "sample_and_wave", "signals", "export", "wave"))
        elif kind == "random" and kinds != ["sample"]:
            commands.append(self.yade_command(case, "export_sample", "network", "export"))
        elif has_wave:
            commands.append(self.yade_command(case, "wave", "signals", "wave"))
        for run in FURTHER:
            if f"{run}.signals" in kinds:
                commands.append(self.further_wave_command(case, run))
        for name, rule in OF_NETWORK.items():
            if name != "highest_mode" and kind in rule["cases"] and rule["makes"][0] in kinds:
                commands.append(self.network_command(name, case))
        return commands

    def result_inputs(self, case: str) -> list[str]:
        """Return the files from which a case's result is made.

        They are the files of the kinds of product that a result needs, and the existing ones of the
        products that are made on request.
        """
        files = [self.product(case, kind) for kind in dict.fromkeys(self.product_kinds(case))]
        further = [self.product(case, kind) for kind in ON_REQUEST]
        return files + [path for path in further if Path(path).exists()]

    def measured_from(self, case: str) -> list[str]:
        """Return the files that must exist before the job that measures a case."""
        if not self.at_once:
            return self.result_inputs(case)
        if self.rows[case]["kind"] == "random":
            return [self.starting_state(case)]
        return []

    def measure_commands(self, case: str, files: Sequence[str]) -> list[str]:
        """Return the commands that measure a case from its files.

        If one process makes and measures a case, they also make these files.
        """
        words = ["analysis", "study", self.study.path, *files, "--measure", case]
        words += ["--products", self.folder, "-o", f"{self.results}/{case}.json"]
        if self.seed is not None and not self.study.settings["measure"]:
            words.append("--scatter")
        commands = self.product_commands(case) if self.at_once else []
        return [*commands, quoted(*words)]

    def commands_from_cloud(self, case: str) -> list[str]:
        """Return the commands that make a packing, bring it to rest and measure it."""
        walk = self.walk_of(case)
        state = f"{self.walk_folder(walk)}/{self.rows[case]['stress']:g}Pa.sample.h5"
        return [
            f"- {self.pack_command(walk)}",
            self.relax_command(case, state),
            *self.measure_commands(case, [self.product(case, "sample")]),
        ]

    @property
    def results(self) -> str:
        """Return the folder of results; that of another seed lies in the study's own."""
        folder = Path(self.folder)
        if self.seed is None:
            return str(folder / "results")
        return str(folder.parent / f"results/seed_{self.seed}")

    def page_inputs(self) -> list[str]:
        """Return the results from which the page is made.

        They are the results of all cases and states, and the existing ones of other seeds and of
        comparisons with the linear wave.
        """
        files = [f"{self.results}/{case}.json" for case in self.cases]
        files += [f"{self.results}/{state}.json" for state in self._states_of_page()]
        for pattern in ("seed_*/*.json", "*.agreement.csv"):
            files += sorted(map(str, Path(self.results).glob(pattern)))
        return files

    def _states_of_page(self) -> list[str]:
        """Return the names of states that are not cases of the study but are shown on the page.

        No compression is made for such a state alone: if all cases of a compression start from
        finished samples, the state is shown only if it also has a finished sample.
        """
        if self.seed is not None:
            return []
        cases = [case for case in self.cases if self.rows[case]["kind"] == "random"]
        names = []
        for walk in sorted({self.walk_of(case) for case in cases}):
            has_finished_samples = all(map(self.committed_sample, self.walks[walk]))
            for stress in sorted(set(map(float, self.study.settings["states"]))):
                if self.finished_state(walk, stress) or not has_finished_samples:
                    names.append(f"{walk}_{stress:g}Pa")
        return names

    def targets(self) -> list[str]:
        """Return the files to be made for the requested cases up to the requested stage."""
        if self.stage == "page":
            return [f"{self.folder}/study/study.html"]
        if self.stage == "result":
            return [f"{self.results}/{case}.json" for case in self.cases]
        if self.stage == "split":
            return [f"{self.results}/{case}.agreement.csv" for case in self.cases]
        files = []
        for case in self.cases:
            possible = {*self.product_kinds(case), *ON_REQUEST}
            files += [self.product(case, kind) for kind in STAGES[self.stage] if kind in possible]
        return files

    def needs(self, rule: str) -> dict[str, Callable[..., int]]:
        """Return the resources of a rule's jobs by their size: memory, MB, and time, minutes.

        Each is a function of the wildcards and of the attempt; a later attempt gets more.
        """
        cost = self.costs.loc[rule]

        def size(wildcards: Any) -> float:
            case = getattr(wildcards, "case", None)
            if case is None and hasattr(wildcards, "walk"):
                case = self.walks.get(wildcards.walk, [None])[0]
            return self.rows[case or self.cases[0]]["spheres"] / FULL

        def mem_mb(wildcards: Any, attempt: int) -> int:
            return int(attempt * 1.5 * (cost["m"] + cost["n"] * size(wildcards)))

        def runtime(wildcards: Any, attempt: int) -> int:
            seconds = cost["s"] + cost["b"] * size(wildcards) ** cost["p"]
            return int(attempt * (10 + seconds / 30))

        return {"mem_mb": mem_mb, "runtime": runtime}
