"""Another package named `modal` is noticed by every front door, in one line."""

import os
import subprocess
import sys

import pytest
from places import ROOT

from analysis.shadowing import describe_other_modal

FOREIGN = '"""Run anything in the cloud."""\n__version__ = "1.2.0"\nraise RuntimeError\n'
"""A package that must not even be run to be known as another one."""
CALL = "import sys; from analysis.shadowing import run; sys.exit(run())"
FRONT_DOORS = {
    "granular-modes": (["-c", CALL, "--help"], 2),
    "analysis": (["-m", "analysis", "--help"], 2),
    "tests": (["-m", "pytest", str(ROOT / "tests/test_setup.py")], pytest.ExitCode.USAGE_ERROR),
}
"""Arguments of Python, and the exit status."""


def test_our_own_package_is_known():
    assert describe_other_modal() is None


@pytest.mark.parametrize("door", FRONT_DOORS)
def test_other_package_is_one_line_on_stderr(door, tmp_path):
    (tmp_path / "modal").mkdir()
    foreign = tmp_path / "modal/__init__.py"
    foreign.write_text(FOREIGN)
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    arguments, status = FRONT_DOORS[door]
    done = subprocess.run(
        [sys.executable, "-P", *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    assert done.returncode == status
    (line,) = [line for line in done.stderr.splitlines() if line]
    assert str(foreign) in line
    assert "granular-wave-modes" in line
