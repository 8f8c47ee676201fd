"""Waves of the sample of case 6 repeated sideways, up to ten million spheres, which need 16 GB.

Runs only when it is named, on a machine that has nothing else to do.
"""

from benchmarks.harness.measure import Job
from benchmarks.harness.report import Page
from benchmarks.questions import PACKING, ModeRequest, answers

TITLE = "Large samples: whole commands, and waves of packings repeated sideways"
COPIES = {True: ((2, 2),), False: ((2, 2), (7, 4), (17, 17))}
"""Repetitions along x and y."""
WIDE = "wide.sample.h5"


def run(job: Job) -> Page:
    """Repeat the sample, and send a wave through all of it, not through one of its equal parts."""
    questions: dict[str, ModeRequest] = {}
    for x, y in COPIES[job.quick]:
        questions[f"{x} x {y} times"] = f"modal tile {PACKING} --repeat {x} {y} -o {WIDE}", None
        wave = f"modal wave {WIDE} --duration 6e-4 --whole"
        questions[f"the wave, {x} x {y} times"] = wave, None
    return answers(job, "large", TITLE, questions)
