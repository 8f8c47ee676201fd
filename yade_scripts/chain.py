"""One friction coefficient's walk from a cloud of spheres to `highest`: a state at each stress.

    yade -n -x -j1 yade_scripts/chain.py                 (mu_comp = 0.4, 35,201 spheres)
    yade-batch cases/chains.table yade_scripts/chain.py

Writes products/chain_mu0.4/STRESSPa.sample.h5 and, every LEG steps, a checkpoint from which a
killed chain goes on. Environment: WAVE_PRODUCTS.

While spheres still move freely hardly anything but friction dissipates (Otsubo et al. 2017,
section 2, have friction alone): damping makes the packing looser, see
results/samples/compaction.md. The agitated packing then comes to rest at a constant volume: a servo
would let it expand until the agitation carries the stress. Each leg starts from the file that the
leg before has written, so that a chain that was killed takes the same steps as one that was not.
"""

import math
import sys
import time
from dataclasses import replace
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, config
from yade.utils import PyRunner, readParamsFromTable

from modal.hertz_mindlin import RADIUS
from modal.sample import Sample, read_sample, write_sample
from modal.storage import InputError
from yade_scripts import compression
from yade_scripts.scene import finish, products_folder
from yade_scripts.state import build_scene, read_scene

LEG = 3000
"""Steps between two checkpoints: some four minutes at full size."""
CHECK = 100
"""Steps between two looks at stress and balance."""
PREPARATION = "approach", "cool", "jam"
STRESSES = (1e3, 1e4, 1e5, 1e6, 1e7)
CLOUD, LOOSE = 0.2, 0.5
"""Solid fractions of the cloud (no overlaps) and of its compaction at rest."""
COMPACTION_RATE = 400.0
"""Strain rate, 1/s, from CLOUD to LOOSE."""
HOT = 5e5
"""Mean stress, Pa, of the agitated spheres at which the compaction ends."""
DAMPING = 0.2
"""Local damping after HOT."""
MARGIN = 0.1
COOLING = 6000
"""Steps at constant volume, after which the agitation is over."""
JAMMING_STRESS = 1e4
"""Stress, Pa, before the first state: a jammed packing that is let go at once flies apart."""
SETTLED = 3e-3, 1e-3
"""When a state is reached: relative error of each stress, mean residual over contact force."""
PATIENCE = 12000
"""Steps after which a packing that does not settle is taken as it is."""
NOMINAL_FRACTION = 0.6
"""Solid fraction at which `width` and the number of spheres fix the length."""

readParamsFromTable(
    noTableOk=True,
    mu_comp=0.4,
    spheres=35201,
    width=14.65,
    seed=1,
    highest=1e7,
    # Strain rate, 1/s, from LOOSE to HOT, and local damping until then, which decides how dense
    # the packing jams; inertial number of the servo; time step over its limit.
    approach_rate=8.0,
    agitated_damping=0.02,
    inertial_number=0.01,
    fraction=compression.STABILITY,
)
from yade.params.table import (  # noqa: E402
    agitated_damping,
    approach_rate,
    fraction,
    highest,
    inertial_number,
    mu_comp,
    seed,
    spheres,
    width,
)

STUDY = {
    "mu_comp": float(mu_comp),
    "spheres": int(spheres),
    "width": float(width),
    "seed": seed,
    "approach_rate": float(approach_rate),
    "agitated_damping": float(agitated_damping),
    "inertial_number": float(inertial_number),
    "fraction": float(fraction),
}


def stages():
    """Names of the stages, in order; a stress in Pa names the walk to it."""
    return [*PREPARATION, *(f"{stress:g}" for stress in STRESSES if stress <= highest)]


