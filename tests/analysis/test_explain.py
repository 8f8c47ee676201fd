"""How a value comes about: parts of its error, windows, fits and limits, by names and codes."""

import numpy as np
import pytest
from packings import slender

import analysis
from analysis.__main__ import main
from analysis.estimators.coherent import Coherent
from analysis.explanation import ERROR_PARTS, NUMBERS, OUTCOMES, WAVE_ENDS
from analysis.quantities.passband import FADED_AMPLITUDE, find_fading
from analysis.value import Value
from modal.packing.network import write_network
from modal.waves.motions import Pulse

LENGTH = 1.0
"""Fading length of the trial waves, m."""
LEVEL = np.log(1 / FADED_AMPLITUDE) / LENGTH


@pytest.fixture(scope="module")
def packing():
    """A random packing that is shorter than 15 diameters."""
    return slender()


def coherent_wave(attenuation, ended_by="range"):
    """A coherent wave at 1, 2, 3 ... Hz with this attenuation in units of the level."""
    attenuation = LEVEL * np.array(attenuation)
    frequency = np.arange(1.0, len(attenuation) + 1)
    return Coherent(frequency, frequency, attenuation, 1.0, ended_by)


@pytest.mark.parametrize(
    ("attenuation", "outcome", "end"),
    [
        pytest.param([0.5, 0.9, 1.1], "crossed", 3.0, id="crossed"),
        pytest.param([1.5, 1.9, 2.1], "starts_above", 3.0, id="starts above"),
        pytest.param([0.5, 0.9, np.nan], "ends_below", 2.0, id="ends below"),
        pytest.param([np.nan, np.nan, np.nan], "no_wave", np.nan, id="no wave"),
    ],
)
def test_a_window_says_how_the_attenuation_meets_the_level(attenuation, outcome, end):
    window = find_fading(coherent_wave(attenuation, "incoherent"), LENGTH, decay=4.0)
    assert (window.outcome, window.ended_by) == (outcome, "incoherent")
    assert window.end_frequency == pytest.approx(end, nan_ok=True)


def test_crossings_are_interpolated():
    window = find_fading(coherent_wave([0.5, 0.9, 1.1]), LENGTH, decay=4.0)
    crossings = window.first_crossing, window.fitted_crossing, window.last_crossing
    assert crossings == pytest.approx([2.5, 2.5, 2.5])


def test_why_the_low_pass_frequency_is_not_known(packing):
    """A pulse of 5 kHz sends little above: each window says where its wave ends, and by which rule.

    The source's share at the end is a number, so that a weak source is told from a lost wave.
    """
    source = Pulse(frequency=5e3)
    value = analysis.measure(packing, quantities="low_pass_unbiased", source=source)
    explanation = value["low_pass_unbiased"].explain().as_json()
    assert explanation["value"] is None
    windows = [step for step in explanation["steps"] if step["kind"] == "window"]
    assert [step["numbers"]["damping"] for step in windows] == [4.0, 3.0, 5.0]
    for step in windows:
        assert step["outcome"] in {"no_wave", "starts_above", "ends_below"}
        assert step["ended_by"] in {"incoherent", "backward"}
        assert 5e3 < step["numbers"]["end_frequency"] < 20e3
        assert 0 < step["numbers"]["sent_at_end"] < 0.5
    assert explanation["caveats"][0]["code"] == "never_fades"
    assert explanation["caveats"][0]["values"]["failed"] == 3


def test_how_the_error_of_v_p_comes_about(packing):
    """Three parts: of the fit, of the window, and of the short packing; their root is the error."""
    value = analysis.measure(packing, quantities="v_p")["v_p"]
    explanation = value.explain().as_json()
    parts = {part["name"]: part["value"] for part in explanation["parts"]}
    assert list(parts) == ["fit", "window", "length"]
    assert np.linalg.norm([*parts.values()]) == pytest.approx(value.error)
    main_window, weaker, stronger, length = explanation["steps"]
    assert main_window["numbers"]["velocity"] == value.value
    assert main_window["numbers"]["error"] == parts["fit"]
    # The part is the change from no damping to the usual one, proportional to the damping.
    change = abs(stronger["numbers"]["velocity"] - weaker["numbers"]["velocity"])
    assert parts["window"] == pytest.approx(4.0 / (5.0 - 3.0) * change)
    assert (length["kind"], length["outcome"]) == ("limit", "fallen_short")
    assert length["numbers"]["length"] < length["numbers"]["limit"] == 15.0


def test_every_name_of_an_explanation_has_a_meaning(packing):
    """The text is made of the tables: no part, outcome or number is without its words."""
    for value in analysis.measure(packing).values():
        assert value.parts.keys() <= ERROR_PARTS.keys()
        for step in value.steps:
            assert step.outcome in OUTCOMES
            assert step.ended_by in {"", *WAVE_ENDS}
            assert step.numbers.keys() <= NUMBERS.keys()
        assert str(value.explain()).startswith(value.text())


def test_a_part_of_an_error_without_a_meaning_is_a_mistake():
    with pytest.raises(RuntimeError):
        Value(1.0, "m/s", {"mystery": 0.1})


def test_the_command_line_explains(packing, tmp_path, printed, capsys):
    """As text, and with `--json` as names and numbers; a value that is not known ends with 3."""
    path = str(tmp_path / "short.network.h5")
    write_network(path, packing)
    shown = printed("measure", path, "--explain", "v_p", main=main)
    assert list(shown[path]) == ["v_p"]
    assert {"parts", "steps", "caveats"} <= shown[path]["v_p"].keys()
    assert main(["measure", path, "--explain", "v_p"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in ("v_p", "fit", "window", "length", "eta T 4"))
    assert main(["measure", path, "--explain", "low_pass"]) == 3
