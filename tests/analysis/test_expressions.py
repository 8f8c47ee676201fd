"""Expressions in a study's data: what they give, and that nothing runs that is no sum."""

import math
import time

import numpy as np
import pandas as pd
import pytest
from refusals import refusal

from analysis.expressions import MAX_DEPTH, UnknownNameError, evaluate
from analysis.frame import numbers, select
from analysis.study.captions import Captions
from analysis.study.fields import file_inside, fill, number_format
from modal.tools.errors import InputError

NAMES = {"friction": 0.4, "width": 4, "kind": "random", "dense": True}
FRAME = pd.DataFrame(
    {
        "case": [1, 2, 3],
        "kind": ["fcc", "random", "random"],
        "stress": [1e4, 1e5, 1e6],
        "v": [2.0, np.nan, 5.0],
        "flat": np.array([True, np.nan, False], object),
        "name": ["a_width8", "a_seed1", "b_width8"],
        "there": True,
    },
    index=["a", "b", "c"],
)


@pytest.mark.parametrize(
    "text",
    [
        "friction + 0.1",
        "-friction * (width - 1) / 3",
        "width ** 0.5 + abs(-2)",
        "2 < width <= 4 and not friction > 1",
        "kind == 'random' or width != 4",
        "width in [2, 4] and kind not in ['fcc', 'hcp']",
        "'ran' in kind",
        "dense == True",
    ],
)
def test_sums_and_comparisons_are_those_of_python(text):
    """Compare with what Python itself computes from the same text."""
    assert evaluate(text, NAMES) == pytest.approx(eval(text, dict(NAMES)), rel=1e-15)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("stress == 1e5", ["b"]),
        ("kind == 'random' and stress > 1e5", ["c"]),
        ("1e4 < stress < 1e6", ["b"]),
        ("case in [1, 3]", ["a", "c"]),
        ("case not in (1, 3)", ["b"]),
        ("v == v", ["a", "c"]),
        ("flat == False", ["c"]),
        ("flat and there", ["a"]),
        ("not flat", ["b", "c"]),
        ("'_width' in name", ["a", "c"]),
        ("name.str.contains('_width')", ["a", "c"]),
        ("'.' in name", []),  # a text, no pattern
        ("log10(stress) > 4.5", ["b", "c"]),
        ("", ["a", "b", "c"]),
    ],
)
def test_a_selection_is_of_the_cases_it_is_true_of(text, wanted):
    assert select(FRAME, text).index.tolist() == wanted


