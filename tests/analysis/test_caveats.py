"""Caveats: a code with numbers, whose text comes from one table."""

import pytest

from analysis.caveats import TEXTS, Caveat, refusal
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
