"""Tests of the compression protocol: durations, time step, servo, refusals."""

import math
from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

from modal.packing.contact_law import RADIUS, Material
from modal.preparation import protocol
from modal.preparation.durations import count_steps, highest_frequency, vibration_duration
from modal.preparation.protocol import PREPARATION, Stage
from modal.preparation.strain_control import Servo
from modal.preparation.study import Study
from modal.theory.fcc import FccLattice

STUDY = Study(spheres=400, width=4.2)


@pytest.mark.parametrize("name", [*PREPARATION, "1000", "1e+07"])
@pytest.mark.parametrize("divisor", [2, 4])
def test_a_smaller_step_changes_no_duration(name, divisor):
    coarse = Stage(name, STUDY)
    fine = Stage(name, replace(STUDY, fraction=0.7 / divisor))
    for stage in (coarse, fine):
        stage.control.stress = np.full(3, stage.control.target)
    assert fine.time_step() == pytest.approx(coarse.time_step() / divisor)
    assert fine.interval == coarse.interval
    assert fine.check == coarse.check
    assert fine.patience == coarse.patience
    # A control every five steps: half a step in ten is the most that rounding shifts it by.
    coarse_count = count_steps(coarse.interval, coarse.time_step())
    fine_count = count_steps(fine.interval, fine.time_step())
    assert fine_count / coarse_count == pytest.approx(divisor, rel=0.1)


def test_highest_frequency_scales_as_the_crystals():
    """Compare with the highest mode of the FCC crystal: their ratio is equal for any material.

    Both vary as sqrt(kn / m) at the overlap under the stress, that is as the sixth root of the
    stress; Poisson's ratio fixes the ratio of shear to normal stiffness. The cross-section of the
    crystal shrinks by the overlap, 6e-4 diameters at 1 MPa, which is the tolerance.
    """
    ratios = []
    for young, density, radius in ((60e9, 2230.0, RADIUS), (200e9, 7800.0, 4e-3)):
        material = Material(young, 0.2, density)
        for stress in (1e3, 1e6):
            crystal = FccLattice(stress, radius=radius, material=material)
            highest = highest_frequency(stress, radius, material)
            ratios.append(highest / crystal.low_pass_frequency)
    assert ratios == pytest.approx([ratios[0]] * 4, rel=6e-4)
    # Random against crystal, by the study's own numbers at 100 kPa: 216.1 over 137.6 kHz.
    assert ratios[0] == pytest.approx(216.1 / 137.6, rel=5e-3)


def test_servo_reaches_the_stress_of_a_spring():
    """Let one servo control three springs of very different stiffness, Pa."""
    servo = Servo(1e5, 0.01)
    stiffness = np.array([1e6, 1e8, 3e9])
    strain = np.zeros(3)
    interval = vibration_duration(protocol.CONTROL_INTERVAL, 1e5)
    errors = []
    for _ in range(4000):
        strain = strain + interval * servo.follow(-stiffness * strain)
        errors.append(servo.error())
    # The soft spring needs a strain of 0.1 at the servo's limit; then crossings halve the rate.
    assert 0.1 / (servo.limit * interval) < 4000
    assert max(errors[-1000:]) < protocol.SETTLED.stress_error


def test_approach_ends_at_the_agitation_stress():
    study = replace(STUDY, hot_stress=2e4)
    approach = Stage("approach", study)
    assert approach.damping == study.agitated_damping
    approach.control.stress = np.full(3, 1.9e4)
    assert not approach.settled(math.nan)
    approach.control.stress = np.full(3, 2.1e4)
    assert approach.settled(math.nan)


@pytest.mark.parametrize(
    ("stress_ratio", "residual_ratio", "is_settled"),
    [(0.9, 0.9, True), (1.1, 0.9, False), (0.9, 1.1, False)],
    ids=["both within", "stress off", "unbalanced"],
)
def test_state_is_settled_by_stress_and_balance(stress_ratio, residual_ratio, is_settled):
    """Set deviations along one axis, in units of the limits of the study."""
    stage = Stage("100000", replace(STUDY, residual=1e-2))
    stress_error = stress_ratio * protocol.SETTLED.stress_error
    stage.control.stress = 1e5 * np.array([1, 1 - stress_error, 1])
    assert stage.settled(residual_ratio * 1e-2) is is_settled


def test_state_has_the_damping_and_the_patience_of_the_study():
    stage = Stage("100000", replace(STUDY, damping=0.4))
    assert stage.damping == 0.4
    assert not stage.impatient(0.99 * stage.patience)
    assert stage.impatient(stage.patience)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"mu_comp": math.nan}, "not_finite"),
        ({"mu_comp": 1.1}, "friction"),
        ({"width": 3.9}, "too_few_spheres"),
        ({"width": math.inf}, "not_finite"),
        ({"inertial_number": -0.1}, "fraction"),
        ({"approach_rate": 0.0}, "rate_or_damping"),
        ({"agitated_damping": 1.0}, "rate_or_damping"),
        ({"damping": 0.0}, "rate_or_damping"),
        ({"hot_stress": 10.0}, "hot_stress_or_residual"),
        ({"dilate": 0.2}, "dilate"),
        ({"mu_comp": 0.0, "dilate": 0.005}, "dilate"),
    ],
    ids=lambda value: str(value) if isinstance(value, dict) else "",
)
def test_impossible_study_is_refused(change, code):
    with refusal(code):
        Study(**change)