def test_a_quantity_is_a_column_or_a_sum_of_columns():
    assert numbers(FRAME, "stress / 1000").tolist() == [10, 100, 1000]
    assert numbers(FRAME, "100 * (v - 1)")["c"] == 400
    assert np.isnan(numbers(FRAME, "unknown + 1")).all()
    assert np.isnan(numbers(FRAME, "v")["b"])
    assert numbers(FRAME, "2").tolist() == [2, 2, 2]


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("friction + pd.io.common.os.system('true')", "expression"),
        ("@pd.io.common.os.system('true') == 0", "expression"),
        ("__import__('os').system('true')", "expression"),
        ("().__class__.__base__.__subclasses__()", "expression"),
        ("friction.__class__", "expression"),
        ("kind.upper()", "expression"),
        ("kind.str.contains('a', regex=True)", "expression"),
        ("(lambda: 1)()", "expression"),
        ("[x for x in (1, 2)]", "expression"),
        ("(x := 1)", "expression"),
        ("1 if dense else 2", "expression"),
        ("f'{friction}'", "expression"),
        ("kind[0]", "expression"),
        ("{'a': 1}", "expression"),
        ("b'a'", "expression"),
        ("3j", "expression"),
        ("abs", "unknown_name"),
        ("abs(1, 2)", "expression"),
        ("abs(*[1])", "expression"),
        ("kind * 9", "expression"),
        ("kind + kind", "expression"),
        ("width % 3", "expression"),
        ("width and dense", "expression"),
        ("width is 4", "expression"),
        ("friction +", "expression"),
        ("a\0b", "expression"),
        ("", "expression"),
        (5, "expression"),
        (None, "expression"),
        ("(0 - 8) ** 0.5", "expression"),
        ("1 / 0", "expression_value"),
        ("9**9**9**9", "expression_value"),
        ("kind < 3", "expression_value"),
        ("(" * 150 + "1" + ")" * 150 + "+" * 1500, "expression"),
        ("-" * 1000 + "1", "expression_size"),
        ("+".join("1" * (MAX_DEPTH + 1)), "expression_size"),
        ("1" * 5000, "expression_size"),
        ("[" * 1900, "expression"),
    ],
)
def test_what_is_no_sum_is_refused_at_once(text, code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    start = time.perf_counter()
    with pytest.raises(InputError) as refused:
        evaluate(text, NAMES)
    assert refused.value.code == code
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 400
    assert time.perf_counter() - start < 1


def test_powers_are_bounded_by_the_largest_float():
    assert evaluate("9 ** 300", {}) == pytest.approx(9.0**300)
    assert math.isinf(evaluate("1e308 * 10", {}))
    assert numbers(FRAME, "stress ** 99").tolist()[-1] == math.inf


def test_a_name_that_is_not_known_is_said_apart():
    with pytest.raises(UnknownNameError) as refused:
        evaluate("mu + 1", NAMES)
    assert refused.value.code == "unknown_name"


@pytest.mark.parametrize("text", ["stress", "1 == 1", "'a' == kind == 'b' == 3 + v", "5", 7])
def test_a_selection_is_true_or_false_of_each_case(text):
    if text == "'a' == kind == 'b' == 3 + v":
        assert select(FRAME, text).empty
        return
    with pytest.raises(InputError):
        select(FRAME, text)


def test_a_sentence_calls_its_few_functions_alone():
    words = Captions(FRAME.assign(void_ratio=[0.5, 0.6, 0.7], void_ratio_spread=np.nan))
    assert words("e {{ value('b', 'void_ratio') }}, {{ span('void_ratio', form='.1f') }}") == (
        "e 0.6, 0.6 to 0.7"
    )
    assert words("{{ count('void_ratio > 0.65') }}") == "1 of 2"
    for text in (
        "{{ cycler.__init__.__globals__.os.popen('true').read() }}",
        "{{ value.__globals__ }}",
        "{{ self }}",
        "{{ words.frame }}",
        "{{ value('b', 'void_ratio') | upper }}",
        "{{ value('b', **{'quantity': 1}) }}",
        "{{ value() }}",
        "{{ span('void_ratio', form='999999999.1f') }}",
        "{{ count('@pd') }}",
        "{% for a in range(9) %}a{% endfor %}",
        "{{ value('b', 'void_ratio')",
        "{# a #}",
    ):
        with pytest.raises(InputError) as refused:
            words(text)
        assert "\n" not in str(refused.value)


@pytest.fixture(scope="module")
def captions_of_trends():
    """Return captions over two stresses, with points at x < 0.5 and a crystal at x = 0.6.

    A straight and an exponential quantity lie on their curves; the crystal's straight one is 230.
    """
    x = [0.1, 0.2, 0.3, 0.6] * 2
    frame = pd.DataFrame({"there": True, "x": x, "stress": [1e5] * 4 + [1e6] * 4})
    frame["fitted"] = frame["x"] < 0.5
    frame["straight"] = 100 + 200 * frame["x"]
    frame["exponential"] = 100 * 2 ** (10 * frame["x"])
    frame.loc[frame["x"] > 0.5, "straight"] = 230.0
    return Captions(frame)


def test_a_straight_trend_is_extrapolated_exactly(captions_of_trends):
    text = captions_of_trends("{{ trends('straight', 'x', 'x < 0.5', 'x > 0.5') }}")
    assert "100 kPa: 220 ± 0 (" in text
    assert "1000 kPa: 220 ± 0 (" in text
    assert text.endswith("crystal 230")


def test_an_exponential_trend_is_extrapolated_by_its_logarithm(captions_of_trends):
    """Find 100 * 2^6 at 0.6."""
    text = captions_of_trends("{{ trends('exponential', 'x', 'x < 0.5', 'x > 0.5') }}")
    assert "(line of its logarithm: 6400), crystal 6400" in text


def test_a_trend_to_no_case_is_not_measured(captions_of_trends):
    text = captions_of_trends("{{ trends('straight', 'x', 'x < 0.5', 'x > 9') }}")
    assert text == "(not measured)"


def test_fields_are_filled_with_numbers():
    assert fill("{f:.2f} and {n}", {"f": 1.234, "n": 3}) == "1.23 and 3"


@pytest.mark.parametrize(
    "text", ["{row.__class__}", "{row[0]}", "{f!r}", "{f:999999999}", "{f:{f}}", "{g}", "{", "{o}"]
)
def test_a_field_is_a_number_by_its_name(text):
    with pytest.raises(InputError) as refused:
        fill(text, {"row": object(), "f": 1.0, "o": object()})
    assert refused.value.code in ("field", "number_format")


@pytest.mark.parametrize("form", ["99999d", "{0}", "s", ".999f", " .3f ", None, ">9"])
def test_a_format_is_of_numbers(form):
    with refusal("number_format"):
        number_format(form)


@pytest.mark.parametrize("name", ["../x", "a/b", "/etc/x", "..", "", "."])
def test_no_name_leads_out_of_its_folder(name, tmp_path):
    with refusal("outside_folder"):
        file_inside(tmp_path, name)


def test_a_name_leads_into_its_folder(tmp_path):
    assert file_inside(tmp_path, "x.csv") == tmp_path / "x.csv"
