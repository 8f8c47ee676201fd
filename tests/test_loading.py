"""What a program loads: short commands no compiler, analysis without matplotlib says so."""

import os
import subprocess
import sys

import pytest
from places import ROOT

from modal.packing.crystal import fcc
from modal.packing.network import write_network


def test_a_short_command_loads_no_compiler_and_no_plots(tmp_path):
    """Each takes as long to load as the command takes, and none of them is needed."""
    write_network(tmp_path / "small.network.h5", fcc(cells=(2, 2, 20)))
    code = (
        "import sys\n"
        "from modal.__main__ import main\n"
        "assert main(['info', sys.argv[1]]) == 0\n"
        "heavy = ('numba', 'matplotlib', 'scipy.spatial')\n"
        "assert not set(heavy) & set(sys.modules)\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "small.network.h5")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("absent", "command", "said"),
    [
        ("matplotlib", "figure", "matplotlib is absent, which draws; pip install matplotlib"),
        ("pandas", "study", "pandas is absent, which groups the results of a study; pip install"),
    ],
)
def test_analysis_without_a_package_is_one_line(absent, command, said, tmp_path):
    (tmp_path / f"{absent}.py").write_text(f"raise ModuleNotFoundError(name='{absent}')")
    command = [sys.executable, "-m", "analysis", command, "--help"]
    variables = os.environ | {"PYTHONPATH": f"{tmp_path}:{ROOT}"}
    done = subprocess.run(command, env=variables, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {said}") and done.stderr.count("\n") == 1
