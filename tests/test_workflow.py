"""The study's rules: what a dry run plans. Nothing is run, so YADE is not needed."""

from __future__ import annotations

import importlib
import importlib.util
import math
import os
import re
import resource
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
from places import ROOT

from modal.cli.main import parser

pytest.importorskip("snakemake")
yaml = pytest.importorskip("yaml")
LEFT_BEHIND = (".git", ".venv", ".snakemake", "products", "__pycache__", "*.egg-info")
ALL, SOME = list(range(1, 33)), [3, 11, 12, 16]
STATES = ["1000Pa", "10000Pa", "100000Pa", "1e+06Pa", "1e+07Pa"]
FRICTIONS = ["0.01", "0.05"]
OF_CASE = ["highest.modes", "signals", "linear.signals", "modes", "response"]


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    """A copy of the project, without products and without Snakemake's own notes."""
    folder = tmp_path_factory.mktemp("study") / "project"
    shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*LEFT_BEHIND))
    return folder


def snakemake(folder: Path, *arguments: str, **settings: object) -> subprocess.CompletedProcess:
    """Run Snakemake in a project; settings override study.yaml."""
    command = [sys.executable, "-m", "snakemake", "-s", "workflow/Snakefile", "--cores", "2"]
    pairs = [f"{name}={value}".replace(" ", "") for name, value in settings.items()]
    variables = os.environ | {"PYTHONPATH": f"{folder}/workflow"}
    return subprocess.run(
        [*command, "--logger", "study", *arguments, "--config", *pairs],
        cwd=folder,
        env=variables,
        capture_output=True,
        text=True,
    )


def plan(folder: Path, *arguments: str, **settings: object) -> list[tuple[str, str]]:
    """Rule and product of each job of a dry run."""
    done = snakemake(folder, "--dry-run", *arguments, **settings)
    assert done.returncode == 0, done.stderr + done.stdout
    return re.findall(r"^(\w+) +(\S+?)(?: \(.*\))?: ", done.stdout.replace("plan: ", "plan "), re.M)


def planned(folder: Path, *arguments: str, **settings: object) -> dict[str, int]:
    """Number of jobs of each rule in a dry run."""
    rules = [rule for rule, _ in plan(folder, *arguments, **settings)]
    return {rule: rules.count(rule) for rule in rules}


def module(name: str) -> ModuleType:
    """A module of the workflow, which is no package."""
    spec = importlib.util.spec_from_file_location(name, ROOT / f"workflow/{name}.py")
    found = importlib.util.module_from_spec(spec)
    sys.modules[name] = found
    spec.loader.exec_module(found)
    return found


@pytest.fixture
def in_workflow(monkeypatch) -> None:
    """The modules of the workflow find one another."""
    monkeypatch.syspath_prepend(str(ROOT / "workflow"))
    monkeypatch.chdir(ROOT)


def test_a_crystal_needs_no_walk(study):
    jobs = planned(study, cases=[2])
    assert jobs == dict.fromkeys(jobs, 1)
    assert {"crystal", "yade_wave", "response", "all_modes", "translations"} < jobs.keys()
    assert not {"states", "sample", "network"} & jobs.keys()


def test_moduli_and_shear_waves_are_made_on_request(study):
    """No part of the study unless their files are asked for; then from the case's network."""
    assert not {"moduli", "shear_wave", "band_modes"} & planned(study, cases=[30]).keys()
    kinds = "moduli", "shear.signals", "band.modes"
    asked = [f"products/case30.{kind}.h5" for kind in kinds]
    jobs = planned(study, *asked, cases=[30])
    assert jobs["moduli"] == jobs["shear_wave"] == jobs["band_modes"] == jobs["network"] == 1
    assert "yade_wave" not in jobs
    for stage, rule in (("moduli", "moduli"), ("shear", "shear_wave")):
        assert planned(study, cases=[2, 30], stage=stage)[rule] == 2
    jobs = planned(study, "products/case30.shear_yade.signals.h5", cases=[30])
    assert jobs["further_wave"] == 1 and "shear_wave" not in jobs


def test_a_case_may_have_a_band_of_its_own(study, in_workflow):
    """Case 6: all modes to 20 kHz; case 7: the band of all; an empty one is refused."""
    config = yaml.safe_load((study / "workflow/study.yaml").read_text())
    of = module("study").Study
    assert of(config).band("case06") == (0, 20000)
    assert of(config).band("case07") == tuple(config["band"])
    with pytest.raises(ValueError, match="case07: band 3 to 2 Hz is empty"):
        of(config | {"bands": {"case07": [3, 2]}}).band("case07")


