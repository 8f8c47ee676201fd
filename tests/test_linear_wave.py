"""The Chebyshev wave against modal superposition, energy balance and a short chain."""

import numpy as np
import pytest

from modal import gallery
from modal.__main__ import main
from modal.modes import Eigenproblem
from modal.network import SOURCE_WALL, write_network
from modal.signals import read_signals, source_pulse
from modal.wave import propagate, pulse_response, wall_pattern


def test_pulse_response_solves_the_oscillator():
    """y'' + omega^2 y = d by central differences: the error falls with the step squared."""
    square = (2 * np.pi * np.array([0.0, 3e4, 1e5, 2.1e5])) ** 2
    errors = []
    for step in (2e-8, 1e-8):
        time = np.arange(0, 3e-5, step)
        y = pulse_response(square, time, 1e5)
        second = (y[:, 2:] - 2 * y[:, 1:-1] + y[:, :-2]) / step**2
        smooth = abs(time[1:-1] - 1e-5) > 3 * step
        defect = second + square[:, None] * y[:, 1:-1] - source_pulse(time[1:-1], 1.0, 1e5)
        errors.append(abs(defect[:, smooth]).max())
    # Round-off of the second difference, eps y / step^2, is below 2e-9 * 1e-6 / 1e-16 = 2e-5.
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)


@pytest.mark.parametrize("network", [gallery.fcc(2, 8), gallery.column(5)])
def test_wave_equals_modal_superposition(network):
    wave = propagate(network, 2e-4, tolerance=1e-12)
    problem = Eigenproblem.of(network)
    square, vector = np.linalg.eigh(problem.scaled.toarray())
    source, _ = wall_pattern(network, SOURCE_WALL)
    weight = vector.T @ (source / np.sqrt(problem.mass))
    y = pulse_response(np.maximum(square, 0), wave.signals.time, 1e5)
    motion = (vector @ (weight[:, None] * y)).T / np.sqrt(problem.mass) * 2.5e-9
    expected = motion[:, 6 * wave.signals.chain_particle + 2]
    found = wave.signals.chain_displacement
    # The tolerance of 1e-12 times some hundred coefficients.
    assert abs(found - expected).max() <= 1e-9 * abs(expected).max()


def test_work_of_the_source_is_the_energy_of_the_packing():
    """After the pulse the work done at the wall equals kinetic plus elastic energy."""
    network = gallery.fcc(2, 12)
    wave = propagate(network, 1.5e-5, interval=1e-9)
    area = network.cell_size[0] * network.cell_size[1]
    signals = wave.signals
    speed = np.gradient(signals.source_displacement, signals.time)
    work = np.trapezoid(signals.source_stress * area * speed, signals.time)
    problem = Eigenproblem.of(network)
    square, vector = np.linalg.eigh(problem.scaled.toarray())
    source, _ = wall_pattern(network, SOURCE_WALL)
    weight = vector.T @ (source / np.sqrt(problem.mass)) * 2.5e-9
    near = 1.5e-5 + np.array([-1e-10, 0, 1e-10])
    y = pulse_response(square, near, 1e5)
    rate = (y[:, 2] - y[:, 0]) / 2e-10
    energy = 0.5 * np.sum(weight**2 * (rate**2 + square * y[:, 1] ** 2))
    # Trapezoid and difference quotient at 1 ns: (2 pi 1e5 * 1e-9)^2 / 6 < 1e-7.
    assert work == pytest.approx(energy, rel=1e-6)


def test_number_of_products_is_the_known_optimum():
    network = gallery.fcc(2, 30)
    wave = propagate(network, 3e-4, tolerance=1e-8)
    assert wave.products <= 1.15 * 2 * np.pi * 211.1e3 * 3e-4 / 2 + 60


def test_wave_on_the_command_line(tmp_path, capsys):
    path, out = tmp_path / "a.network.h5", tmp_path / "a.signals.h5"
    write_network(path, gallery.fcc(2, 6))
    assert main(["wave", str(path), "--duration", "5e-5", "-o", str(out)]) == 0
    signals = read_signals(out)
    assert signals.producer == "linear"
    assert signals.chain_displacement.shape == (51, 6)
    assert main(["wave", str(path), "--duration", "-1"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
