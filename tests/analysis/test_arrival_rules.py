"""Rules of travel time on exact signals: a delayed pulse, a dispersive chain, Stokes' solution."""

import numpy as np
import pytest
from refusals import refusal
from scipy.special import jv
from stokes import Stokes

import analysis
from analysis.estimators.arrival_rules import RULES, RecordPair, phase_delays, picks
from modal.motions import SineBurst
from modal.waves.signals import Signals

DELAY = 1.237e-4
"""Delay, s, that is no whole number of samples."""


def delayed(interval: float, cycles: int = 2, window: str = "hann") -> RecordPair:
    """A burst of 10 kHz, and the same later by `DELAY` and weaker."""
    burst = SineBurst(1e-9, 1e4, cycles, window)
    time = interval * np.arange(round(6e-4 / interval))
    return RecordPair(time, burst.displacement(time), 0.02 * burst.displacement(time - DELAY), 1e4)


@pytest.mark.parametrize("rule", RULES)
def test_delayed_pulse(rule):
    """The delay to the error of the sampling, which falls at least as the interval's square."""
    intervals = 4e-6 / 2 ** np.arange(3)
    times = [analysis.travel_time(delayed(interval), rule) for interval in intervals]
    errors = np.array([abs(time.value - DELAY) for time in times])
    assert (errors < 2e-4 * DELAY).all(), errors
    # Halved twice, an error of second order is a sixteenth; one at round-off is as good.
    assert errors[2] < max(errors[0] / 10, 1e-8 * DELAY)
    stated = np.array([time.error for time in times])
    assert (errors <= 3 * stated + 1e-8 * DELAY).all(), (errors, stated)
    # 1.24 wavelengths
    assert times[0].codes == ["near_field"] and times[0].unit == "s"


@pytest.mark.parametrize("rule", RULES)
def test_sense_and_size_do_not_matter(rule):
    pair = delayed(1e-6)
    turned = RecordPair(pair.time, -pair.source, -40 * pair.receiver, pair.frequency)
    found = analysis.travel_time(turned, rule)
    assert found.value == pytest.approx(analysis.travel_time(pair, rule).value, rel=1e-12)


def test_what_a_trace_does_not_have():
    """A pulse that only returns to zero has no passage through it; rest has nothing."""
    time = 1e-6 * np.arange(400)
    bump = np.where((time > 0) & (time < 1e-4), np.sin(np.pi * time / 1e-4) ** 2, 0)
    later = np.roll(bump, 150)
    assert analysis.travel_time(RecordPair(time, bump, later, 1e4), "zero_crossing").codes == [
        "no_such_point"
    ]
    assert analysis.travel_time(RecordPair(time, bump, later, 1e4), "peak_to_peak").value == (
        pytest.approx(1.5e-4, rel=1e-6)
    )
    for rule in RULES:
        value = analysis.travel_time(RecordPair(time, bump, 0 * bump, 1e4), rule)
        assert not value.known and value.codes == ["no_such_point"]
    with refusal("unknown_word", "loudest"):
        analysis.travel_time(RecordPair(time, bump, later, 1e4), "loudest")
    silent = Signals(
        time=time, source_displacement=bump, producer="", case="", amplitude=1.0,
        input_frequency=1e4, time_step=1e-6, run_time=0.0,
    )  # fmt: skip
    with refusal("no_receivers"):
        analysis.travel_time(silent, "phase")


def chain_pair(masses: int, frequency: float, top: float = 1e5) -> RecordPair:
    """A half-infinite chain of masses whose first support moves, and the motion of mass n.

    The impulse response is h(t) = 2 n J_2n(omega_m t) / t, as its transform is exp(-2 n theta) for
    omega = i omega_m sinh(theta). The sum that stands for the convolution has an error that falls
    faster than any power of the step but for the burst's ends, which begin with the third.
    """
    omega_m = 2 * np.pi * top
    burst = SineBurst(1.0, frequency, 4, "hann")
    finer, interval = 4, 1 / (40 * frequency)
    step = interval / finer
    time = step * np.arange(int((6 / frequency + 1.4 * masses / (np.pi * top)) / step))
    impulse = np.zeros(len(time))
    impulse[1:] = 2 * masses * jv(2 * masses, omega_m * time[1:]) / time[1:]
    receiver = step * np.convolve(impulse, burst.displacement(time))[: len(time)]
    return RecordPair(
        time[::finer], burst.displacement(time)[::finer], receiver[::finer], frequency
    )


