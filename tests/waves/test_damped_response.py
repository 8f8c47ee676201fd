"""Frequency response through viscous contacts: dense solves, all complex modes, the wave itself."""

import json

import numpy as np
import pytest

import modal
from modal.__main__ import main
from modal.packing import crystal as gallery
from modal.packing.network import write_network
from modal.system.damping import ContactDamping
from modal.waves.response import read_response, write_response
from modal.waves.source import Pulse

pytestmark = pytest.mark.two_ways

DAMPING = ContactDamping(0.05, 0.03)


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
