"""What a type checker sees of modal in a program that uses it."""

from __future__ import annotations

import subprocess
import sys

import pytest
from places import ROOT

PROGRAM = """
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import modal
from modal.modes.density import DensityOfStates
from modal.modes.mode_set import ModeSet
from modal.packing.network import Network
from modal.waves.propagate import LinearWave
from modal.waves.response import Response

net = modal.read("case06.sample.h5")
assert_type(net, Network)
assert_type(net.position, NDArray[np.float64])
assert_type(modal.fcc(cells=(2, 2, 20)), Network)
assert_type(modal.eigenmodes(net, lowest=3), ModeSet)
assert_type(modal.eigenmodes(net, lowest=3).frequency, NDArray[np.float64])
assert_type(modal.density_of_states(net), DensityOfStates)
assert_type(modal.propagate(net, duration=1e-4), LinearWave)
assert_type(modal.frequency_response(net), Response)
assert_type(modal.FccLattice(stress=1e5).low_pass_frequency, float)
modal.eigenmodes(net, lowest="three")  # wrong
modal.eigenmode(net)  # wrong
"""


def test_a_program_that_uses_modal_is_checked(tmp_path):
    """The names of modal have their own types, not Any: only the two wrong lines are reported."""
    pytest.importorskip("mypy")
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    check = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary"]
    check += ["--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(tmp_path)]
    done = subprocess.run([*check, str(program)], cwd=ROOT, capture_output=True, text=True)
    errors = [line for line in done.stdout.splitlines() if ": error: " in line]
    wrong = [k for k, line in enumerate(PROGRAM.splitlines(), 1) if line.endswith("# wrong")]
    assert [int(line.split(":")[1]) for line in errors] == wrong, done.stdout + done.stderr
