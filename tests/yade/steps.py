"""Take some steps of a sample in YADE at the rates of a control, and write the sample.

    yade -n -x -j1 steps.py ROOT SAMPLE.sample.h5 OUT.sample.h5 '{"steps": 500, ...}'

The settings: steps, dt (s), damping, interval (steps between two settings of the strain rates),
and either stress (Pa) or rate (1/s). `study/stresses` of OUT has the principal stresses at each
setting.
"""

import json
import sys
from types import SimpleNamespace

sys.path.insert(0, sys.argv[1])

import numpy as np

from modal.packing.sample import read_sample, write_sample
from modal.preparation.strain_control import INERTIAL_NUMBER, ConstantRate, Servo
from yade_scripts.scene import finish
from yade_scripts.servo import Scene


def main():
    """Read a sample, take the steps, and write the sample."""
    sample = read_sample(sys.argv[2])
    settings = json.loads(sys.argv[4])
    stresses = []
    if "rate" in settings:
        control = ConstantRate(settings["rate"])
    else:
        control = Servo(settings["stress"], INERTIAL_NUMBER)

    def follow(stress):
        stresses.append(stress)
        return control.follow(stress)

    watched = SimpleNamespace(follow=follow, stress=np.zeros(3))
    scene = Scene(sample, SimpleNamespace(control=watched, damping=settings["damping"]))
    scene.advance(settings["steps"], settings["dt"], settings["interval"])
    after = scene.sample(moving=True)
    after.study = {"stresses": np.array(stresses)}
    write_sample(sys.argv[3], after)


finish(main)
