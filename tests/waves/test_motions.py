"""Motions of the source wall: pulses of several cycles, chirps, steps, and those from a file."""

import numpy as np
import pytest
from refusals import refusal

from modal.system.damping import ContactDamping
from modal.waves.motions import Pulse, SampledMotion, chirp, read_motion, step
from modal.waves.oscillator import oscillation


def test_a_pulse_much_longer_or_shorter_than_the_record():
    """Compare a long pulse with its parabola, and many cycles with their mean.

    1 - cos x is x^2 / 2 within x^2 / 12 of itself, at x = 2 pi f t = 3e-8. The double integral of
    many cycles, in 0.2 of 1 ms, is that of their mean.
    """
    parabola = 1e-9 * (2 * np.pi * 1e-4 * 5e-5) ** 2 / 2
    assert Pulse(1e-9, 1e-4).displacement(5e-5) == pytest.approx(parabola, rel=1e-12, abs=0)
    response = oscillation(Pulse(1e-9, 1e5, 20), np.zeros(1), np.array([0, 1e-3]))
    assert response[0, 1] == pytest.approx(1e-9 * 2e-4 * (1e-3 - 1e-4), rel=1e-12, abs=0)


def test_a_chirp_sweeps_its_band():
    """Check that the spectrum lies between the two frequencies, and count the cycles."""
    motion = chirp(1e-9, 2e4, 8e4, 1e-3)
    time = np.arange(0, 1e-3, 1e-6)
    d = motion.displacement(time)
    power = abs(np.fft.rfft(d, 1 << 14)) ** 2
    f = np.fft.rfftfreq(1 << 14, 1e-6)
    assert power[(f > 2e4) & (f < 8e4)].sum() > 0.98 * power.sum()
    assert motion.value[0] == motion.value[-1] == 0
    assert abs(d).max() == pytest.approx(1e-9, rel=0.02)
    turns = 2e4 * 1e-3 + 6e4 * 1e-3 / 2
    assert (np.diff(np.sign(d[1:])) != 0).sum() == pytest.approx(2 * turns, abs=3)


def test_file_and_back(tmp_path):
    motion = chirp(1e-9, 2e4, 8e4, 1e-4)
    np.savetxt(tmp_path / "chirp.txt", np.column_stack([motion.time, motion.value]))
    again = read_motion(tmp_path / "chirp.txt")
    assert (again.time == motion.time).all()
    assert (again.value == motion.value).all()


def test_file_with_a_heading(tmp_path):
    path = tmp_path / "wall.txt"
    path.write_text("# s m\n0 0\n1e-6 1e-9\n2e-6 0\n")
    motion = read_motion(path)
    assert motion.amplitude == 0.5e-9
    assert motion.displacement(np.array([5e-7, 3e-6])) == pytest.approx([0.5e-9, 0], abs=1e-24)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("0 0 0\n1 1 1\n", "not_a_table"),
        ("word\n", "not_a_table"),
        ("0 1\n1 1\n", "motion_samples"),
        ("0 0\n0 1\n", "motion_samples"),
        ("0 0\n", "motion_samples"),
    ],
    ids=["three columns", "word", "not at zero", "times do not increase", "one time"],
)
def test_file_without_a_motion_is_refused(text, code, tmp_path):
    path = tmp_path / "wall.txt"
    path.write_text(text)
    with refusal(code):
        read_motion(path)


def test_absent_file_is_refused(tmp_path):
    with refusal("not_a_table", "absent.txt"):
        read_motion(tmp_path / "absent.txt")


@pytest.mark.parametrize(
    ("make", "arguments", "code"),
    [
        (chirp, (1e-9, -1, 1e4, 1e-3), "chirp"),
        (chirp, (1e-9, 1e6, 1e9, 1.0), "chirp"),
        (step, (np.nan, 1e-5), "rise_time"),
        (Pulse, (1e-9, 1e5, 1.5), "argument"),
        (Pulse, (0.0,), "no_wave"),
        (Pulse, ("1 nm",), "argument"),
        (SampledMotion, (np.array([0.0, 1]), np.array([1.0, 0])), "motion_samples"),
        (SampledMotion, (np.array([0.0, 1]), np.array([0, 1e-200])), "no_wave"),
        (SampledMotion, (["a", "b"], [0, 1]), "motion_samples"),
        (SampledMotion, (np.zeros((2, 2)), np.zeros((2, 2))), "motion_samples"),
        (ContactDamping, (1e300, 0.0), "damping_ratio"),
        (ContactDamping, (0.0, -1e-9), "damping_ratio"),
        (ContactDamping, (np.nan, 0.0), "damping_ratio"),
        (ContactDamping, (0.0, "much"), "argument"),
    ],
)
def test_numbers_of_no_motion_or_damping_are_refused(make, arguments, code):
    with refusal(code):
        make(*arguments)


def test_lists_are_a_motion_as_arrays_are():
    listed = SampledMotion([0, 1e-5], [0, 1e-9])
    assert np.array_equal(listed.displacement([5e-6, 1.0]), [0.5e-9, 1e-9])
