"""What is loaded is not searched for garbage, and everything else is."""

import gc
import subprocess
import sys
from pathlib import Path

import pytest

from modal.loading import undisturbed

ROOT = Path(__file__).resolve().parents[1]


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
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-2:] == ["True", "True True"]