def test_a_committed_sample_spares_the_walk_unless_told_otherwise(study):
    assert not {"states", "sample"} & planned(study, cases=[30]).keys()
    jobs = planned(study, cases=[30], from_scratch=True)
    assert jobs["states"] == jobs["sample"] == jobs["network"] == 1
    assert "committed_sample" not in jobs


def test_a_committed_sample_with_another_friction_is_brought_to_rest_with_it(study):
    table = study / "cases/random.table"
    before = table.read_text()
    table.write_text(before.replace("\n30 0.4 0.5 ", "\n30 0.4 0.6 "))
    try:
        jobs = planned(study, cases=[30])
    finally:
        table.write_text(before)
    assert jobs["sample"] == 1 and not {"states", "committed_sample"} & jobs.keys()


def test_the_whole_study_walks_once_for_each_friction(study):
    """32 cases; of seven frictions two have their samples committed; in seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    jobs = planned(study, cases=ALL, stage="study")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    # 1.5 s on a free core; the study as a whole is to be planned in 10.
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 10
    assert (jobs["crystal"], jobs["network"], jobs["yade_wave"]) == (4, 28, 32)
    assert jobs["further_wave"] == 2  # of 100 kHz, where the crystal's own pulse is of 200 kHz
    assert (jobs["states"], jobs["committed_sample"], jobs["sample"]) == (5, 8, 20)
    assert jobs["band_modes"] == 2  # chi_z of a dense and a loose packing
    jobs = planned(study, cases=ALL, stage="study", from_scratch=True)
    assert jobs["states"] + jobs["frictionless_states"] == 7
    assert jobs["sample"] == 28 and "committed_sample" not in jobs


def test_the_compiled_twin_needs_yade_for_no_walk(study):
    def command(**settings: object) -> str:
        options = ("--dry-run", "--printshellcmds", "--logger")
        arguments = [option for option in options if option != "--logger"]
        done = subprocess.run(
            [
                *(sys.executable, "-m", "snakemake", "-s", "workflow/Snakefile", "--cores", "1"),
                *(*arguments, "--config", "cases=[9]", "stage=state"),
                *(f"{name}={value}" for name, value in settings.items()),
            ],
            cwd=study,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout + done.stderr

    assert "yade_job.sh cases/compressions.table 0.01" in command()
    # 14.45 diameters for 35,201 spheres; as long for its width with fewer.
    twin = command(preparation="modal", spheres=1000)
    assert "modal pack --friction 0.01 --spheres 1000 --width 4.4091 --seed 1" in twin
    # YADE takes a smaller packing from a table of one line, the committed one's in all else.
    reduced = command(spheres=1000)
    assert (
        "'mu_comp spheres width seed' '0.01 1000 4.4091 1' > products/walks/mu0.01.table" in reduced
    )
    assert "yade_job.sh products/walks/mu0.01.table 0.01" in reduced


def test_a_split_needs_six_further_waves(study):
    jobs = planned(study, cases=[6], stage="split")
    assert (jobs["yade_wave"], jobs["further_wave"], jobs["agreement"]) == (1, 6, 1)
    assert "further_wave" not in planned(study, cases=[6], stage="analysis")


def test_half_the_step_has_the_times_of_the_whole():
    """As yade_scripts/wave.py chooses step, records and end, for steps short and long of 0.5 us."""
    further_waves = module("further_waves")
    arrival = 6e-4
    for f_max in (1.4e5, 2.15e5, 4.5e5):
        times = []
        own = {"case": "6", "fraction": "0.2", "passage": "1.3"}
        half = further_waves.table(own, "half_step", 2.5e-9)
        for row in (own, dict(zip(*map(str.split, half), strict=True))):
            step = float(row["fraction"]) / (math.pi * f_max)
            every = max(1, int(float(row.get("interval", 5e-7)) / step))
            steps = math.ceil(float(row["passage"]) * arrival / step) + 1
            times.append([step * k for k in range(0, steps + 1, every)])
        step = float(own["fraction"]) / (math.pi * f_max)
        assert all(min(abs(t - own) for t in times[1]) < 1e-6 * step for own in times[0])


def test_another_seed_takes_no_committed_sample_and_another_cloud(study):
    jobs = planned(study, cases=[30], seed=2, stage="sample")
    assert jobs == {"states": 1, "sample": 1, "network": 1}
    own = planned(study, cases=[30], stage="sample")
    assert own == {"committed_sample": 1, "network": 1}


@pytest.fixture
def made(study) -> Path:
    """Some cases with files of all products' names that Snakemake takes for its own."""
    products = study / "products"
    paths = [products / f"compression_mu{mu}/{s}.sample.h5" for mu in FRICTIONS for s in STATES]
    for case in (f"case{number:02d}" for number in SOME):
        random = int(case[4:]) > 4
        own = ["sample", "density", "structure"] if random else ["translations.modes"]
        paths += [products / f"{case}.{kind}.h5" for kind in ("network", *OF_CASE, *own)]
    paths += [products / "case03.100kHz.signals.h5"]
    for path in [*paths, products / "study/study.html"]:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    settings = {"cases": SOME, "stage": "study", "from_scratch": True}
    done = snakemake(study, "--touch", "--forceall", **settings)
    assert done.returncode == 0, done.stderr
    yield study
    shutil.rmtree(products)
    shutil.rmtree(study / ".snakemake")