def random_places(side, length):
    """Centres (n, 3), in diameters, of spheres placed at random one by one where they fit."""
    random = np.random.default_rng(seed)
    across, along = int(side), int(length)  # bins at least one diameter wide
    bins = {}
    around = [(a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)]
    places = []
    for _ in range(1000):
        for point in random.random((spheres, 3)) * (side, side, length - 1) + (0, 0, 0.5):
            x, y, z = point
            i, j, k = int(x / side * across), int(y / side * across), int(z / length * along)
            near = (
                other
                for a, b, c in around
                for other in bins.get(((i + a) % across, (j + b) % across, k + c), ())
            )
            if all(
                (abs(x - u) - side * (abs(x - u) > side / 2)) ** 2
                + (abs(y - v) - side * (abs(y - v) > side / 2)) ** 2
                + (z - w) ** 2
                > 1
                for u, v, w in near
            ):
                bins.setdefault((i, j, k), []).append((x, y, z))
                places.append((x, y, z))
                if len(places) == spheres:
                    # Numbered along z, neighbours lie close together in memory.
                    return np.array(sorted(places, key=lambda place: place[2]))
    raise InputError(f"{spheres} spheres do not fit into the cloud; take another width")


def cloud():
    """Spheres without contact at solid fraction CLOUD, compacted to LOOSE and put to rest."""
    started = time.perf_counter()
    diameter = 2 * RADIUS
    length = spheres * math.pi / 6 / NOMINAL_FRACTION / width**2 * diameter
    scale = (NOMINAL_FRACTION / CLOUD) ** (1 / 3)
    side, length = scale * width * diameter, scale * length
    position = diameter * random_places(side / diameter, length / diameter)
    sides, walls = np.array([side, side]), np.array([0.0, length])
    build_scene(Sample(position, sides, walls, mu_comp), margin=MARGIN, damping=0.0)
    O.dt = compression.time_step(1e6, fraction)
    drive(compression.ConstantRate(spheres, COMPACTION_RATE))
    steps = int(math.log(LOOSE / CLOUD) / 3 / COMPACTION_RATE / O.dt)
    O.run(steps, wait=True)
    sample = read_scene(spheres, mu_comp, moving=False)
    cost = {"steps": steps, "seconds": time.perf_counter() - started}
    of_stage = cost | {"contacts": O.interactions.countReal()}
    sample.study = STUDY | {"stage": "approach", "step": 0} | cost | _of("cloud", of_stage)
    return sample


def _of(stage, cost):
    """What a stage has cost, by the names of the format."""
    return {f"{name}_{stage}": value for name, value in cost.items()}


def drive(new_control):
    """Let `new_control` set the strain rates from now on."""
    global control
    control = new_control
    runner = PyRunner(command="control()", iterPeriod=compression.INTERVAL)
    O.engines = [*O.engines[:3], runner, O.engines[-1]]


def stage_control(stage):
    """Control, damping, and the test for the end of a stage."""
    if stage == "approach":
        rate = compression.ConstantRate(spheres, approach_rate)
        return rate, agitated_damping, lambda: control.stress.mean() > HOT
    if stage == "cool":
        return compression.ConstantRate(spheres, 0.0), DAMPING, lambda: False
    stress, *at_rest = (JAMMING_STRESS, 0.1, 1e-2) if stage == "jam" else (float(stage), *SETTLED)
    servo = compression.Servo(spheres, stress, inertial_number)
    return (
        servo,
        DAMPING,
        lambda: servo.error() < at_rest[0] and compression.unbalanced() < at_rest[1],
    )


