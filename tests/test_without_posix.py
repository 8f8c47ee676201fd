"""Import and the main calls do without what POSIX alone has: Windows has none of it."""

import os
import subprocess
import sys
from pathlib import Path

from places import ROOT, TESTS

POSIX_MODULES = "resource,fcntl,termios,pwd,grp"
POSIX_CALLS = (
    "fork",
    "register_at_fork",
    "sched_getaffinity",
    "sysconf",
    "getuid",
    "geteuid",
    "getpgid",
    "killpg",
    "statvfs",
    "O_DIRECTORY",
)
PROGRAM = """
import os
for name in {calls}:
    if hasattr(os, name):
        delattr(os, name)

import analysis
import modal
from modal.__main__ import main

packing = modal.fcc(cells=(2, 2, 6))
modal.write("crystal.network.h5", packing)
packing = modal.read("crystal.network.h5")
modes = modal.eigenmodes(packing, lowest=6)
assert modes.certified
assert modal.count_modes(packing, modes.frequency[:1] / 2)[0] == 0
assert modal.propagate(packing, duration=5e-6).signals is not None
assert modal.elastic_moduli(packing).v_p > 0
assert analysis.measure(packing, quantities=["void_ratio"])["void_ratio"].known
assert main(["info", "crystal.network.h5", "--json"]) == 0
"""


def test_main_calls_run_without_posix(tmp_path: Path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM.format(calls=POSIX_CALLS))
    # The same mechanism that hides numba; numba is hidden too, as its loops take seconds to load.
    hidden = f"{POSIX_MODULES},numba,pypardiso"
    paths = os.pathsep.join([str(TESTS / "hidden"), str(ROOT)])
    done = subprocess.run(
        [sys.executable, program],
        cwd=tmp_path,
        env=os.environ | {"GRANULAR_WITHOUT": hidden, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
