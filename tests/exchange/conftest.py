"""Packings as other programs write them, for the tests of imports."""

import packings
import program_files
import pytest
from places import PACKINGS
from program_files import Given

import modal


@pytest.fixture
def given(tmp_path, capsys):
    """Write a packing as a program does: `given("lammps", periodic_z)`, or of a network."""
    return lambda program, *more: program_files.written(capsys, tmp_path, program, *more)


@pytest.fixture
def copied(tmp_path, capsys):
    """Copy what a program has written itself: its file of spheres, and others by option."""

    def make(spheres: str, **options: str) -> Given:
        for name in (spheres, *options.values()):
            (tmp_path / name).write_bytes((next(PACKINGS.rglob(name))).read_bytes())
        other_paths = {option: tmp_path / name for option, name in options.items()}
        return Given(capsys, tmp_path / spheres, other_paths)

    return make


@pytest.fixture
def cubic(copied):
    """Return the files of MercuryDPM's CubicPackingSelfTest."""
    return copied("mercury_CubicPacking.restart")


@pytest.fixture
def liggghts(copied):
    """Return the files of a packing that LIGGGHTS has computed."""
    return copied("x.atoms", contacts="x.contacts", log="log.liggghts")


@pytest.fixture
def walled(given):
    """Write spheres between walls, contacts and log, as LAMMPS does."""
    return given("lammps", False)


@pytest.fixture
def paired(given):
    """Write a periodic packing and its log; two of the spheres have the number 1 in mol."""
    files = given("lammps")
    files.options["contacts"] = None
    files.respell("spheres", 9, slice(99, 99), ["mol"])
    # Ids of members lie beside each other; the centres of these pairs, less than half a cell.
    files.rewrite("spheres", lambda row: [*row, "0" if int(row[0]) > 2 else "1"], 9)
    files.spoil("log", r"\Z", "fix r clumps rigid molecule\n")
    return files


@pytest.fixture(scope="session")
def mixture():
    """Return 200 spheres of two sizes at 100 kPa; overlaps are some 4e-4 of a radius."""
    return modal.random_packing(200, 1e5, seed=17, aspect=1.5, sizes=("two", 2, 0.5))


@pytest.fixture
def tables(given):
    """Write two tables of a committed packing; contacts have five columns, with normal forces."""
    files = given("tables", packings.sheared())
    files.rewrite("contacts", lambda words: words[:5], 0)
    return files
