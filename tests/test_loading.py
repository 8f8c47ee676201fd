"""What is loaded is not searched for garbage, everything else is; what is not used stays out."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import pytest

from modal.tools.loading import undisturbed, when_used

ROOT = Path(__file__).resolve().parents[1]


def printed_by(code: str) -> list[str]:
    """Lines that a Python of its own prints."""
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def test_collection_goes_on_as_before_even_after_an_error():
    assert gc.isenabled()
    with pytest.raises(ValueError), undisturbed():
        assert not gc.isenabled()
        raise ValueError
    assert gc.isenabled()
    gc.disable()
    try:
        with undisturbed():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_a_command_collects_as_it_runs_and_not_as_it_ends():
    """Python's own record of its collections: the last one finds all objects set aside."""
    code = (
        "import gc, atexit\n"
        # Registered first, so called last: after what modal has registered.
        "atexit.register(lambda: print(gc.isenabled(), len(gc.get_objects()) < 1000))\n"
        "from modal.__main__ import main\n"
        "main(['lattice', '--json'])\n"
        "print(len(gc.get_objects()) > 1000)\n"
    )
    assert printed_by(code)[-2:] == ["True", "True True"]


def test_a_command_loads_no_compiler_of_fortran_and_who_wants_it_has_it():
    code = (
        "import sys\n"
        "from modal.cli.main import command_of\n"
        "command_of('wave')\n"
        "print('numpy.f2py.crackfortran' in sys.modules, 'scipy.sparse' in sys.modules)\n"
        "import numpy.f2py\n"
        "print(numpy.f2py is sys.modules['numpy.f2py'], callable(numpy.f2py.get_include))\n"
        "from numpy.f2py import crackfortran\n"
    )
    assert printed_by(code) == ["False True", "True True"]


def test_what_is_absent_or_loaded_stays_so():
    when_used("modal.no_such_room")
    assert "modal.no_such_room" not in sys.modules
    before = sys.modules["modal.tools.loading"]
    when_used("modal.tools.loading")
    assert sys.modules["modal.tools.loading"] is before


def test_analysis_without_matplotlib_is_one_line(tmp_path):
    (tmp_path / "matplotlib.py").write_text("raise ModuleNotFoundError(name='matplotlib')")
    command = [sys.executable, "-m", "analysis", "--help"]
    variables = os.environ | {"PYTHONPATH": f"{tmp_path}:{ROOT}"}
    done = subprocess.run(command, env=variables, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == "error: matplotlib is absent, which draws; pip install matplotlib\n"
