"""What a program loads: short commands no compiler, analysis without matplotlib says so."""

import os
import subprocess
import sys

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


def test_analysis_without_matplotlib_is_one_line(tmp_path):
    (tmp_path / "matplotlib.py").write_text("raise ModuleNotFoundError(name='matplotlib')")
    command = [sys.executable, "-m", "analysis", "figure", "--help"]
    variables = os.environ | {"PYTHONPATH": f"{tmp_path}:{ROOT}"}
    done = subprocess.run(command, env=variables, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == "error: matplotlib is absent, which draws; pip install matplotlib\n"
