"""Whole commands by the clock: how long the answer to a question takes on all cores.

Runs only when it is named, on a machine that has nothing else to do. The packing is the sample of
case 6, 35,201 spheres; a slender one is made by the question before it is asked of. Each answer is
told as soon as it is there.
"""

import shutil
from collections.abc import Mapping

from benchmarks.harness import diagram
from benchmarks.harness.measure import CORES, Job, Measured, median_of
from benchmarks.harness.packing import SAMPLE, STRESS
from benchmarks.harness.report import Page, Rows
from modal.packing.sample import read_sample, sample_of_network
from modal.preparation.random_packing import random_packing

TITLE = "Whole questions: seconds and memory from the command to the answer"
SMALL = "small.sample.h5"
"""File of a small sample, in the folder of the commands."""
PACKING = "packing.sample.h5"
"""File of the sample of case 6."""
MADE = "made.sample.h5"
"""File of the packing that the command before has made."""
MAX_ONE_THREAD_SECONDS = 60.0
"""Seconds up to which a question is also answered with one thread."""
ModeRequest = tuple[str, float | None]
"""A command, and the seconds in which its answer should be there, if stated."""
SIZES = {
    True: {"slender": 1000, "rough": 300, "width": 5},
    False: {"slender": 8800, "rough": 8800, "width": 9.2},
}
"""Spheres of packings that are made, without friction and with it; diameters."""
QUESTIONS: dict[str, ModeRequest] = {
    "what is in a small packing": (f"modal info {SMALL}", 0.35),
    "V_P, V_S, f_low-pass": (f"analysis measure {PACKING} --quick", 15),
    "all quantities": (f"analysis measure {PACKING}", 50),
    "V_P and V_S by the moduli": (f"modal moduli {PACKING}", None),
    "the wave from wall to wall": (f"modal wave {PACKING} --duration 6e-4", None),
    "what passes up to 20 kHz": (f"modal response {PACKING} --highest 2e4", None),
    "density of states": (f"modal density {PACKING} --tolerance 0.005", None),
    "how many modes lie below 20 kHz": (f"modal count {PACKING} --at 2e4", None),
    "the lowest 100 modes": (f"modal modes {PACKING} --lowest 100", None),
    "a slender packing": (
        "modal pack --spheres {slender} --aspect 20.4 --stress 1e5 -o made",
        60,
    ),
    "its modes below 30 kHz": (f"modal modes {MADE} --below 3e4", 60),
    "a packing with friction, cloud to 100 kPa": (
        "modal pack --friction 0.4 --spheres {rough} --width {width} --stress 1e5 -o made",
        None,
    ),
    "its rest": (f"modal relax {MADE} --friction 0.5 -o rested.sample.h5", None),
}
"""What is asked. A command that makes a packing writes to the folder `made`."""


def run(job: Job) -> Page:
    """Answer every question; with small samples if `quick`, to see that all are answered."""
    questions = {
        text: (words.format(**SIZES[job.quick]), goal) for text, (words, goal) in QUESTIONS.items()
    }
    return answers(job, "questions", TITLE, questions)


def answers(job: Job, name: str, title: str, questions: Mapping[str, ModeRequest]) -> Page:
    """Return the page `name` of questions, with the seconds and the memory of their answers."""
    small = sample_of_network(random_packing(500, STRESS, aspect=2.5), 0.1)
    job.write(small, "small")
    job.write(small if job.quick else read_sample(SAMPLE))

    def answered(command: str, threads: int) -> Measured:
        shutil.rmtree(job.folder / "made", ignore_errors=True)
        return job.command(*command.split(), threads=threads)

    rows: Rows = []
    for text, (command, goal) in questions.items():
        answer = median_of(3, lambda asked=command: answered(asked, CORES))
        row = {"question": text, "goal_s": goal, **answer.cost, "one_thread_s": None}
        if not answer.failure and answer.seconds < MAX_ONE_THREAD_SECONDS:
            row["one_thread_s"] = answered(command, 1).seconds
        rows.append(row)
        print(*(f"{name} {value}" for name, value in row.items()), sep=", ", flush=True)
        for state in sorted((job.folder / "made").glob("*.sample.h5")):  # the last is asked for
            state.replace(job.folder / MADE)
    task = (
        "Seconds by the clock on all cores, the start of the command included; `one_thread_s`: "
        "processor time with one thread, of answers that take less than "
        f"{MAX_ONE_THREAD_SECONDS:g} s."
    )
    remarks = [
        f"{row['question']}: {row['seconds']:.3g} s, {row['seconds'] / row['goal_s']:.2g} times "
        f"the {row['goal_s']:g} s aimed at."
        for row in rows
        if row["goal_s"] and row["seconds"]
    ]
    shown = [row for row in rows if row["seconds"]]
    figure, ax = diagram.bars([row["question"] for row in shown], {"measured": shown}, "seconds")
    ax.plot([row["goal_s"] for row in shown], range(len(shown)), "k|", ms=14, label="aimed at")
    ax.set(xscale="log", xlabel="seconds")
    diagram.legend_below(figure, ax)
    return Page(title, task, {name: rows}, remarks, {name: figure})
