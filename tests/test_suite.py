"""The suite itself: what is skipped unasked fails, and hidden packages are hidden."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

CONFTEST = Path(__file__).with_name("conftest.py")
PYTEST = """#!/bin/sh
printf '%s|%s\\n' "$GRANULAR_WITHOUT" "$*" >> passes
[ -n "$GRANULAR_WITHOUT" ] && exit SECOND
exit FIRST
"""
TESTS = """
import pytest
from modal.solvers.factor import available
from modal.tools import loops

def test_what_is_hidden():
    assert loops.numba is None
    assert not available("pardiso")

def test_skipped():
    pytest.skip("no reason at all")

def test_optional():
    pytest.skip("pypardiso is not installed")

@pytest.mark.xfail
def test_known():
    assert False
"""


def test_skips_and_hidden_packages(tmp_path):
    """Run tests in a process of their own, where they must be complete."""
    shutil.copy(CONFTEST, tmp_path)
    shutil.copytree(CONFTEST.parent / "hidden", tmp_path / "hidden")
    (tmp_path / "test_inner.py").write_text(TESTS)
    (tmp_path / "test_whole.py").write_text("import pytest\npytest.importorskip('no_such_package')")
    options = ["-q", "-p", "no:cacheprovider", "--continue-on-collection-errors"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, str(tmp_path)],
        cwd=tmp_path,
        env=os.environ | {"CI": "true", "GRANULAR_WITHOUT": "numba,pypardiso"},
        capture_output=True,
        text=True,
    )
    # Failed: the skip without a reason. In error: the module that skips itself.
    assert done.stdout.splitlines()[-1].startswith(
        "1 failed, 1 passed, 1 skipped, 1 xfailed, 1 error"
    )


@pytest.mark.parametrize(
    ("first", "second", "status"), [(0, 0, 0), (1, 0, 1), (0, 1, 1), (1, 3, 3), (4, 1, 4)]
)
def test_both_passes_run_and_the_worse_status_counts(first, second, status, tmp_path):
    """Replace Python by a script that notes how it is called and ends with a status."""
    shutil.copy(ROOT / "run_tests.sh", tmp_path)
    python = tmp_path / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text(PYTEST.replace("FIRST", str(first)).replace("SECOND", str(second)))
    (tmp_path / "setup.sh").write_text("#!/bin/sh\n")
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests/test_both.py").write_text("pytestmark = pytest.mark.two_ways")
    (tmp_path / "tests/test_once.py").write_text("")
    for program in (python, tmp_path / "setup.sh"):
        program.chmod(0o755)
    environment = {key: text for key, text in os.environ.items() if key != "GRANULAR_WITHOUT"}
    assert subprocess.run([tmp_path / "run_tests.sh"], env=environment).returncode == status
    whole, again = (tmp_path / "passes").read_text().splitlines()
    assert whole.startswith("|-m pytest")
    assert "test_both" not in whole
    assert again.startswith("numba,pypardiso")
    assert again.endswith("tests/test_both.py")
    # With arguments pytest runs once.
    assert (
        subprocess.run([tmp_path / "run_tests.sh", "-k", "x"], env=environment).returncode == first
    )
    assert len((tmp_path / "passes").read_text().splitlines()) == 3