def test_a_changed_friction_remakes_what_depends_on_it_and_nothing_else(made):
    """Neither its neighbours, which share its compression, nor, for a line more, anything."""
    settings = {"cases": SOME, "stage": "study", "from_scratch": True}
    table = made / "cases/random.table"
    before = table.read_text()
    try:
        table.write_text(f"# a line more\n{before}")
        assert plan(made, **settings) == []
        table.write_text(before.replace("\n12 0.01 0.11 ", "\n12 0.01 0.2 "))
        jobs = plan(made, **settings)
    finally:
        table.write_text(before)
    kinds = ["sample", "network", "density", "structure", *OF_CASE]
    expected = {f"case12.{kind}.h5" for kind in kinds} | {"study.html"}
    assert sorted(name for _, name in jobs) == sorted(expected)


def test_changed_settings_of_the_environment_make_waves_again(made, monkeypatch):
    """As `wave.py` itself holds its product for stale then."""
    monkeypatch.setenv("WAVE_DAMPING", "0.05 0.03")
    jobs = plan(made, cases=[3], stage="wave")
    assert jobs == [("yade_wave", "case03.signals.h5")]
    monkeypatch.delenv("WAVE_DAMPING")
    assert plan(made, cases=[3], stage="wave") == []


@pytest.mark.parametrize(
    "beside",
    [
        "seed_2/case11.network.h5",
        "case12.agreement.md",
        "compression_mu0.1/1000Pa.sample.h5",
        "case11.moduli.h5",
    ],
)
def test_the_page_is_made_again_with_what_it_shows_where_it_is_there(made, beside):
    """Packings of another seed, a split by causes, a state under 1 kPa, moduli; once."""
    path = made / "products" / beside
    path.parent.mkdir(exist_ok=True)
    path.touch()
    settings = {"cases": SOME, "stage": "study", "from_scratch": True}
    try:
        assert plan(made, **settings) == [("study_tables", "study.html")]
    finally:
        path.unlink()
    assert plan(made, **settings) == []


def test_only_what_is_missing_is_planned(made):
    (made / "products/case03.signals.h5").unlink()
    jobs = planned(made, cases=[3], stage="analysis")
    assert jobs == {"yade_wave": 1, "comparison": 1}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("colour", "red"),
        ("cases", []),
        ("cases", [2, 0]),
        ("cases", [2, 2]),
        ("stage", "lunch"),
        ("preparation", "lammps"),
        ("spheres", "many"),
        ("spheres", 500),
        ("from_scratch", "perhaps"),
        ("amplitude", 0),
        ("products", "a b"),
    ],
)
def test_schema_refuses(name, value):
    """And takes the settings as they are committed."""
    yaml, jsonschema = pytest.importorskip("yaml"), pytest.importorskip("jsonschema")
    schema, settings = (
        yaml.safe_load((ROOT / f"workflow/study{end}").read_text())
        for end in (".schema.yaml", ".yaml")
    )
    jsonschema.validate(settings, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(settings | {name: value}, schema)


@pytest.mark.parametrize(
    ("settings", "said"),
    [({"colour": "red"}, "'colour' was unexpected"), ({"spheres": 500}, "500 is less than")],
)
def test_unknown_words_are_refused_in_one_line(study, settings, said):
    done = snakemake(study, "--dry-run", **settings)
    assert done.returncode != 0
    lines = [line for line in done.stderr.splitlines() if not line.startswith("Using ")]
    assert len(lines) == 1 and said in lines[0], lines


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("12 0.02", "add a line to cases/compressions.table"),
        ("12 0.01 0.01", "has 8 values for 7 names"),
    ],
)
def test_line_of_a_table_that_cannot_be_is_said(study, line, said):
    """A friction without a compression, and a value too many."""
    table = study / "cases/random.table"
    before = table.read_text()
    table.write_text(before.replace("\n12 0.01 ", f"\n{line} "))
    try:
        done = snakemake(study, "--dry-run", cases=[12])
    finally:
        table.write_text(before)
    assert done.returncode != 0 and said in done.stderr
    assert "nothing to be made" not in done.stdout


