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
    """Return a burst of 10 kHz, and the same burst later by `DELAY` and weaker."""
    burst = SineBurst(1e-9, 1e4, cycles, window)
    time = interval * np.arange(round(6e-4 / interval))
    return RecordPair(time, burst.displacement(time), 0.02 * burst.displacement(time - DELAY), 1e4)


INTERVALS = 4e-6 / 2 ** np.arange(3)
"""Intervals of records, s, each half of the one before."""
ROUND_OFF = 1e-8 * DELAY


@pytest.mark.parametrize("rule", RULES)
def test_time_of_a_delayed_pulse(rule):
    """Find the delay within the error of the sampling, which is of second order at least."""
    times = [analysis.travel_time(delayed(interval), rule) for interval in INTERVALS]
    errors = np.array([abs(time.value - DELAY) for time in times])
    assert (errors < 2e-4 * DELAY).all(), errors
    # Halved twice, an error of second order is a sixteenth; one at round-off is as good.
    assert errors[2] < max(errors[0] / 10, ROUND_OFF)


@pytest.mark.parametrize("rule", RULES)
def test_stated_error_of_a_delayed_pulse(rule):
    """Allow three times the stated error."""
    for interval in INTERVALS:
        time = analysis.travel_time(delayed(interval), rule)
        assert abs(time.value - DELAY) <= 3 * time.error + ROUND_OFF


@pytest.mark.parametrize("rule", RULES)
def test_delay_of_few_periods_is_in_the_near_field(rule):
    """Warn at 1.24 periods, which are as many wavelengths."""
    time = analysis.travel_time(delayed(4e-6), rule)
    assert time.codes == ["near_field"]
    assert time.unit == "s"


@pytest.mark.parametrize("rule", RULES)
def test_sense_and_size_do_not_matter(rule):
    pair = delayed(1e-6)
    inverted = RecordPair(pair.time, -pair.source, -40 * pair.receiver, pair.frequency)
    expected = analysis.travel_time(pair, rule).value
    assert analysis.travel_time(inverted, rule).value == pytest.approx(expected, rel=1e-12)


TIME = 1e-6 * np.arange(400)
BUMP = np.where((TIME > 0) & (TIME < 1e-4), np.sin(np.pi * TIME / 1e-4) ** 2, 0)
"""A pulse that returns to zero without passing through it."""
BUMPS = RecordPair(TIME, BUMP, np.roll(BUMP, 150), 1e4)


def test_a_pulse_of_one_sign_has_no_zero_crossing():
    assert analysis.travel_time(BUMPS, "zero_crossing").codes == ["no_such_point"]


def test_a_pulse_of_one_sign_has_a_peak():
    time = analysis.travel_time(BUMPS, "peak_to_peak")
    assert time.value == pytest.approx(1.5e-4, rel=1e-6)


@pytest.mark.parametrize("rule", RULES)
def test_a_receiver_at_rest_has_no_time(rule):
    time = analysis.travel_time(RecordPair(TIME, BUMP, 0 * BUMP, 1e4), rule)
    assert not time.known
    assert time.codes == ["no_such_point"]


def test_an_unknown_rule_is_refused():
    with refusal("unknown_word", "loudest"):
        analysis.travel_time(BUMPS, "loudest")


def test_signals_without_receivers_are_refused():
    signals = Signals(
        time=TIME,
        source_displacement=BUMP,
        producer="",
        case="",
        amplitude=1.0,
        input_frequency=1e4,
        time_step=1e-6,
        run_time=0.0,
    )
    with refusal("no_receivers"):
        analysis.travel_time(signals, "phase")


HIGHEST = 1e5
"""Highest frequency of the chain, Hz."""
FREQUENCY = 3e4
"""Frequency of the burst, Hz."""
MASSES = 30
"""Number of masses from source to receiver."""


@pytest.fixture(scope="module")
def chain():
    """Return the motion of the support of a half-infinite chain of masses, and of a mass n.

    The impulse response is h(t) = 2 n J_2n(omega_m t) / t, as its transform is exp(-2 n theta) for
    omega = i omega_m sinh(theta). The sum that stands for the convolution has an error that falls
    faster than any power of the step but for the burst's ends, which begin with the third.
    """
    omega_m = 2 * np.pi * HIGHEST
    burst = SineBurst(1.0, FREQUENCY, 4, "hann")
    steps_per_interval = 4
    step = 1 / (40 * FREQUENCY) / steps_per_interval
    duration = 6 / FREQUENCY + 1.4 * MASSES / (np.pi * HIGHEST)
    time = step * np.arange(int(duration / step))
    impulse = np.zeros(len(time))
    impulse[1:] = 2 * MASSES * jv(2 * MASSES, omega_m * time[1:]) / time[1:]
    source = burst.displacement(time)
    receiver = step * np.convolve(impulse, source)[: len(time)]
    recorded = slice(None, None, steps_per_interval)
    return RecordPair(time[recorded], source[recorded], receiver[recorded], FREQUENCY)


