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
    """A column of equal springs k, and of twice k at both walls.

    Such a wall is the mirror of an image that moves the opposite way: the modes are sines with
    theta = r pi / N, omega = 2 sqrt(k / m) sin(theta / 2).
    """
    network = column(SPHERES)
    stiffness = np.where(network.with_wall, 2.0, 1.0) * network.stiffness_normal.max()
    return replace(network, stiffness_normal=stiffness)


def omega_of(stiffness: float, inertia: float) -> float:
    """Angular frequency, rad/s, of the first resonance."""
    return float(2 * np.sqrt(stiffness / inertia) * np.sin(np.pi / (2 * SPHERES)))


@pytest.mark.parametrize("ratio", [0.1])
def test_damped_column(ratio):
    """f_1 and Q of a column driven at its base, to 1e-4.

    Dashpots are c = 2 beta sqrt(k m / 2) between spheres and 2 beta sqrt(2 k m) at the wall: both
    2 beta sqrt(m / (2 k)) times the spring, so that Q of a mode is 1 / (omega c / k).
    """
    network = resonant_column()
    stiffness, mass = network.stiffness_normal.min(), network.mass[0]
    omega = omega_of(stiffness, mass)
    quality = 1 / (omega * 2 * ratio * np.sqrt(mass / (2 * stiffness)))
    highest = 1.5 * omega / (2 * np.pi)
    found = modal.frequency_response(
        network, highest=highest, resolution=highest / 40, damping=ContactDamping(ratio, ratio)
    )
    middle = found.layer_displacement[:, SPHERES // 2]
    fitted = fitted_resonance(found.frequency, middle)
    assert fitted.frequency == pytest.approx(omega / (2 * np.pi), rel=1e-4)
    assert fitted.quality == pytest.approx(quality, rel=1e-4)
    assert fitted.error < 1e-3 * quality
    # The width is that of a single oscillator without a rest: good to some 1 / Q.
    assert half_power(found.frequency, abs(middle)).quality == pytest.approx(
        quality, rel=1 / quality
    )


def test_torsional_column():
    """Twisting springs kw alone: f_1 of the same sines, Q of the window's known width."""
    network = resonant_column()
    twisting = network.stiffness_normal * network.radius[0] ** 2
    bonded = replace(network, stiffness_twisting=twisting, stiffness_rolling=0 * twisting)
    omega = omega_of(twisting.min(), network.inertia[0])
    first = omega / (2 * np.pi)
    found = modal.frequency_response(
        bonded, direction="torsion", highest=1.6 * first, resolution=first / 50, tolerance=1e-8
    )
    fitted = fitted_resonance(found.frequency, found.layer_displacement[:, SPHERES // 2])
    # In place of omega stands omega + i gamma: an oscillator of omega_1^2 + gamma^2 and a rate of
    # 2 gamma.
    gamma = np.pi * found.resolution
    undamped = np.hypot(omega, gamma)
    assert fitted.frequency == pytest.approx(undamped / (2 * np.pi), rel=1e-4)
    assert fitted.quality == pytest.approx(undamped / (2 * gamma), rel=1e-4)


@pytest.mark.parametrize("quality", [3.0, 30.0])
def test_single_oscillator(quality):
    """A free decay, and its response: exact but for the sampling."""
    omega = 2 * np.pi * 1e4
    rate = omega / (2 * quality)
    swing = np.sqrt(omega**2 - rate**2)
    time = np.arange(0, 20 * quality / omega, 1 / (60 * 1e4))
    decay = np.exp(-rate * time) * np.cos(swing * time + 0.3)
    found = logarithmic_decrement(time, decay)
    assert found.quality == pytest.approx(quality, rel=1e-4)
    assert found.frequency == pytest.approx(swing / (2 * np.pi), rel=1e-4)
    frequency = np.linspace(2e3, 2e4, 800)
    drive = 2 * np.pi * frequency
    response = 1 / (omega**2 - drive**2 - 1j * drive * omega / quality)
    fitted = fitted_resonance(frequency, response)
    assert fitted.quality == pytest.approx(quality, rel=1e-8)
    # omega_r^2 = omega^2 - 2 rate^2; the width in omega^2 is exact, in omega to order 1 / Q^2.
    assert half_power(frequency, abs(response)).quality == pytest.approx(quality, rel=quality**-2)


def test_two_receivers():
    """A pulse that loses exp(-pi f t / Q) at each frequency, and a third of all by spreading."""
    interval, count, quality, time = 1e-6, 4096, 15.0, 3e-4
    at = interval * np.arange(count)
    sent = SineBurst(1.0, 1e4, 2, "hann").displacement(at)
    frequency = np.fft.rfftfreq(count, interval)
    loss = np.exp(-np.pi * frequency * time / quality - 2j * np.pi * frequency * time) / 3
    received = np.fft.irfft(np.fft.rfft(sent) * loss, count)
    found = spectral_ratio(RecordPair(at, sent, received, 1e4), time)
    # The window cuts what runs ahead of the pulse and behind it without dispersion.
    assert found.quality.quality == pytest.approx(quality, rel=5e-3)
    assert found.attenuation == pytest.approx(
        np.log(3) + np.pi * found.frequency * time / quality, abs=0.02
    )


def test_no_resonance():
    frequency = np.linspace(1, 2, 50)
    with refusal("no_resonance"):
        half_power(frequency, frequency)
    with refusal("no_resonance"):
        half_power(frequency, 1 + 0.1 * np.sin(9 * frequency))
    with refusal("no_resonance"):
        logarithmic_decrement(frequency, np.exp(-frequency))