def benchmark(folder: Path, rule: str, case: str, seconds: str, memory: str, busy: str) -> None:
    """What Snakemake notes of a job."""
    path = folder / f"cost/{rule}/{case}.tsv"
    path.parent.mkdir(parents=True, exist_ok=True)
    row = f"{seconds}\t0:30:00\t{memory}\t{busy}"
    path.write_text(f"s\th:m:s\tmax_rss\tcpu_time\n{row}\n")


@pytest.fixture
def in_study(study, in_workflow, monkeypatch) -> Path:
    """The copy of the project, whose tables a test may change."""
    monkeypatch.chdir(study)
    before = {path: path.read_text() for path in Path("cases").glob("*.table")}
    yield study
    for path, text in before.items():
        path.write_text(text)


def changed(table: str, old: str, new: str) -> object:
    """The study with another text in a table."""
    path = Path(f"cases/{table}.table")
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    return module("study").Study(yaml.safe_load(Path("workflow/study.yaml").read_text()))


@pytest.mark.parametrize(
    ("table", "old", "new", "said"),
    [
        ("random", "\n12 0.01 ", "\n13 0.01 ", "case 13 stands there twice"),
        ("random", "\n12 0.01 ", "\n2 0.01 ", "case02: a line in each of the tables"),
        ("random", "\n12 0.01 ", "\n12.5 0.01 ", "case 12.5 is no whole number"),
        ("random", "case mu_comp mu_wave", "case mu_comp friction", "lacks the column mu_wave"),
        ("random", "case mu_comp", "number mu_comp", "names no column case"),
        ("random", "fraction passage", "fraction fraction", "names a column twice"),
        ("random", "fraction passage", "fractoin passage", "fractoin means nothing; known are"),
        ("random", "\n12 0.01 0.11", "\n12 0.01 0,11", "case12: mu_wave 0,11 is no number"),
        ("random", "\n12 0.01 0.11 1e7", "\n12 0.01 0.11 5e6", "has states at 1000, 10000, "),
        ("compressions", "\n0.4 ", "\n0.40 35201 14 1\n0.4 ", "mu_comp 0.4 stands there twice"),
    ],
)
def test_tables_that_mean_no_study_are_refused(table, old, new, said, in_study):
    with pytest.raises(ValueError, match=said):
        changed(table, old, new)


def test_columns_of_a_case_shape_both_of_its_waves(in_study):
    """Amplitude, direction and length of a crystal; the other case has the study's."""
    names = "case mu_comp mu_wave stress input_frequency amplitude direction layers"
    Path("cases/fcc.table").write_text(f'{names}\n2 0 0.1 1e5 1e5 1e-9 "x" 100 # short\n')
    study = changed("random", "\n12 ", "\n012\t")
    assert study.crystals.keys() == {"case02"} and "case12" in study.random
    assert "WAVE_AMPLITUDE=1e-9" in study.of_wave("case02")
    assert "WAVE_AMPLITUDE=2.5e-09" in study.of_wave("case12")
    linear = module("of_network").commands(study)["linear_wave"][2]
    own, other = (linear(SimpleNamespace(case=case), "N", "W") for case in ("case02", "case12"))
    assert "--direction x --amplitude 1e-9 " in own and "--direction" not in other
    # A crystal of 100 layers is half as long as the study's; an S-wave takes twice a P-wave's time.
    assert "--duration 0.0005 " in own


def test_a_mixture_is_prepared_by_either_program(in_study):
    """The texts of a compression's columns, as YADE reads them, are options of its twin."""
    table = Path("cases/compressions.table")
    table.write_text("mu_comp spheres width seed sizes\n0.40 1500 6 1 'two_2_0.5'\n")
    config = yaml.safe_load(Path("workflow/study.yaml").read_text())
    yade, twin = (
        module("study").Study(config | {"preparation": program}) for program in ("yade", "modal")
    )
    assert "--spheres 1500 --width 6 --seed 1 --sizes two 2 0.5 -o" in twin.walk("0.4")
    assert f"{table} 0.4 yade_scripts/compress.py" in yade.walk("0.4")
    assert "sizes='two 2 0.5'" in yade.noted_of("0.4")


