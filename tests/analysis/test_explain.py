"""How a value comes about: parts of its error, windows, fits and limits, by names and codes."""

from dataclasses import replace

import numpy as np
import pytest
from packings import slender

import analysis
import modal
from analysis.__main__ import main
from analysis.caveats import Caveat
from analysis.estimators.coherent import Coherent
from analysis.explanation import DIRECT, ERROR_PARTS, NOT_BEGUN
from analysis.quantities.passband import FADED_AMPLITUDE, find_fading
from analysis.steps import NUMBERS, OUTCOMES, WAVE_ENDS, Step, limit_step
from analysis.value import Value, unknown
from modal.packing.network import write_network
from modal.waves.motions import Pulse

LENGTH = 1.0
"""Fading length of the trial waves, m."""
LEVEL = np.log(1 / FADED_AMPLITUDE) / LENGTH
WAVE_QUANTITIES = ["v_p", "low_pass", "attenuation", "quality", "ioffe_regel"]
"""Quantities that need a coherent wave."""
COMPARED = {
    "length": ("limit", True),
    "particles_with_value": ("needed", True),
    "change": ("limit", False),
    "frequency": ("source_end", False),
    "nepers": ("limit", False),
    "highest": ("source_end", False),
    "attenuation_in_errors": ("limit", True),
    "modes_below": ("needed", True),
    "peak": ("lowest", True),
    "asymmetry": ("limit", False),
    "radius_difference": ("limit", False),
    "spread": ("limit", False),
}
"""Number of a limit, the number that it is compared with, and whether it must be at least that."""


@pytest.fixture(scope="module")
def packing():
    """Return a random packing that is shorter than 15 diameters."""
    return slender()


@pytest.fixture(scope="module")
def values(packing):
    """Measure all quantities of the packing that are measured without a request."""
    return analysis.measure(packing)


@pytest.fixture(scope="module")
def without_wave(packing):
    """Measure a record of noise, in which no coherent wave goes through the packing."""
    signals = modal.propagate(packing, 1e-4).signals
    random = np.random.default_rng(1)
    noise = replace(
        signals,
        chain_displacement=random.standard_normal(signals.chain_displacement.shape),
        layer_displacement=random.standard_normal(signals.layer_displacement.shape),
    )
    return analysis.measure(packing, noise, quantities=WAVE_QUANTITIES)


def coherent_wave(attenuation, ended_by="range"):
    """Return a coherent wave at 1, 2, 3 ... Hz with this attenuation in units of the level."""
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
    """Explain for each window of a pulse of 5 kHz where its wave ends, and by which rule.

    The source's share at the end is a number, which distinguishes a weak source from a lost wave.
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
    """Add the squares of three parts: of the fit, of the window, and of the short packing."""
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
    assert parts["length"] == length["numbers"]["short_excess"] * value.value


def test_how_the_error_of_the_low_pass_frequency_comes_about(values):
    """Find half the distance of crossings, their change with the window, and a line's spread."""
    value = values["low_pass_unbiased"]
    main_window, weaker, stronger, line, _ = [step.numbers for step in value.steps]
    assert value.value == main_window["fitted_crossing"]
    crossings = main_window["last_crossing"] - main_window["first_crossing"]
    change = weaker["fitted_crossing"] - stronger["fitted_crossing"]
    # The standard deviation of a uniform distribution over the width of a line.
    spread = line["resolution"] / np.sqrt(12)
    expected = np.linalg.norm([crossings / 2, change, spread])
    assert value.error == pytest.approx(expected)


def test_every_name_of_an_explanation_has_a_meaning(values):
    """Find words in the tables for every part, outcome and number."""
    for value in values.values():
        assert value.parts.keys() <= ERROR_PARTS.keys()
        for step in value.steps:
            assert step.outcome in OUTCOMES
            assert step.ended_by in {"", *WAVE_ENDS}
            assert step.numbers.keys() <= NUMBERS.keys()
        assert str(value.explain()).startswith(value.text())


def limits_of(value):
    """Return the numbers and the outcome of each limit among the steps of a value."""
    return [(step.numbers, step.outcome) for step in value.steps if step.kind == "limit"]


@pytest.mark.parametrize(
    "name", [*WAVE_QUANTITIES, "highest_frequency", "excess_peak", "bulk_modulus", "shear_modulus"]
)
def test_quantity_that_may_be_unknown_has_steps(values, name):
    assert values[name].steps


def test_outcome_of_a_limit_follows_from_its_numbers(values):
    """Compare the two numbers of each limit again."""
    compared = 0
    for value in values.values():
        for numbers, outcome in limits_of(value):
            for name in numbers.keys() & COMPARED.keys():
                limit, at_least = COMPARED[name]
                if limit not in numbers or not np.isfinite(numbers[name]):
                    continue
                difference = numbers[name] - numbers[limit]
                kept = difference >= 0 if at_least else difference <= 0
                failure = "fallen_short" if at_least else "exceeded"
                assert outcome == ("kept" if kept else failure), name
                compared += 1
    assert compared >= 8


