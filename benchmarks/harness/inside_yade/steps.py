"""Seconds of one time step, of a sample under compression or with a wave: result.json.

    yade -n -x -j1 benchmarks/harness/inside_yade/steps.py result.json '{"sample": ..., ...}'

Arguments: sample (file), wave (whether the source wall moves, without damping, the collider asleep;
else the servo drives the damped spheres), stress (Pa), steps. Only the steps are timed, after a few
that are not.
"""

import json
import sys
import time
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[3]))

import numpy as np
from yade import O
from yade.utils import PyRunner

from modal.packing.sample import read_sample
from modal.preparation import protocol
from modal.waves.signals import source_pulse
from yade_scripts.scene import finish
from yade_scripts.servo import Drive
from yade_scripts.state import build_scene

WARM = 5
AMPLITUDE, INPUT_FREQUENCY = 2.5e-9, 1e5


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
    """Build, warm up, time; the value is the memory of the scene, MB."""
    global n, step, control
    result, given = Path(sys.argv[1]), json.loads(sys.argv[2])
    bare = resident()
    sample = read_sample(given["sample"])
    n, step, wave = len(sample.position), 0, given["wave"]
    build_scene(sample, margin=0.01 if wave else 0.1, damping=0.0 if wave else 0.2)
    O.engines[1].dead = wave
    servo = protocol.Servo(given["stress"], protocol.INERTIAL_NUMBER)
    control = None if wave else Drive(n, servo)
    command, every = ("drive()", 1) if wave else ("control()", 5)
    O.engines = [*O.engines[:3], PyRunner(command=command, iterPeriod=every), O.engines[-1]]
    O.dt = protocol.time_step(given["stress"])
    O.run(WARM, wait=True)
    started = time.process_time()
    O.run(given["steps"], wait=True)
    seconds = (time.process_time() - started) / given["steps"]
    result.write_text(json.dumps({"value": resident() - bare, "seconds": seconds}))


finish(main)
