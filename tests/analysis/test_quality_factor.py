"""Quality factors against closed forms: single oscillators, a resonant column, two receivers."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

import modal
from analysis.estimators.arrival_rules import RecordPair
from analysis.estimators.quality_factor import (
    fitted_resonance,
    half_power,
    logarithmic_decrement,
    spectral_ratio,
)
from modal.motions import SineBurst
from modal.packing.crystal import column
from modal.packing.network import Network
from modal.system.damping import ContactDamping

SPHERES = 12


def resonant_column() -> Network:
    """Return a column of equal springs k, and of twice k at both walls.

    Such a wall is the mirror of an image that moves the opposite way: the modes are sines with
    theta = r pi / N, omega = 2 sqrt(k / m) sin(theta / 2).
    """
    network = column(SPHERES)
    stiffness = np.where(network.with_wall, 2.0, 1.0) * network.stiffness_normal.max()
    return replace(network, stiffness_normal=stiffness)


def first_omega(stiffness: float, inertia: float) -> float:
    """Return the angular frequency, rad/s, of the first resonance."""
    return float(2 * np.sqrt(stiffness / inertia) * np.sin(np.pi / (2 * SPHERES)))


@pytest.fixture(scope="module")
def damped_column():
    """Return the response of a damped column driven at its base, and its exact omega_1 and Q.

    Dashpots are c = 2 beta sqrt(k m / 2) between spheres and 2 beta sqrt(2 k m) at the wall: both
    2 beta sqrt(m / (2 k)) times the spring, so that Q of a mode is 1 / (omega c / k).
    """
    network = resonant_column()
    ratio = 0.1
    stiffness = network.stiffness_normal.min()
    mass = network.mass[0]
    omega = first_omega(stiffness, mass)
    quality = 1 / (omega * 2 * ratio * np.sqrt(mass / (2 * stiffness)))
    highest = 1.5 * omega / (2 * np.pi)
    response = modal.frequency_response(
        network, highest=highest, resolution=highest / 40, damping=ContactDamping(ratio, ratio)
    )
    return response, omega, quality


def test_fitted_resonance_of_a_damped_column(damped_column):
    """Compare f_1 and Q within 1e-4: other resonances are twice as high and higher."""
    response, omega, quality = damped_column
    middle = response.layer_displacement[:, SPHERES // 2]
    fit = fitted_resonance(response.frequency, middle)
    assert fit.frequency == pytest.approx(omega / (2 * np.pi), rel=1e-4)
    assert fit.quality == pytest.approx(quality, rel=1e-4)
    assert fit.error < 1e-3 * quality


def test_half_power_width_of_a_damped_column(damped_column):
    """Compare Q within 1 / Q: the width is that of a single oscillator, without other modes."""
    response, _, quality = damped_column
    middle = abs(response.layer_displacement[:, SPHERES // 2])
    measured = half_power(response.frequency, middle).quality
    assert measured == pytest.approx(quality, rel=1 / quality)


def test_torsional_column():
    """Compare a column of twisting springs alone: f_1 of the same sines, Q of the window's width.

    The window replaces omega by omega + i gamma: an oscillator of omega_1^2 + gamma^2 and a rate of
    2 gamma.
    """
    network = resonant_column()
    twisting = network.stiffness_normal * network.radius[0] ** 2
    bonded = replace(network, stiffness_twisting=twisting, stiffness_rolling=0 * twisting)
    omega = first_omega(twisting.min(), network.inertia[0])
    first = omega / (2 * np.pi)
    response = modal.frequency_response(
        bonded, direction="torsion", highest=1.6 * first, resolution=first / 50, tolerance=1e-8
    )
    fit = fitted_resonance(response.frequency, response.layer_displacement[:, SPHERES // 2])
    gamma = np.pi * response.resolution
    exact = np.hypot(omega, gamma)
    assert fit.frequency == pytest.approx(exact / (2 * np.pi), rel=1e-4)
    assert fit.quality == pytest.approx(exact / (2 * gamma), rel=1e-4)


OMEGA = 2 * np.pi * 1e4
"""Angular frequency of a single oscillator without damping, rad/s."""


@pytest.mark.parametrize("quality", [3.0, 30.0])
def test_free_decay_of_an_oscillator(quality):
    """Compare within 1e-4, the error of maxima between samples, 60 a period."""
    rate = OMEGA / (2 * quality)
    damped_omega = np.sqrt(OMEGA**2 - rate**2)
    time = np.arange(0, 20 * quality / OMEGA, 1 / (60 * 1e4))
    decay = np.exp(-rate * time) * np.cos(damped_omega * time + 0.3)
    measured = logarithmic_decrement(time, decay)
    assert measured.quality == pytest.approx(quality, rel=1e-4)
    assert measured.frequency == pytest.approx(damped_omega / (2 * np.pi), rel=1e-4)


def response_of_oscillator(quality):
    """Return frequencies, Hz, and the complex response of an oscillator at them."""
    frequency = np.linspace(2e3, 2e4, 800)
    drive = 2 * np.pi * frequency
    return frequency, 1 / (OMEGA**2 - drive**2 - 1j * drive * OMEGA / quality)


@pytest.mark.parametrize("quality", [3.0, 30.0])
def test_fitted_resonance_of_an_oscillator(quality):
    fit = fitted_resonance(*response_of_oscillator(quality))
    assert fit.quality == pytest.approx(quality, rel=1e-8)


@pytest.mark.parametrize("quality", [3.0, 30.0])
def test_half_power_width_of_an_oscillator(quality):
    """Allow 1 / Q^2: the width in omega^2 is exact, that in omega to this order."""
    frequency, response = response_of_oscillator(quality)
    measured = half_power(frequency, abs(response)).quality
    assert measured == pytest.approx(quality, rel=quality**-2)


@pytest.fixture(scope="module")
def ratio_of_receivers():
    """Return the ratio of spectra at two receivers, the exact Q, and the time between them, s.

    The pulse loses exp(-pi f t / Q) at each frequency, and two thirds of its size by spreading.
    """
    interval = 1e-6
    n_times = 4096
    quality = 15.0
    delay = 3e-4
    time = interval * np.arange(n_times)
    sent = SineBurst(1.0, 1e4, 2, "hann").displacement(time)
    frequency = np.fft.rfftfreq(n_times, interval)
    exponent = -np.pi * frequency * delay / quality - 2j * np.pi * frequency * delay
    received = np.fft.irfft(np.fft.rfft(sent) * np.exp(exponent) / 3, n_times)
    return spectral_ratio(RecordPair(time, sent, received, 1e4), delay), quality, delay


def test_quality_between_two_receivers(ratio_of_receivers):
    """Allow 5e-3 for what runs ahead of and behind the pulse without dispersion, which is cut."""
    ratio, quality, _ = ratio_of_receivers
    assert ratio.quality.quality == pytest.approx(quality, rel=5e-3)


def test_attenuation_between_two_receivers(ratio_of_receivers):
    ratio, quality, delay = ratio_of_receivers
    exact = np.log(3) + np.pi * ratio.frequency * delay / quality
    assert ratio.attenuation == pytest.approx(exact, abs=0.02)


FREQUENCY = np.linspace(1, 2, 50)


@pytest.mark.parametrize(
    "amplitude",
    [
        pytest.param(FREQUENCY, id="rising"),
        pytest.param(1 + 0.1 * np.sin(9 * FREQUENCY), id="flat"),
    ],
)
def test_a_response_without_a_resonance_has_no_width(amplitude):
    with refusal("no_resonance"):
        half_power(FREQUENCY, amplitude)


def test_a_decay_without_oscillations_has_no_decrement():
    with refusal("no_resonance"):
        logarithmic_decrement(FREQUENCY, np.exp(-FREQUENCY))
