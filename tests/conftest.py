"""What tests share: fixtures, which optional packages they see, and skips that nobody asked for.

GRANULAR_WITHOUT=numba,pypardiso hides these packages from every import of the run and of the
programs that it starts, so that code with an alternative to them takes it. With CI=true a test that
is skipped without being asked to fails.
"""

import importlib.util
import json
import os
import runpy
import shutil
from pathlib import Path

import pytest

from analysis.shadowing import describe_other_modal

FAST = ("numba", "pypardiso")
"""Optional packages of the recommended path."""
HIDDEN = [name for name in os.environ.get("GRANULAR_WITHOUT", "").split(",") if name]
MAY_BE_ABSENT = ["LAMMPS", "Chromium", "Slurm", *HIDDEN]
"""Names in the reason of a skip that is allowed also where the tests must be complete."""
LONG = ("same_bits", "faults_study", "tiny_study", "docs", "yade")
"""Parts of the names of the slowest files; the first compiles loops that others then load."""
COMPLETE = os.environ.get("CI") == "true"
"""Whether a test that is skipped without being asked to fails."""

if HIDDEN:
    # No test module has imported modal yet; programs that the tests start do the same themselves.
    folder = Path(__file__).with_name("hidden")
    runpy.run_path(str(folder / "sitecustomize.py"))
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)


def pytest_configure(config):
    """Refuse to test another `modal`, or the recommended path without its packages.

    The latter only where that path must be tested.
    """
    other_modal = describe_other_modal()
    if other_modal:
        raise pytest.UsageError(other_modal)
    absent = [name for name in FAST if name not in HIDDEN and not importlib.util.find_spec(name)]
    if COMPLETE and absent:
        raise pytest.UsageError(
            f"{' and '.join(absent)} cannot be imported, so the recommended path would go "
            f"untested; install .[test,fast], or say GRANULAR_WITHOUT={','.join(absent)}"
        )


def pytest_collection_modifyitems(items):
    """Put the slowest files first, so that no worker is left with one of them at the end."""
    items.sort(key=lambda item: not any(name in item.path.name for name in LONG))


def refuse_unasked_skip(report):
    """Turn a skip for a reason that nobody has allowed into a failure."""
    if COMPLETE and report.skipped and not hasattr(report, "wasxfail"):
        path, line, reason = report.longrepr
        if not any(name in reason for name in MAY_BE_ABSENT):
            report.outcome = "failed"
            report.longrepr = f"{path}:{line}: {reason}; with CI=true nothing is skipped unasked"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """Refuse the skip of a test, or of its fixtures."""
    return refuse_unasked_skip((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report():
    """Refuse the skip of a whole module."""
    return refuse_unasked_skip((yield))


@pytest.fixture
def printed(capsys):
    """Return a function that runs a command and returns the JSON object which it prints.

    The command is one of modal unless `main` is given. NaN is not JSON, and fails the test.
    """

    def run(*command: object, main=None, status=0) -> dict:
        # Not before packages are hidden.
        main = main or importlib.import_module("modal.__main__").main
        capsys.readouterr()
        assert main([*map(str, command), "--json"]) == status
        return json.loads(capsys.readouterr().out, parse_constant=pytest.fail)

    return run


@pytest.fixture(scope="session")
def yade():
    """Skip the test where YADE is not installed."""
    if shutil.which("yade-batch") is None:
        packages = "yade python3-h5py python3-scipy"
        pytest.skip(f"YADE is missing: apt-get install --no-install-recommends {packages}")


@pytest.fixture
def one_line(capsys, monkeypatch):
    """Return a function that runs a command which must be refused, and returns the error.

    The exit status is 2, and standard error has one line. The error has the `code`, if one is
    given; `said` must be in the line, and is for names of files and numbers.
    """
    errors = []
    for package in ("modal", "analysis"):
        main_module = importlib.import_module(f"{package}.cli.main")
        monkeypatch.setattr(main_module, "refused", _recording(main_module.refused, errors))

    def refused(main, words, said="", *, code=None):
        capsys.readouterr()
        errors.clear()
        assert main([str(word) for word in words]) == 2
        printed = capsys.readouterr().err
        assert said in printed and printed.count("\n") == 1, printed
        assert code is None or errors[-1].code == code, (errors[-1].code, printed)
        return errors[-1] if errors else None

    return refused


def _recording(report, errors):
    """Return the function `report`, which then also appends the error to a list."""

    def report_and_record(error, words):
        errors.append(error)
        return report(error, words)

    return report_and_record
