"""The protocol of compression: its times, its step, its servo; what it refuses."""

import math
from dataclasses import replace

import numpy as np
import pytest

from modal.packing.contact_law import RADIUS, Material
from modal.preparation import protocol
from modal.preparation.durations import duration, highest_frequency, steps_of
from modal.preparation.protocol import PREPARATION, Stage, Study
from modal.preparation.strain_control import Servo
from modal.theory.fcc import FccLattice
from modal.tools.errors import InputError

STUDY = Study(spheres=400, width=4.2)


@pytest.mark.parametrize("name", [*PREPARATION, "1000", "1e+07"])
@pytest.mark.parametrize("over", [2, 4])
def test_a_smaller_step_changes_no_duration(name, over):
    whole, part = Stage(name, STUDY), Stage(name, replace(STUDY, fraction=0.7 / over))
    for stage in (whole, part):
        stage.control.stress = np.full(3, stage.control.target)
    assert part.time_step() == pytest.approx(whole.time_step() / over)
    for name in ("interval", "check", "patience"):
        assert getattr(part, name) == getattr(whole, name)
    # A control every five steps: half a step in ten is the most that rounding shifts it by.
    counts = [steps_of(stage.interval, stage.time_step()) for stage in (whole, part)]
    assert counts[1] / counts[0] == pytest.approx(over, rel=0.1)


def test_highest_frequency_scales_as_the_crystals():
    """The formula of the FCC crystal's highest mode has the same units: one ratio for any glass.

    sqrt(kn / m) at the overlap under the stress; the stress enters with its sixth root. Ratio of
    shear to normal stiffness fixed by Poisson's ratio. The crystal's area shrinks by the overlap,
    6e-4 diameters at 1 MPa.
    """
    ratio = []
    for young, density, radius in ((60e9, 2230.0, RADIUS), (200e9, 7800.0, 4e-3)):
        material = Material(young, 0.2, density)
        for stress in (1e3, 1e6):
            crystal = FccLattice(stress, radius=radius, material=material)
            highest = highest_frequency(stress, radius, material)
            ratio.append(highest / crystal.low_pass_frequency)
    assert ratio == pytest.approx([ratio[0]] * 4, rel=6e-4)
    # Random against crystal, by the study's own numbers at 100 kPa: 216.1 over 137.6 kHz.
    assert ratio[0] == pytest.approx(216.1 / 137.6, rel=5e-3)


def test_servo_reaches_the_stress_of_a_spring():
    """Three springs of very different stiffness, one servo: stress = -stiffness strain."""
    servo, stiffness, strain = Servo(1e5, 0.01), np.array([1e6, 1e8, 3e9]), np.zeros(3)
    interval = duration(protocol.CONTROL, 1e5)
    errors = []
    for _ in range(4000):
        strain = strain + interval * servo.follow(-stiffness * strain)
        errors.append(servo.error())
    # The soft spring needs a strain of 0.1 at the servo's limit; then crossings halve the rate.
    assert 0.1 / (servo.limit * interval) < 4000
    assert max(errors[-1000:]) < protocol.SETTLED[0]


def test_state_is_settled_by_stress_and_balance():
    """And the compaction of agitated spheres over by their stress; all as the study has it."""
    study = replace(STUDY, hot_stress=2e4, damping=0.4, residual=1e-2)
    approach, stage = Stage("approach", study), Stage("100000", study)
    assert (approach.damping, stage.damping) == (study.agitated_damping, 0.4)
    for stress, over in ((1.9e4, False), (2.1e4, True)):
        approach.control.stress = np.full(3, stress)
        assert approach.settled(math.nan) is over
    error, residual = protocol.SETTLED[0], 1e-2
    for off, unbalanced in ((0.9, 0.9), (1.1, 0.9), (0.9, 1.1)):
        stage.control.stress = 1e5 * np.array([1, 1 - off * error, 1])
        assert stage.settled(unbalanced * residual) is (max(off, unbalanced) < 1)
    assert not stage.impatient(0.99 * stage.patience) and stage.impatient(stage.patience)


@pytest.mark.parametrize(
    "wrong",
    [
        {"mu_comp": math.nan},
        {"width": 3.9},
        {"width": math.inf},
        {"inertial_number": -0.1},
        {"approach_rate": 0.0},
        {"agitated_damping": 1.0},
        {"damping": 0.0},
        {"hot_stress": 10.0},
        {"dilate": 0.2},
        {"mu_comp": 0.0, "dilate": 0.005},
    ],
)
def test_impossible_study_is_one_line(wrong):
    with pytest.raises(InputError) as error:
        Study(**wrong)
    assert len(str(error.value).splitlines()) == 1
