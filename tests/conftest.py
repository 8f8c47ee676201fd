"""Shared by the tests: which optional packages they see, and unasked skips.

GRANULAR_WITHOUT=numba,pypardiso hides these packages from every import of the run and of the
programs that it starts, so that code with a second way takes it. With CI=true a test that was
skipped without being asked to has failed.
"""

import importlib.util
import json
import os
import runpy
import shutil
from pathlib import Path

import pytest

FAST = ("numba", "pypardiso")
"""Optional packages of the recommended path."""
HIDDEN = [name for name in os.environ.get("GRANULAR_WITHOUT", "").split(",") if name]
MAY_BE_ABSENT = ["LAMMPS", "Chromium", "Slurm", *HIDDEN]
"""What a test that is skipped where the tests must be complete may name as its reason."""
LONG = ("same_bits", "faults_study", "workflow", "docs", "yade")
"""What the names of files hold that take longest; the first compiles what others then find."""
COMPLETE = os.environ.get("CI") == "true"

if HIDDEN:
    # No test module has imported modal yet; programs that the tests start do the same themselves.
    folder = Path(__file__).with_name("hidden")
    runpy.run_path(str(folder / "sitecustomize.py"))
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)


def pytest_configure(config):
    """Refuse to test the recommended path without its packages where it must be tested."""
    absent = [name for name in FAST if name not in HIDDEN and not importlib.util.find_spec(name)]
    if COMPLETE and absent:
        raise pytest.UsageError(
            f"{' and '.join(absent)} cannot be imported, so the recommended path would go "
            f"untested; install .[test,fast], or say GRANULAR_WITHOUT={','.join(absent)}"
        )


def pytest_collection_modifyitems(items):
    """The longest files come first, so that no worker is left with one alone at the end."""
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
    """Of a test and its fixtures."""
    return refuse_unasked_skip((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report():
    """Of a whole module."""
    return refuse_unasked_skip((yield))


@pytest.fixture
def printed(capsys):
    """The JSON object that a command, of modal unless told, prints; NaN is not JSON."""

    def run(*command: object, main=None, status=0) -> dict:
        # Not before packages are hidden.
        main = main or importlib.import_module("modal.__main__").main
        capsys.readouterr()
        assert main([*map(str, command), "--json"]) == status
        return json.loads(capsys.readouterr().out, parse_constant=pytest.fail)

    return run


@pytest.fixture(scope="session")
def yade():
    """What a test asks for that runs YADE."""
    if shutil.which("yade-batch") is None:
        packages = "yade python3-h5py python3-scipy"
        pytest.skip(f"YADE is missing: apt-get install --no-install-recommends {packages}")


@pytest.fixture
def one_line(capsys):
    """What a test asks for whose command must be refused: status 2, and one line that says why."""

    def refused(main, words, said=""):
        capsys.readouterr()
        assert main([str(word) for word in words]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1, error

    return refused
