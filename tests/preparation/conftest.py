"""Fixtures for commands that must be refused."""

import json

import pytest


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
