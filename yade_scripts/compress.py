"""One friction coefficient's compression from a cloud to `highest`: a state at each stress.

    yade -n -x -j1 yade_scripts/compress.py              (mu_comp = 0.4, 35,201 spheres)
    yade-batch own.table yade_scripts/compress.py

Columns `sizes` ("lognormal_0.2", "two_2_0.5", with the quotes), `densities` ("2230_7800") and
`walls` ("2.1e11_0.3") make a mixture (`modal.preparation.sizes`).

Writes products/compression_mu0.4/STRESSPa.sample.h5 and, after every leg, a checkpoint from which a
killed compression goes on. Environment: WAVE_PRODUCTS. The protocol, its numbers and their reasons
are those of `modal.preparation.protocol`; see results/samples/compaction.md. Each leg starts from
the file that the leg before has written, so that a compression that was killed takes the same steps
as one that was not.
"""

import math
import sys
import time
from dataclasses import asdict
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, config
from yade.utils import PyRunner, readParamsFromTable

from modal.preparation import protocol
from modal.preparation.cloud import cloud
from modal.preparation.compression import compress_to_stresses, cost
from modal.preparation.durations import REFERENCE, steps_of
from modal.preparation.protocol import Stage, Study
from modal.preparation.sizes import MIXTURE
from modal.preparation.strain_control import ConstantRate
from modal.tools.display import duration
from modal.tools.errors import InputError
from yade_scripts import servo
from yade_scripts.scene import Report, before_motion, finish, products_folder
from yade_scripts.state import build_scene, read_scene, resume_cell

MARGIN = 0.1
"""Reach of the collider around each sphere, radii."""

readParamsFromTable(noTableOk=True, highest=protocol.STRESSES[-1], **asdict(Study()))
from yade.params import table  # noqa: E402


def compacted(study):
    """The cloud compacted to LOOSE and put to rest."""
    started = time.perf_counter()
    loose = cloud(study)
    build_scene(loose, margin=MARGIN, damping=0.0)
    O.dt = study.time_step(protocol.COMPACTION_STRESS)
    drive(ConstantRate(protocol.COMPACTION_RATE), REFERENCE, study)
    growth = math.log(protocol.LOOSE / protocol.CLOUD) / 3
    steps = int(growth / protocol.COMPACTION_RATE / O.dt)
    O.run(steps, wait=True)
    sample = read_scene(loose, moving=False)
    spent = {"steps": steps, "seconds": time.perf_counter() - started}
    sample.study = study.attributes | {"stage": "approach", "stage_time": 0.0}
    sample.study |= cost({}, "cloud", **spent, contacts=O.interactions.countReal())
    return sample


def drive(control, stress, study):
    """Let `control` set the strain rates from now on, as often as suits `stress` (Pa)."""
    global follow
    follow = servo.Drive(study.spheres, control)
    interval = study.duration(protocol.CONTROL, stress)
    before_motion(
        PyRunner(command="follow()", iterPeriod=steps_of(interval, O.dt), label="control")
    )


def leg(sample, study):
    """One leg from `sample`; returns the sample at its end and whether the stage is over."""
    started = time.perf_counter()
    n, before = study.spheres, dict(sample.study)
    build_scene(sample, margin=MARGIN, damping=0.0)
    stage = Stage(before["stage"], study)
    stage.control.stress = servo.principal_stresses(n)
    O.labeledEngine("newton").damping = stage.damping
    O.dt = stage.time_step()
    drive(stage.control, stage.control.target, study)
    resume_cell()
    report = Report()
    seconds, steps, ended = float(before["stage_time"]), 0, False
    for _ in range(protocol.CHECKS):
        O.dt = stage.time_step()
        O.labeledEngine("control").iterPeriod = steps_of(stage.interval, O.dt)
        count = steps_of(stage.check, O.dt)
        O.run(count, wait=True)
        steps, seconds = steps + count, seconds + count * O.dt
        settled = stage.settled(servo.unbalanced())
        ended = settled or stage.impatient(seconds)
        if not np.isfinite(stage.control.stress).all():
            raise InputError(f"{stage.name}: the stress is not finite; unstable time step")
        left = (stage.patience - seconds) * (time.perf_counter() - started)
        left /= seconds - before["stage_time"]
        to_go = f", at most {duration(left)} to go in this stage" if left < math.inf else ""
        report(f"{progress(stage, steps)}{to_go}")
        if ended:
            break
    reached = {
        "stage_time": seconds,
        "unbalanced": servo.unbalanced(),
        "void_ratio": servo.void_ratio(n),
        "coordination_number": coordination_number(n),
    }
    reached |= zip(("stress_xx", "stress_yy", "stress_zz"), stage.control.stress, strict=True)
    if stage.is_state:
        reached |= {"settled": settled, "stress_error": stage.control.error()}
    print(f"\r{progress(stage, steps)}", end="")
    after = read_scene(sample, moving=True)
    spent = {"steps": steps, "seconds": time.perf_counter() - started}
    so_far = cost(before, stage.name, **spent, contacts=O.interactions.countReal())
    after.study = before | reached | so_far
    print(f", {so_far['seconds']:.0f} s", flush=True)
    return after, ended


def coordination_number(n):
    """Mean number of contacts of a sphere, walls included."""
    walls = sum(contact.isReal for wall in (n, n + 1) for contact in O.interactions.withBody(wall))
    return (2 * O.interactions.countReal() - walls) / n


def progress(stage, steps):
    """Stage, steps of this leg, stress, void ratio, unbalanced ratio."""
    n = stage.study.spheres
    return (
        f"mu {stage.study.mu_comp:g} {stage.name}: {steps} steps, "
        f"stress {stage.control.stress.mean():.4g} Pa, e {servo.void_ratio(n):.4f}, "
        f"Z {coordination_number(n):.3f}, unbalanced {servo.unbalanced():.1e}"
    )


def main():
    """Compress from the checkpoint, or from the cloud, to the highest stress."""
    given = {name: getattr(table, name) for name in asdict(Study())}
    # A column of the table holds one word.
    mixture = {name: str(given[name]) for name in MIXTURE}
    words = {name: word.replace("_", " ") for name, word in mixture.items()}
    study = Study(**given | words)
    folder = products_folder() / f"compression_mu{study.mu_comp:g}"
    compress_to_stresses(
        folder,
        study,
        [stress for stress in protocol.STRESSES if stress <= table.highest],
        study.provenance("yade_scripts/compress.py", yade=config.version),
        lambda: compacted(study),
        lambda sample: leg(sample, study),
        lambda text: print(text, flush=True),
    )


finish(main)
