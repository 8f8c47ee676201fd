"""Frequency response through viscous contacts: dense solves, all complex modes, the wave itself."""

import json

import numpy as np
import pytest
from packings import wall_pattern

import modal
from modal.__main__ import main
from modal.modes.damped import damped_modes
from modal.modes.zero_modes import by_structure
from modal.packing import crystal as gallery
from modal.packing.network import SOURCE_WALL, write_network
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.waves.response import read_response, write_response
from modal.waves.source import Pulse

pytestmark = pytest.mark.two_ways

DAMPING = ContactDamping(0.05, 0.03)


def test_equal_to_the_sum_of_all_complex_modes():
    """Every mode with its conjugate: phi phi^T / (phi^T (2 lambda M + C) phi), lambda's residue."""
    network = gallery.fcc(cells=(1, 1, 15))
    system = LinearSystem.of(network)
    count = system.size - by_structure(system).basis.shape[1]
    every = damped_modes(network, DAMPING, near=1e5, count=count)
    rate = -every.decay + 2j * np.pi * every.frequency
    phi, mass = every.shape.reshape(count, -1).T, mass_diagonal(network)
    dashpots = DAMPING.dashpots(network)
    C = stiffness_matrix(dashpots).toarray()
    spring, drag = (wall_pattern(of, SOURCE_WALL)[0] for of in (network, dashpots))
    # Modes of one rate, as crystals have, must be orthogonal in this product.
    weight = phi.T @ (C @ phi) + (rate[:, None] + rate) * (phi.T @ (mass[:, None] * phi))
    same = abs(rate[:, None] - rate) < 1e-6 * abs(rate)
    inverse = np.linalg.inv(np.where(same, weight, 0))
    found = modal.frequency_response(network, highest=1.5e5, resolution=2e4, damping=DAMPING)
    for k, f in enumerate(found.frequency):
        s = -2j * np.pi * f
        force = spring + s * drag
        u = phi @ ((inverse @ (phi.T @ force)) / (s - rate))
        u += phi.conj() @ ((inverse.conj() @ (phi.T.conj() @ force)) / (s - rate.conj()))
        chain = u[6 * found.chain_particle + 2]
        assert found.chain_displacement[k] == pytest.approx(chain, abs=1e-7 * abs(chain).max())


def test_equal_to_the_transform_of_a_wave_that_has_come_to_rest():
    """Taylor series in time, factors in frequency: they share nothing but the matrices."""
    damping = ContactDamping(0.3, 0.2)
    network = gallery.fcc(cells=(1, 1, 12))
    found = modal.frequency_response(network, highest=1e5, resolution=2.4e4, damping=damping)
    pulse = Pulse(2.5e-9, 1e5)
    signals = modal.propagate(
        network, 2.5e-3, damping=damping, motion=pulse, interval=2.5e-7, tolerance=1e-11
    ).signals
    assert abs(signals.chain_displacement[-1]).max() < 1e-8 * abs(signals.chain_displacement).max()
    kernel = np.exp(2j * np.pi * found.frequency[:, None] * signals.time)
    sent = kernel @ signals.source_displacement
    # The trapezium rule folds what is at 4 MHz onto these frequencies: a pulse falls as f^-3, its
    # velocity, which the dashpots of the source wall feel, as f^-2: (0.1 / 4)^2 = 6e-4.
    for name, near in (
        ("chain_displacement", 1e-4),
        ("receiver_stress", 1e-4),
        ("source_stress", 1e-3),
    ):
        ratio = kernel @ getattr(signals, name)
        ratio = ratio / (sent if ratio.ndim == 1 else sent[:, None])
        wanted = getattr(found, name)
        assert abs(ratio - wanted).max() < near * abs(wanted).max()


def test_little_damping_is_the_elastic_response_far_from_resonance():
    network = gallery.fcc(cells=(1, 1, 12))
    nearly = modal.frequency_response(
        network, highest=3e5, resolution=1e5, damping=ContactDamping(1e-9, 1e-9)
    )
    elastic = modal.eigenmodes(network, all=True)
    for k, f in enumerate(nearly.frequency):
        if abs(elastic.frequency / f - 1).min() < 1e-4:
            continue
        K, M = stiffness_matrix(network).toarray(), np.diag(mass_diagonal(network))
        u = np.linalg.solve(K - (2 * np.pi * f) ** 2 * M, wall_pattern(network, SOURCE_WALL)[0])
        chain = u[6 * nearly.chain_particle + 2]
        assert nearly.chain_displacement[k].real == pytest.approx(chain, abs=1e-5 * abs(u).max())


def test_command_file_and_mistakes(tmp_path, capsys):
    network, path = gallery.fcc(cells=(1, 1, 10)), tmp_path / "c.network.h5"
    write_network(path, network)
    product = tmp_path / "c.response.h5"
    command = ["response", str(path), "--highest", "2e4", "--damping"]
    assert main([*command, "0.05", "0.03", "-o", str(product), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    found = read_response(product)
    assert said["damping"] == [0.05, 0.03] and found.damping == DAMPING
    assert "damping 0.05 0.03" in repr(found)
    write_response(product, modal.frequency_response(network, highest=2e4))
    assert read_response(product).damping is None
    for wrong, words in (
        ([*command, "-0.1", "0"], "takes energy"),
        ([*command, "0.1", "0", "--resolution", "1e-12"], "fewer frequencies"),
    ):
        assert main(wrong) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1
