"""What one question has taken is there for the next one about the same network."""

import gc
from dataclasses import replace

import numpy as np
import pytest

import modal
from modal.packing import crystal as gallery
from modal.solvers.factor import factorise

pytestmark = pytest.mark.two_ways
QUESTIONS = {
    "counts": lambda network: modal.count_modes(network, [3e4, 6e4]),
    "modes": lambda network: modal.eigenmodes(network, lowest=5).frequency,
    "moduli": lambda network: modal.elastic_moduli(network).stiffness,
}


@pytest.fixture
def made(monkeypatch):
    """A list to which each factorisation adds a name; one more for each that is given back."""
    names = []

    def noted(*arguments, **options):
        factor = factorise(*arguments, **options)
        names.append("made")

        def release():
            names.append("given back")
            factor.release()

        return replace(factor, release=release)

    for module in ("modal.system.linear_system", "modal.modes.counts"):
        monkeypatch.setattr(f"{module}.factorise", noted)
    return names


def answers(network):
    return [ask(network) for ask in QUESTIONS.values()]


def test_nothing_is_factorised_twice_and_the_second_answer_is_the_first(made):
    network = gallery.fcc(cells=(4, 4, 8))
    first = answers(network)
    factorised = made.count("made")
    assert factorised >= 3  # two counts and the factor of the modes, at least
    second = answers(network)
    assert made.count("made") == factorised
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)
    # Other springs are another network, of which nothing is known.
    stiffer = replace(network, stiffness_normal=2 * network.stiffness_normal)
    assert (answers(stiffer)[1] > first[1]).any()
    assert made.count("made") > factorised


def test_factors_go_with_their_network_and_large_ones_at_once(made, monkeypatch):
    network = gallery.fcc(cells=(4, 4, 8))
    first = answers(network)
    assert made.count("given back") < made.count("made")
    del network
    gc.collect()
    assert made.count("given back") == made.count("made")
    monkeypatch.setattr("modal.system.linear_system.KEPT", 0.0)
    network = gallery.fcc(cells=(4, 4, 8))
    for one, other in zip(first, answers(network), strict=True):
        np.testing.assert_array_equal(one, other)
    assert made.count("given back") == made.count("made")
