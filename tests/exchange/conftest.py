"""Packings as other programs write them, for the tests of imports."""

import program_files
import pytest


@pytest.fixture
def given(tmp_path, capsys):
    """Write a packing as a program does: `given("lammps", periodic_z)`, or of a network."""
    return lambda program, *more: program_files.written(capsys, tmp_path, program, *more)
