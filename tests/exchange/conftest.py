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
        others = {option: tmp_path / name for option, name in options.items()}
        return Given(capsys, tmp_path / spheres, others)

    return make


@pytest.fixture
def cubic(copied):
    """MercuryDPM's CubicPackingSelfTest."""
    return copied("mercury_CubicPacking.restart")


@pytest.fixture
def liggghts(copied):
    """A packing that LIGGGHTS has made."""
    return copied("x.atoms", contacts="x.contacts", log="log.liggghts")


@pytest.fixture
def walled(given):
    """Spheres between walls, contacts and log, as LAMMPS writes them."""
    return given("lammps", False)


@pytest.fixture
def paired(given):
    """Spheres of a periodic packing, two of which have the number 1 in mol; a log."""
    files = given("lammps")
    files.options["contacts"] = None
    files.respell("spheres", 9, slice(99, 99), ["mol"])
    # Ids of members lie beside each other; the centres of these pairs, less than half a cell.
    files.rewrite("spheres", lambda row: [*row, "0" if int(row[0]) > 2 else "1"], 9)
    files.spoil("log", r"\Z", "fix r clumps rigid molecule\n")
    return files


@pytest.fixture(scope="session")
def mixture():
    """200 spheres of two sizes at 100 kPa, overlaps some 4e-4 of a radius."""
    return modal.random_packing(200, 1e5, seed=17, aspect=1.5, sizes=("two", 2, 0.5))


@pytest.fixture
def tables(given):
    """Two tables of a committed packing, of contacts five columns, with normal forces."""
    files = given("tables", packings.sheared())
    files.rewrite("contacts", lambda words: words[:5], 0)
    return files