@pytest.mark.parametrize(
    ("number", "least", "outcome"),
    [
        pytest.param(1.0, False, "kept", id="at the limit"),
        pytest.param(1.5, False, "exceeded", id="above"),
        pytest.param(0.5, True, "fallen_short", id="below"),
        pytest.param(1.0, True, "kept", id="at the least"),
        pytest.param(np.nan, True, "not_known", id="not known"),
    ],
)
def test_limit_compares_two_numbers(number, least, outcome):
    step = limit_step({"length": number, "limit": 1.0}, "length", "limit", least=least)
    assert step.outcome == outcome


def test_frequencies_of_the_attenuation_are_those_of_the_last_window(values):
    """Read from the last window how many frequencies remain, and between which."""
    attenuation = values["attenuation"]
    numbers = attenuation.steps[-1].numbers
    assert numbers["frequencies"] == len(attenuation.value)
    assert [numbers["lowest"], numbers["highest"]] == attenuation.at[[0, -1]].tolist()


def test_quality_has_the_steps_of_its_attenuation(values):
    """Find the last limit, that of the attenuation in its errors."""
    attenuation = values["attenuation"]
    *steps, limit = values["quality"].steps
    assert tuple(steps) == attenuation.steps
    ratio = attenuation.value / attenuation.error
    assert limit.numbers["attenuation_in_errors"] == pytest.approx(ratio.max())
    assert limit.numbers["frequencies"] == np.isfinite(values["quality"].value).sum()


def test_error_of_the_highest_frequency_is_half_of_its_residual(values):
    highest = values["highest_frequency"]
    (step,) = highest.steps
    assert step.outcome == "converged"
    assert highest.error == pytest.approx(step.numbers["residual"] * highest.value / 2)


def test_low_pass_of_a_short_packing_falls_short_of_its_length(packing, values):
    lengths = [numbers for numbers, _ in limits_of(values["low_pass"]) if "length" in numbers]
    diameter = 2 * packing.radius.mean()
    assert lengths == [{"length": pytest.approx(packing.length / diameter), "limit": 50.0}]
    assert "too_short" in values["low_pass"].codes


def test_unknown_velocity_says_which_windows_had_too_few_frequencies(without_wave):
    v_p = without_wave["v_p"]
    assert not v_p.known
    for window in v_p.steps[:3]:
        assert window.outcome == "too_few"
        assert window.ended_by in {"incoherent", "backward"}
        assert window.numbers["frequencies"] < window.numbers["needed"]


@pytest.mark.parametrize("name", ["low_pass", "ioffe_regel"])
def test_quantity_without_a_velocity_has_the_steps_of_the_velocity(without_wave, name):
    """Find the windows in which the wave was lost in the refusal."""
    value = without_wave[name]
    assert not value.known
    assert value.codes == ["no_coherent_wave"]
    assert value.steps[:3] == without_wave["v_p"].steps[:3]


@pytest.mark.parametrize("name", ["attenuation", "quality"])
def test_unknown_attenuation_says_that_no_frequency_is_left(without_wave, name):
    value = without_wave[name]
    assert value.codes == ["no_coherent_wave"]
    assert value.steps[-1].outcome == "none_left"
    assert value.steps[-1].numbers["frequencies"] == 0


def test_value_without_steps_says_that_it_is_direct(values):
    coordination = values["coordination"].explain()
    assert coordination.as_json()["steps"] == []
    assert DIRECT in str(coordination)


def test_unknown_value_without_steps_refers_to_its_caveats():
    explanation = unknown("m/s", Caveat("absent")).explain()
    assert NOT_BEGUN in str(explanation)
    assert [caveat["code"] for caveat in explanation.as_json()["caveats"]] == ["absent"]


def test_a_part_of_an_error_without_a_meaning_is_a_mistake():
    with pytest.raises(RuntimeError):
        Value(1.0, "m/s", {"mystery": 0.1})


@pytest.mark.parametrize(
    ("outcome", "numbers"), [("mystery", {}), ("kept", {"mystery": 1.0})], ids=["outcome", "number"]
)
def test_a_step_without_a_meaning_is_a_mistake(outcome, numbers):
    with pytest.raises(RuntimeError):
        Step("limit", outcome, numbers)


def test_the_command_line_explains(packing, tmp_path, printed, capsys):
    """Print text, and with `--json` names and numbers; end with 3 if the value is not known."""
    path = str(tmp_path / "short.network.h5")
    write_network(path, packing)
    shown = printed("measure", path, "--explain", "v_p", main=main)
    assert list(shown[path]) == ["v_p"]
    assert {"parts", "steps", "caveats"} <= shown[path]["v_p"].keys()
    assert main(["measure", path, "--explain", "v_p"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in ("v_p", "fit", "window", "length", "eta T 4"))
    assert main(["measure", path, "--explain", "low_pass"]) == 3