def test_dispersive_chain():
    """Phase and group times over frequency are those of the lattice, omega = omega_m sin(ka/2)."""
    masses, frequency, top = 30, 3e4, 1e5
    pair = chain_pair(masses, frequency, top)
    delays = phase_delays(pair)
    omega, omega_m = 2 * np.pi * delays.frequency, 2 * np.pi * top
    phase = masses * 2 * np.arcsin(omega / omega_m) / omega
    group = masses * 2 / np.sqrt(omega_m**2 - omega**2)
    assert len(omega) > 10
    # What the window cuts of the dispersed burst's tail, in periods.
    assert delays.phase == pytest.approx(phase, abs=1e-3 / frequency)
    # The derivative by differences.
    middle = abs(delays.frequency / frequency - 1) < 0.15
    assert delays.group[middle] == pytest.approx(group[middle], rel=1e-3)
    # The phase rule reads the phase velocity at the burst's frequency, not the long waves'.
    long_wave = masses / (np.pi * top)
    sent = 2 * np.pi * frequency
    exact = masses * 2 * np.arcsin(sent / omega_m) / sent
    found = analysis.travel_time(pair, "phase")
    assert abs(found.value - exact) <= 2 * found.error + 1e-3 / frequency
    assert found.value > 1.01 * long_wave


def stokes_pair(wavelengths: float, cycles: int = 1) -> tuple[RecordPair, Stokes, float]:
    """Traces of force and motion at so many S-wavelengths across the force; distance, m."""
    solid = Stokes(cycles=cycles)
    distance = wavelengths * solid.v_s / solid.frequency
    time = np.arange(0, 1.6 * distance / solid.v_s + (cycles + 1) / solid.frequency, 1e-6)
    pair = RecordPair(time, solid.force(time), solid.transverse(time, distance), solid.frequency)
    return pair, solid, distance


@pytest.mark.parametrize("rule", ["zero_crossing", "peak_to_peak", "cross_correlation"])
def test_near_field_fades_with_distance(rule):
    """Velocities across a point force tend to V_S as the inverse square of the distance.

    The near field is 1 / (k r) of the far one and a quarter of a period ahead, so that it shifts
    a time by about 1 / (omega k r), and a velocity, relatively, by 1 / (k r)^2.
    """
    bias = []
    for wavelengths in (1.0, 2.0, 4.0, 8.0, 16.0):
        pair, solid, distance = stokes_pair(wavelengths)
        found = analysis.travel_time(pair, rule)
        bias.append(abs(distance / found.value / solid.v_s - 1))
        assert ("near_field" in found.codes) == (found.value * solid.frequency < 2)
    assert bias[-1] < 3e-4 and bias[0] > 0.02, bias
    assert bias[-2] / bias[-1] == pytest.approx(4, rel=0.1)


def test_first_arrival_is_that_of_the_near_field():
    """The first deflection, opposite to the main one, runs ahead at up to V_P; far away V_S."""
    velocities = []
    for wavelengths in (0.5, 1.0, 2.0, 8.0, 40.0):
        pair, solid, distance = stokes_pair(wavelengths)
        velocities.append(distance / analysis.travel_time(pair, "first_arrival").value)
    assert solid.v_s < velocities[0] < solid.v_p
    assert velocities[0] > 1.1 * solid.v_s and velocities[-1] == pytest.approx(solid.v_s, rel=0.01)
    source, receiver = picks(pair, "first_arrival")
    assert 0 < source < receiver < pair.time[-1]


def test_phase_of_stokes_solution():
    """Over frequency, near field included, against the closed transfer function."""
    pair, solid, distance = stokes_pair(1.5, cycles=4)
    delays = phase_delays(pair)
    exact = solid.transverse_phase_delay(delays.frequency, distance)
    # The window fades nothing of a wave that has an end; what is left is the sampling.
    assert delays.phase == pytest.approx(exact, rel=1e-5)
    assert abs(exact / (distance / solid.v_s) - 1).max() > 0.01