def phase_of_chain(omega):
    """Return the phase, rad, over the chain at omega, from omega = omega_m sin(kappa a / 2)."""
    return MASSES * 2 * np.arcsin(omega / (2 * np.pi * HIGHEST))


def test_phase_times_of_a_dispersive_chain(chain):
    """Allow a thousandth of a period for the end of the burst that the window cuts."""
    delays = phase_delays(chain)
    omega = 2 * np.pi * delays.frequency
    assert len(omega) > 10
    exact = phase_of_chain(omega) / omega
    assert delays.phase == pytest.approx(exact, abs=1e-3 / FREQUENCY)


def test_group_times_of_a_dispersive_chain(chain):
    """Compare near the burst's frequency; a derivative by differences has an error of 1e-3."""
    delays = phase_delays(chain)
    near = abs(delays.frequency / FREQUENCY - 1) < 0.15
    square = HIGHEST**2 - delays.frequency[near] ** 2
    exact = 2 * MASSES / (2 * np.pi * np.sqrt(square))
    assert delays.group[near] == pytest.approx(exact, rel=1e-3)


def test_phase_rule_gives_the_phase_velocity_of_the_burst(chain):
    """Compare at the burst's frequency; the time of long waves is 1 % shorter."""
    omega = 2 * np.pi * FREQUENCY
    time = analysis.travel_time(chain, "phase")
    assert abs(time.value - phase_of_chain(omega) / omega) <= 2 * time.error + 1e-3 / FREQUENCY
    time_of_long_waves = MASSES / (np.pi * HIGHEST)
    assert time.value > 1.01 * time_of_long_waves


def stokes_pair(wavelengths: float, cycles: int = 1) -> tuple[RecordPair, Stokes, float]:
    """Return traces of a point force and of the motion across it, the solid, and the distance, m.

    The distance is so many wavelengths of S-waves.
    """
    solid = Stokes(cycles=cycles)
    distance = wavelengths * solid.v_s / solid.frequency
    time = np.arange(0, 1.6 * distance / solid.v_s + (cycles + 1) / solid.frequency, 1e-6)
    pair = RecordPair(time, solid.force(time), solid.transverse(time, distance), solid.frequency)
    return pair, solid, distance


@pytest.mark.parametrize("rule", ["zero_crossing", "peak_to_peak", "cross_correlation"])
def test_near_field_fades_with_distance(rule):
    """Approach V_S across a point force as the inverse square of the distance.

    The near field is 1 / (k r) of the far one and a quarter of a period ahead, so that it shifts
    a time by about 1 / (omega k r), and a velocity, relatively, by 1 / (k r)^2.
    """
    errors = []
    for wavelengths in (1.0, 2.0, 4.0, 8.0, 16.0):
        pair, solid, distance = stokes_pair(wavelengths)
        time = analysis.travel_time(pair, rule)
        errors.append(abs(distance / time.value / solid.v_s - 1))
        assert ("near_field" in time.codes) == (time.value * solid.frequency < 2)
    assert errors[0] > 0.02
    assert errors[-1] < 3e-4
    # A tenth: terms of higher order.
    assert errors[-2] / errors[-1] == pytest.approx(4, rel=0.1)


def velocity_of_first_arrival(wavelengths):
    """Return the velocity, m/s, of the first deflection at a distance, and the solid."""
    pair, solid, distance = stokes_pair(wavelengths)
    return distance / analysis.travel_time(pair, "first_arrival").value, solid


def test_first_arrival_is_that_of_the_near_field():
    """Measure within half a wavelength: the first deflection is the near field's, up to V_P."""
    velocity, solid = velocity_of_first_arrival(0.5)
    assert 1.1 * solid.v_s < velocity < solid.v_p


def test_first_arrival_far_away_is_that_of_the_s_wave():
    velocity, solid = velocity_of_first_arrival(40.0)
    assert velocity == pytest.approx(solid.v_s, rel=0.01)


def test_picks_of_the_first_arrival_are_in_their_order():
    pair, _, _ = stokes_pair(40.0)
    source, receiver = picks(pair, "first_arrival")
    assert 0 < source < receiver < pair.time[-1]


def test_phase_of_stokes_solution():
    """Compare with the closed transfer function, near field included.

    The window cuts nothing of a wave that has an end, so only the error of the sampling remains.
    """
    pair, solid, distance = stokes_pair(1.5, cycles=4)
    delays = phase_delays(pair)
    exact = solid.transverse_phase_delay(delays.frequency, distance)
    assert delays.phase == pytest.approx(exact, rel=1e-5)
    # The near field changes the phase.
    assert abs(exact / (distance / solid.v_s) - 1).max() > 0.01
