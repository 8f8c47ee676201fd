# What the settings of a compression change: studies/convergence/convergence.table, each row for several seeds.
#
#   snakemake -s workflow/convergence.smk -c 2 --keep-going
#
# Another table of the same columns: --config table=NAME, of studies/convergence/NAME.table, with a folder of its own.
# Beside each state from 100 kPa on stand the same at rest and its numbers; `python -m analysis study *.table` makes
# tables and figures of them. States are kept: a row added later runs alone. Where states are gone and their numbers
# kept (seeds.csv beside the tables), --config first=6 makes the seeds from 6 on, which join the others there.
import sys
from math import pi
from pathlib import Path

from snakemake.exceptions import WorkflowError


workdir: Path(workflow.basedir).parent


sys.path[:0] = [workflow.basedir, str(Path(workflow.basedir).parent)]
from analysis.study.convergence import QUANTITIES, settings_of
from jobs import FULL, PYTHON, resources
from modal.cli.pack import option_of

FOLDER = config.get("folder", "products/convergence")
try:
    settings = settings_of(Path(f"studies/convergence/{config.get('table', 'convergence')}.table"))
except (OSError, ValueError) as error:
    raise WorkflowError(str(error)) from error
NUMBERS = " ".join(QUANTITIES.values())
ROWS = {f"{name}_mu{friction}": row.to_dict() for (name, friction), row in settings.iterrows()}


def needs(rule):
    """What a job of one row asks for: as a rule of the study, by the number of its spheres."""

    return resources(rule, lambda w: int(ROWS[w.row]["spheres"]) / FULL)


STUDY = (
    "mu_comp spheres width approach_rate agitated_damping inertial_number fraction hot_stress damping residual".split()
)


def states(name):
    """Names of the states of one packing, as the compression calls them."""
    return [f"{float(stress):g}" for stress in ROWS[name]["stresses"].split(",")]


def command(w):
    """The compression of one row, by either program."""
    row, folder = ROWS[w.row], f"{FOLDER}/{w.row}/{w.seed}"
    if row["program"] == "minimiser":
        aspect = int(row["spheres"]) * pi / 6 / 0.6 / float(row["width"]) ** 3
        return (
            f"{PYTHON} -m modal pack --spheres {row['spheres']} --aspect {aspect:.4f} --seed {w.seed} "
            f"--peak {row['peak']} --tolerance {row['residual']} --stress {row['stresses']} -o {folder} && "
            f"ln -f {folder}/01_*.sample.h5 {folder}/{float(row['stresses']):g}Pa.sample.h5"
        )
    if row["program"] == "modal":
        given = " ".join(f"{option_of(n)} {row[n]}" for n in STUDY if n != "mu_comp")
        stresses = row["stresses"].replace(",", " ")
        return f"{PYTHON} -m modal pack --friction {row['mu_comp']} {given} --seed {w.seed} --stress {stresses} -o {folder}"
    head, line = " ".join([*STUDY, "seed", "highest"]), " ".join(row[n] for n in STUDY)
    highest = row["stresses"].split(",")[-1]
    walked = f"{folder}/compression_mu{row['mu_comp']}"
    return (
        f"mkdir -p {folder} && printf '%s\\n%s\\n' '{head}' '{line} {w.seed} {highest}' > {folder}/yade.table && "
        f"workflow/yade_job.sh {folder}/yade.table {row['mu_comp']} yade_scripts/compress.py {folder} {folder}/yade.log "
        f"{walked}/{states(w.row)[-1]}Pa.sample.h5 && ln -f {walked}/*Pa.sample.h5 {folder}/"
    )


rule all:
    input:
        [
            f"{FOLDER}/{name}/{seed}/{state}Pa.json"
            for name, row in ROWS.items()
            for seed in range(config.get("first", 1), min(int(row["seeds"]), config.get("seeds", 99)) + 1)
            for state in states(name)
            if float(state) >= 1e5
        ],


rule compression:
    # The states are named by a file, as their number depends on the row.
    output:
        f"{FOLDER}/{{row}}/{{seed}}/walked",
    params:
        command=command,
    log:
        f"{FOLDER}/{{row}}/{{seed}}/walk.log",
    resources:
        **needs("states"),
    shell:
        "({params.command}) > {log} 2>&1 && touch {output}"


rule rest:
    input:
        f"{FOLDER}/{{row}}/{{seed}}/walked",
    output:
        f"{FOLDER}/{{row}}/{{seed}}/{{state}}Pa.rest.sample.h5",
    params:
        friction=lambda w: f"{float(ROWS[w.row]['mu_comp']) + 0.1:g}",
    log:
        f"{FOLDER}/{{row}}/{{seed}}/{{state}}.rest.log",
    resources:
        **needs("sample"),
    shell:
        "{PYTHON} -m modal relax {FOLDER}/{wildcards.row}/{wildcards.seed}/{wildcards.state}Pa.sample.h5 "
        "--friction {params.friction} --tolerance 1e-6 -o {output} > {log} 2>&1 || [ $? = 3 ]"


rule numbers:
    input:
        f"{FOLDER}/{{row}}/{{seed}}/{{state}}Pa.rest.sample.h5",
    output:
        f"{FOLDER}/{{row}}/{{seed}}/{{state}}Pa.json",
    resources:
        **needs("page"),
    shell:
        "{PYTHON} -m analysis measure {input} --quantities {NUMBERS} -o {output} || [ $? = 3 ]"
