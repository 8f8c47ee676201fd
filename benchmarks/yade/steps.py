"""Time steps of a sample under compression or with a wave: result.json.

    yade -n -x -j1 benchmarks/yade/steps.py result.json '{"sample": ..., "kind": "wave", ...}'

Arguments: sample (file), kind (sample: damped, with servo; wave: the source wall moves), steps,
collider (sorts in every step, when spheres have moved far enough, or is asleep), rotations (whether
spheres may turn), output (file of the positions at the end, or none). Only the steps are timed,
after a few that are not.
"""

import json
import sys
import time
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[2]))

import numpy as np
from yade import O
from yade.utils import PyRunner

from modal.preparation import protocol
from modal.sample import read_sample
from modal.signals import source_pulse
from modal.source import AMPLITUDE, INPUT_FREQUENCY
from yade_scripts import compression
from yade_scripts.scene import finish
from yade_scripts.state import build_scene

WARM = 5


def drive():
    """Send the source wall to its place at the next step, as `yade_scripts/wave.py` does."""
    global step
    now = step * O.dt
    here, there = source_pulse(np.array([now, now + O.dt]), AMPLITUDE, INPUT_FREQUENCY)
    O.bodies[n].state.vel = (0, 0, (there - here) / O.dt)
    step += 1


def resident():
    """Memory that the process holds now, MB."""
    status = Path("/proc/self/status").read_text().splitlines()
    line = next(line for line in status if line.startswith("VmRSS:"))
    return int(line.split()[1]) * 1024 / 1e6


def main():
    """Build, warm up, time."""
    global n, step, control
    result, given = Path(sys.argv[1]), json.loads(sys.argv[2])
    bare = resident()
    sample = read_sample(given["sample"])
    n, step, wave = len(sample.position), 0, given["kind"] == "wave"
    margin = 0.0 if given["collider"] == "every step" else 0.01 if wave else 0.1
    build_scene(sample, margin=margin, damping=0.0 if wave else 0.2)
    O.engines[1].dead = given["collider"] == "asleep"
    if not given["rotations"]:
        for k in range(n):
            O.bodies[k].state.blockedDOFs = "XYZ"
    if wave:
        runner = PyRunner(command="drive()", iterPeriod=1)
    else:
        control = compression.Drive(n, protocol.Servo(given["stress"], protocol.INERTIAL_NUMBER))
        runner = PyRunner(command="control()", iterPeriod=5)
    O.engines = [*O.engines[:3], runner, O.engines[-1]]
    O.dt = protocol.time_step(given["stress"])
    O.run(WARM, wait=True)
    started = time.process_time()
    O.run(given["steps"], wait=True)
    seconds = (time.process_time() - started) / given["steps"]
    if given["output"]:
        np.save(given["output"], [O.bodies[k].state.pos for k in range(n)])
    value = {"scene_mb": resident() - bare, "contacts": O.interactions.countReal()}
    result.write_text(json.dumps({"value": value, "seconds": seconds}))


finish(main)
