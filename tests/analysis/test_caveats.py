"""Caveats: a code with numbers, whose text comes from one table."""

from dataclasses import replace

import numpy as np
import pytest
from packings import frictionless

import analysis
from analysis.caveats import TEXTS, Caveat, refusal
from analysis.estimators.scattering import Scattering
from analysis.packing_data import PackingData
from analysis.quantities import scattering as scattering_quantities
from analysis.quantities.registry import QUANTITIES
from analysis.value import hertz
from modal.tools.errors import UnavailableError


def test_a_code_without_a_text_is_a_mistake():
    with pytest.raises(RuntimeError):
        Caveat("no_such_code")


def test_the_numbers_stand_in_the_text():
    caveat = Caveat("narrow", {"width": 7.0})
    assert "7.0" in str(caveat)
    assert caveat.as_json() == {"code": "narrow", "values": {"width": 7.0}, "text": str(caveat)}


def test_frequencies_in_caveats_have_three_digits():
    assert hertz(10490.0) == "10.5 kHz"


def test_a_refusal_keeps_its_code_and_its_sentence():
    caveat = refusal(UnavailableError("held_shut", "the packing is held shut"))
    assert caveat.code == "held_shut" not in TEXTS
    assert str(caveat) == "the packing is held shut"


@pytest.mark.parametrize(("every", "told"), [(40, True), (200, False)])
def test_a_share_of_sliding_contacts_is_told(every, told):
    """Let 2.5 % or 0.5 % of the contacts slide; the limit is 1 %."""
    network = frictionless()
    slides = np.arange(network.n_contacts) % every == 0
    value = analysis.measure(replace(network, sliding=slides), quantities="bulk_modulus")
    assert ("sliding" in value["bulk_modulus"].codes) == told


@pytest.mark.parametrize(
    ("shares", "code"), [((2.0, 3.0), "beyond_limit"), ((0.1, 0.2), "no_short_free_path")]
)
def test_a_limit_below_the_first_wave_is_not_one_above_the_last(monkeypatch, shares, code):
    """Give the line of both standing waves a width of a share of f / pi, the limit."""
    frequency = np.array([5e3, 10e3])
    ridge = Scattering(frequency, np.array(shares) * frequency / np.pi, 500.0, 2e-3)
    monkeypatch.setattr(scattering_quantities, "scattering", lambda packing: ridge)
    value = QUANTITIES["ioffe_regel"].measured(PackingData(frictionless()))
    assert not value.known
    assert value.codes[0] == code
