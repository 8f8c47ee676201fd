"""Packings as other programs write them, for the tests of imports."""

import packings
import program_files
import pytest
from places import PACKINGS
from program_files import PackingFiles

import modal


@pytest.fixture
def write_files(tmp_path, capsys):
    """Return a function that writes a packing as a program does.

    `write_files("lammps", periodic_z)` writes spheres of radii 1:3, or a network in its place.
    """

    def write(program: str, *more: object) -> PackingFiles:
        return program_files.write_packing_files(capsys, tmp_path, program, *more)

    return write


@pytest.fixture
def copy_files(tmp_path, capsys):
    """Return a function that copies files which a program has written itself.

    They are its file of spheres, and others by their option of `import`.
    """

    def make(spheres: str, **options: str) -> PackingFiles:
        for name in (spheres, *options.values()):
            (tmp_path / name).write_bytes((next(PACKINGS.rglob(name))).read_bytes())
        other_paths = {option: tmp_path / name for option, name in options.items()}
        return PackingFiles(capsys, tmp_path / spheres, other_paths)

    return make


@pytest.fixture
def cubic(copy_files):
    """Return the files of MercuryDPM's CubicPackingSelfTest."""
    return copy_files("mercury_CubicPacking.restart")


@pytest.fixture
def liggghts(copy_files):
    """Return the files of a packing that LIGGGHTS has computed."""
    return copy_files("x.atoms", contacts="x.contacts", log="log.liggghts")


@pytest.fixture
def walled(write_files):
    """Write spheres between walls, contacts and log, as LAMMPS does."""
    return write_files("lammps", False)


@pytest.fixture
def paired(write_files):
    """Write a periodic packing and its log; two of the spheres have the number 1 in mol."""
    files = write_files("lammps")
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
def tables(write_files):
    """Write two tables of a committed packing; contacts have five columns, with normal forces."""
    files = write_files("tables", packings.sheared())
    files.rewrite("contacts", lambda words: words[:5], 0)
    return files
