"""Some steps of a sample under a servo or at a constant rate, in YADE; the sample they lead to.

    yade -n -x -j1 yade_scripts/steps.py SAMPLE.sample.h5 OUT.sample.h5 '{"steps": 500, ...}'

The settings: steps, dt (s), damping, interval (steps between two settings of the strain rates),
and either stress (Pa) or rate (1/s). `study/stresses` of OUT has the principal stresses at each
setting.
A tool for the tests of modal/dem/motion.py.
"""

import json
import sys
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O
from yade.utils import PyRunner

from modal.packing.sample import read_sample, write_sample
from modal.preparation.strain_control import INERTIAL_NUMBER, ConstantRate, Servo
from modal.tools.errors import InputError
from yade_scripts.scene import before_motion, finish
from yade_scripts.servo import Drive
from yade_scripts.state import build_scene, read_scene, resume_cell

MARGIN = 0.1
"""Reach of the collider around each sphere, radii."""


def follow():
    """Set the strain rates and remember the stresses."""
    drive()
    stresses.append(drive.control.stress.copy())


def main():
    """Read, step, write; InputError for what the user can mend."""
    global drive, stresses
    if len(sys.argv) != 4:
        raise InputError("three arguments needed: SAMPLE.sample.h5 OUT.sample.h5 SETTINGS")
    sample, given = read_sample(sys.argv[1]), json.loads(sys.argv[3])
    stresses = []
    build_scene(sample, margin=MARGIN, damping=given["damping"])
    if "rate" in given:
        control = ConstantRate(given["rate"])
    else:
        control = Servo(given["stress"], INERTIAL_NUMBER)
    drive = Drive(len(sample.position), control)
    before_motion(PyRunner(command="follow()", iterPeriod=given["interval"]))
    O.dt = given["dt"]
    resume_cell()
    O.run(given["steps"], wait=True)
    after = read_scene(sample, moving=True)
    after.study = {"stresses": np.array(stresses)}
    write_sample(sys.argv[2], after)


finish(main)
