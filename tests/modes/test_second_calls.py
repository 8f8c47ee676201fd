"""What one question has taken is there for the next one about the same network."""

import gc
from dataclasses import replace

import numpy as np
import pytest

import modal
from modal.packing import crystal as gallery
from modal.solvers import lanczos, spectrum
from modal.solvers.factor import factorise

QUESTIONS = {
    "counts": lambda network: modal.count_modes(network, [3e4, 6e4]),
    "modes": lambda network: modal.eigenmodes(network, lowest=5).frequency,
    "interval": lambda network: modal.eigenmodes(network, between=(3e4, 4e4)).mode_shape,
    "highest": lambda network: modal.eigenmodes(network, highest=3).frequency,
    "density": lambda network: modal.density_of_states(network, tolerance=0.1).moments,
    "moduli": lambda network: modal.elastic_moduli(network).stiffness,
}


@pytest.fixture
def made(monkeypatch):
    """Return a list to which each factorisation and search adds its name.

    A factor that is released adds another name.
    """
    names = []

    def noted(*arguments, **options):
        factor = factorise(*arguments, **options)
        names.append("made")

        def release():
            names.append("given back")
            factor.release()

        return replace(factor, release=release)

    monkeypatch.setattr("modal.system.linear_system.factorise", noted)
    for search in (lanczos.modes_nearest, lanczos.modes_from_top, spectrum.bound_of_spectrum):

        def searched(*arguments, search=search):
            names.append(search.__name__)
            return search(*arguments)

        ends = search is spectrum.bound_of_spectrum
        where = "modal.system.linear_system" if ends else "modal.modes.search"
        monkeypatch.setattr(f"{where}.{search.__name__}", searched)
    return names


def answers(network):
    return [ask(network) for ask in QUESTIONS.values()]


def test_nothing_is_factorised_or_sought_twice_and_the_second_answer_is_the_first(made):
    network = gallery.fcc(cells=(4, 4, 8))
    first = answers(network)
    calls_of_first = list(made)
    assert calls_of_first.count("made") >= 3  # two counts and the factor of the modes, at least
    assert {"modes_nearest", "modes_from_top", "bound_of_spectrum"} < set(calls_of_first)
    second = answers(network)
    assert made == calls_of_first
    for first_answer, second_answer in zip(first, second, strict=True):
        np.testing.assert_array_equal(first_answer, second_answer)
    # Another question, or the same in another way, is not answered by what is kept.
    assert modal.eigenmodes(network, lowest=5, shapes=False).mode_shape is None
    uncertified = modal.eigenmodes(network, highest=3, certify=False)
    assert not uncertified.certified
    assert modal.eigenmodes(network, highest=3).certified
    assert len(modal.eigenmodes(network, lowest=4).frequency) == 4
    # Other springs are another network, of which nothing is known.
    stiffer = replace(network, stiffness_normal=2 * network.stiffness_normal)
    assert (answers(stiffer)[1] > first[1]).any()
    assert made.count("made") > calls_of_first.count("made")


def test_factors_go_with_their_network_and_large_ones_at_once(made, monkeypatch):
    network = gallery.fcc(cells=(4, 4, 8))
    first = answers(network)
    assert made.count("given back") < made.count("made")
    del network
    gc.collect()
    assert made.count("given back") == made.count("made")
    monkeypatch.setattr("modal.system.linear_system.MAX_CACHED_BYTES", 0.0)
    network = gallery.fcc(cells=(4, 4, 8))
    for first_answer, second_answer in zip(first, answers(network), strict=True):
        np.testing.assert_array_equal(first_answer, second_answer)
    assert made.count("given back") == made.count("made")
    searched = made.count("modes_from_top")
    answers(network)
    assert made.count("modes_from_top") > searched