def leg(sample):
    """Up to LEG steps from `sample`; returns the sample at their end and whether the stage is."""
    started = time.perf_counter()
    study = dict(sample.study)
    build_scene(sample, margin=MARGIN, damping=0.0)
    stage_of_control, damping, done = stage_control(study["stage"])
    O.engines[-1].damping = damping
    drive(stage_of_control)
    patience = {"approach": math.inf, "cool": COOLING}.get(study["stage"], PATIENCE)
    ended, step = False, 0
    while step < LEG and not ended:
        target = getattr(control, "target", 1e5)
        O.dt = compression.time_step(max(target, 1.5 * control.stress.mean()), fraction)
        O.run(CHECK, wait=True)
        step += CHECK
        ended = done() or study["step"] + step >= patience
        if not np.isfinite(control.stress).all():
            raise InputError(f"{study['stage']}: the stress is not finite; unstable time step")
        if sys.stdout.isatty():
            left = (patience - study["step"] - step) * (time.perf_counter() - started) / step
            to_go = f", at most {left:.0f} s to go in this stage" if left < math.inf else ""
            print(f"\r{progress(study['stage'], study['step'] + step)}{to_go}", end="", flush=True)
    after = read_scene(spheres, mu_comp, moving=True)
    xx, yy, zz = control.stress
    seconds = time.perf_counter() - started
    of_stage = {"steps": study["step"] + step, "contacts": O.interactions.countReal()}
    of_stage["seconds"] = study.get(f"seconds_{study['stage']}", 0.0) + seconds
    study |= _of(study["stage"], of_stage)
    study |= {
        "step": study["step"] + step,
        "steps": study["steps"] + step,
        "seconds": study["seconds"] + seconds,
        "stress_xx": xx,
        "stress_yy": yy,
        "stress_zz": zz,
        "unbalanced": compression.unbalanced(),
        "void_ratio": compression.void_ratio(spheres),
        "coordination_number": coordination_number(),
    }
    after.study = study
    after.provenance = {
        "command": "yade_scripts/chain.py",
        "versions": f"yade {config.version}, numpy {np.__version__}",
    }
    print(f"\r{progress(study['stage'], study['step'])} {study['seconds']:.0f} s", flush=True)
    return after, ended


def coordination_number():
    """Mean number of contacts of a sphere, walls included."""
    walls = sum(
        contact.isReal
        for wall in (spheres, spheres + 1)
        for contact in O.interactions.withBody(wall)
    )
    return (2 * O.interactions.countReal() - walls) / spheres


def progress(stage, step):
    """Stage, step, stress, void ratio, unbalanced ratio."""
    return (
        f"mu {mu_comp:g} {stage}: step {step}, stress {control.stress.mean():.4g} Pa, "
        f"e {compression.void_ratio(spheres):.4f}, Z {coordination_number():.3f}, "
        f"unbalanced {compression.unbalanced():.1e}"
    )


def main():
    """Walk on from the checkpoint, or from the cloud, to the highest stress."""
    if not (0 < mu_comp <= 1 and spheres >= 100 and width >= 4):
        raise InputError(
            f"mu_comp {mu_comp}, {spheres} spheres, width {width}: this chain needs 0 < mu_comp "
            "<= 1, at least 100 spheres and a width of at least 4 diameters"
        )
    folder = products_folder() / f"chain_mu{mu_comp:g}"
    checkpoint = folder / "checkpoint.sample.h5"
    if checkpoint.exists():
        sample = read_sample(checkpoint)
        other = [name for name in STUDY if sample.study.get(name) != STUDY[name]]
        if other:
            raise InputError(
                f"{checkpoint}: it belongs to another study ({other[0]} is "
                f"{sample.study.get(other[0])}, not {STUDY[other[0]]}); move it away or take "
                "another WAVE_PRODUCTS folder"
            )
    else:
        sample = cloud()
        write_sample(checkpoint, sample)
    names = stages()
    while sample.study["stage"] != "end":
        stage = sample.study["stage"]
        sample, ended = leg(sample)
        if ended:
            if stage not in PREPARATION:
                sample.study["stress"] = float(stage)
                # What follows brings it to rest; the checkpoint keeps the motion.
                state = replace(sample, velocity=None, angular_velocity=None, strain_rate=None)
                write_sample(folder / f"{stage}Pa.sample.h5", state)
                print(f"{folder / stage}Pa.sample.h5: written", flush=True)
            following = [*names, "end"][names.index(stage) + 1]
            sample.study |= {"stage": following, "step": 0}
        write_sample(checkpoint, sample)


finish(main)
