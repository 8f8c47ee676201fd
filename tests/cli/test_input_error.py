"""Refusals: their sentence, their JSON, and how they reach another process."""

import json
import pickle

import pytest

from analysis.case import AbsentError
from analysis.cli.main import main as analysis_main
from modal.cli.main import main as modal_main
from modal.solvers.factor import SingularError
from modal.tools.errors import InputError, UnavailableError


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        (("stress -5 Pa",), "stress -5 Pa"),
        (("stress -5 Pa", "below 0"), "stress -5 Pa: below 0"),
        (("stress -5 Pa", "", "give another"), "stress -5 Pa; give another"),
        (("stress -5 Pa", "below 0", "give another"), "stress -5 Pa: below 0; give another"),
    ],
    ids=["problem", "reason", "remedy", "all"],
)
def test_sentence_has_the_parts_that_there_are(parts, sentence):
    assert str(InputError("stress", *parts)) == sentence


@pytest.mark.parametrize(
    "error",
    [
        InputError("stress", "stress -5 Pa", "below 0", "give another"),
        UnavailableError("no_walls", "no walls"),
        AbsentError("a.modes.h5", remedy="make it"),
        SingularError(definite=True),
    ],
    ids=lambda error: type(error).__name__,
)
def test_errors_reach_another_process_whole(error):
    sent = pickle.loads(pickle.dumps(error))
    assert type(sent) is type(error)
    assert str(sent) == str(error)
    assert vars(sent) == vars(error)


@pytest.mark.parametrize(
    ("main", "command"),
    [(modal_main, "modes"), (analysis_main, "measure")],
    ids=["modal", "analysis"],
)
def test_json_of_a_refusal_has_its_code(main, command, tmp_path, capsys):
    missing = str(tmp_path / "nowhere.network.h5")
    assert main([command, missing, "--json"]) == 2
    printed = capsys.readouterr()
    error = json.loads(printed.out)["error"]
    assert error["code"] == "no_file"
    assert all(error[name] in printed.err for name in ("problem", "reason", "remedy"))


def test_without_json_nothing_is_printed_but_the_line(tmp_path, capsys):
    assert modal_main(["modes", str(tmp_path / "nowhere.network.h5")]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
