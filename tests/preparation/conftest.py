"""Fixtures for loading paths, and for commands that must be refused."""

import json
from functools import cache

import pytest
from small_path import SHAPE, STRESS_OPTIONS, WRITTEN_STATUSES

from modal.__main__ import main


@pytest.fixture
def refusal_code(capsys):
    """Return a function that runs a command, which must be refused in one line, for its code."""

    def run_refused(main, words):
        capsys.readouterr()
        assert main([*map(str, words), "--json"]) == 2
        shown = capsys.readouterr()
        assert shown.err.count("\n") == 1, shown.err
        return json.loads(shown.out)["error"]["code"]

    return run_refused


@pytest.fixture(scope="package")
def make_path(tmp_path_factory):
    """Return a function from a friction to the folder and the command of a path, made once."""

    @cache
    def run_path(friction):
        folder = tmp_path_factory.mktemp("path")
        command = [*SHAPE, "--friction", friction, *STRESS_OPTIONS[friction]]
        assert main([*command, "--json", "-o", str(folder)]) in WRITTEN_STATUSES
        return folder, command

    return run_path


@pytest.fixture
def finished_path(make_path):
    """Return the folder of a path to 10 and 100 kPa."""
    folder, _ = make_path("0.4")
    return folder
