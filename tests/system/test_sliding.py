"""Contacts at the friction limit that slip: every command and function is that of kt = 0."""

import json
from dataclasses import replace

import numpy as np
import pytest
from packings import polydisperse

import modal
from modal.__main__ import main
from modal.packing.network import write_network

SLAB = polydisperse(n=40)
"""One contact in five slides."""


def without_kt(network):
    return replace(
        network,
        stiffness_tangential=np.where(network.sliding, 0.0, network.stiffness_tangential),
        sliding=np.zeros(network.n_contacts, bool),
    )


ANSWERS = {
    "modes": lambda net, **how: modal.eigenmodes(net, all=True, **how).frequency,
    "count": lambda net, **how: modal.count_modes(net, [2e4, 1e5, 2e5], **how),
    "density": lambda net, **how: modal.density_of_states(net, **how).density([5e4, 1e5])[0],
    "wave": lambda net, **how: modal.propagate(net, 5e-5, **how).signals.receiver_stress,
    "response": lambda net, **how: modal.frequency_response(net, highest=1e5, **how).gain,
    "moduli": lambda net, **how: modal.elastic_moduli(net, **how).stiffness,
}
COMMANDS = {
    "modes": (["--lowest", "20"], "frequency_hz"),
    "count": (["--at", "2e4", "1e5", "2e5"], "count_below"),
    "density": (["--at", "2e4", "1e5"], "estimated_count_below"),
    "wave": (["--duration", "2e-5"], "largest_displacement_m"),
    "response": (["--highest", "5e4"], "gain_maxima_hz"),
    "moduli": ([], "stiffness_pa"),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_every_question_has_the_answer_of_no_tangential_spring(name, tmp_path, capsys):
    """The same springs, so the same bits; the elastic answer is another one."""
    ask = ANSWERS[name]
    assert np.array_equal(ask(SLAB, sliding="slip"), ask(without_kt(SLAB)))
    assert not np.array_equal(ask(SLAB), ask(without_kt(SLAB)))
    with pytest.raises(modal.InputError, match="choose one of elastic, slip"):
        ask(SLAB, sliding="yes")
    told, smooth = [], modal.random_packing(spheres=60, friction=0.0, seed=2)
    assert smooth.sliding.all()
    for network, options in ((smooth, ["--sliding", "slip"]), (without_kt(smooth), [])):
        write_network(tmp_path / "a.network.h5", network)
        given, key = COMMANDS[name]
        command = [name, str(tmp_path / "a.network.h5"), *given, *options, "--json"]
        assert main(command) == 0
        told.append(json.loads(capsys.readouterr().out)[key])
    assert told[0] == told[1]