def test_costs_of_a_rule_are_those_of_its_jobs(tmp_path):
    """The benchmarks that Snakemake writes: core-hours are their sum, by clock and processor."""
    cost = module("cost")
    benchmark(tmp_path, "yade_wave", "case01", "1800.0", "50.5", "900.0")
    benchmark(tmp_path, "yade_wave", "case02", "5400.0", "NA", "NA")
    found = cost.measured(tmp_path, lambda case: "crystal")["yade_wave", "crystal"]
    assert (found.jobs, found.seconds, found.longest, found.memory) == (2, 3600, 5400, 50.5)
    assert found.busy == (900 + 5400) / 2  # where the processor's time was not noted, the clock's
    assert re.search(r"^all +2 +2\.0000 +1\.7500$", cost.table(tmp_path), re.M)


def asked(folder: Path, rule: str, case: str, attempt: int = 1, **settings: object) -> list[int]:
    """Minutes and MB that a job of the study asks for."""
    config = yaml.safe_load((ROOT / "workflow/study.yaml").read_text())
    of = module("study").Study(config | {"products": str(folder)} | settings)
    needs = of.needs(rule)
    return [needs[name](SimpleNamespace(case=case), attempt) for name in ("runtime", "mem_mb")]


COMMITTED = [line.split() for line in (ROOT / "results/study/cost.txt").read_text().splitlines()]


@pytest.mark.parametrize("measured", COMMITTED[1:-1], ids=lambda line: line[0])
def test_a_fresh_clone_asks_for_what_was_measured_at_full_size(measured, in_workflow, tmp_path):
    """Longest job and most memory of a rule, of all 32 cases (results/study/cost.txt).

    The second try asks for twice of both.
    """
    crystal = measured[0] in ("crystal", "all_modes", "translations")
    case = "case02" if crystal else "case30"
    minutes, memory = asked(tmp_path, measured[0], case)
    assert minutes > float(measured[-2]) / 60 and memory > float(measured[-1])
    assert asked(tmp_path, measured[0], case, 2) == [2 * minutes, 2 * memory]


@pytest.mark.parametrize(
    ("rule", "case", "memory"),
    [("crystal", "case01", 521), ("network", "case10", 523), ("yade_wave", "case10", 538)],
)
def test_a_small_study_asks_for_what_yade_takes_of_its_own(
    rule, case, memory, in_workflow, tmp_path
):
    """MB as Snakemake noted them of 1,000 spheres and of 40 layers: YADE and yade-batch, loaded."""
    small = {"spheres": 1000, "crystal_layers": 40, "preparation": "modal"}
    assert asked(tmp_path, rule, case, **small)[1] > memory


def test_crystals_that_ran_first_say_nothing_of_random_packings(in_workflow, tmp_path):
    """Quick small jobs lower no request; longer and larger ones raise that of their own kind."""
    before = {case: asked(tmp_path, "yade_wave", case) for case in ("case02", "case30")}
    benchmark(tmp_path, "yade_wave", "case01", "4.0", "30", "4.0")
    assert before == {case: asked(tmp_path, "yade_wave", case) for case in before}
    benchmark(tmp_path, "yade_wave", "case03", "7200.0", "9000", "7200.0")
    assert asked(tmp_path, "yade_wave", "case30") == before["case30"]
    minutes, memory = asked(tmp_path, "yade_wave", "case02")
    assert minutes > 120 and memory > 9000
    larger = asked(tmp_path, "states", "case30", spheres=10 * 35201)
    # A walk's steps grow with the length: ten times the spheres, more than ten times the time.
    assert larger[0] > 10 * asked(tmp_path, "states", "case30")[0]


def test_a_job_of_the_convergence_study_asks_for_its_size(study):
    """Not for what Slurm gives by default: memory and time, of all of its rules.

    Its compressions are commands that `pack` takes.
    """
    command = [sys.executable, "-m", "snakemake", "-s", "workflow/convergence.smk", "-n", "-c", "1"]
    options = ["-p", "--config", "table=slender", "seeds=1"]
    done = subprocess.run([*command, *options], cwd=study, capture_output=True, text=True)
    jobs = re.findall(r"^rule (\w+):(?s:.*?)^    resources: (.*)$", done.stdout, re.M)
    known = {rule for rule, resources in jobs if "mem_mb" in resources and "runtime" in resources}
    assert known == {"compression", "rest", "numbers"}, done.stderr
    packed = re.findall(r"-m modal (pack --friction [^)&]*)", done.stdout)
    assert packed and all(parser("pack").parse_args(told.split()).spheres for told in packed)


def test_every_rule_has_an_expected_cost(study):
    listed = snakemake(study, "--list-rules").stdout.split()
    table = (study / "workflow/cost.tsv").read_text().splitlines()
    rules = {line.split()[0] for line in table if line[0] != "#"}
    assert set(listed) - {"all"} == rules - {"rule"}
