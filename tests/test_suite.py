"""The suite itself: what is skipped unasked fails, and hidden packages are hidden."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

CONFTEST = Path(__file__).with_name("conftest.py")
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
    """In a run of its own where the tests must be complete."""
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
