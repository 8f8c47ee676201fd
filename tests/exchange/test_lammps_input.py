"""What LAMMPS' lines of input say of types and walls, read as LAMMPS reads them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import program_files
import pytest
from program_files import refused

from modal.exchange.lammps import import_lammps

FILE = "out.network.h5"


def three_types(folder: Path, *lines: str) -> tuple[Path, Path]:
    """Spheres of three types in turn, and a log with these lines of pair_coeff."""
    atoms, _, log = program_files.lammps(program_files.packing(True), folder)
    head, rows = atoms.read_text().split("mass\n")
    rows = re.sub(r"(?m)^(\d+) 1 ", lambda row: f"{row[1]} {int(row[1]) % 3 + 1} ", rows)
    atoms.write_text(f"{head}mass\n{rows}")
    said = "".join(f"pair_coeff {line}\n" for line in lines)
    log.write_text(f"units si\npair_style granular\n{said}")
    return atoms, log


A, B = (f"hertz {modulus} 0 tangential linear_nohistory 0 0.3" for modulus in (4e10, 9e10))


@pytest.mark.parametrize(
    ("lines", "wanted"),
    [
        (("1 1 A", "* * B"), "BBBBBB"),
        (("* * A", "1 * B"), "BBBAAA"),
        (("1 1 A", "2* 2* B"), "AMMBBB"),
        (("* * A", "3 * B"), "AAAAAB"),
        (("* * A", "*2 3* B"), "AABABA"),
        (("* * A", "1*2 2*3 B"), "ABBBBA"),
        (("* * A", "3 1 B"), "AABAAA"),
        (("1*2 1*2 A", "3 3 B"), "AAMAMB"),
    ],
)
def test_last_pair_coeff_of_a_pair_holds(tmp_path, lines, wanted):
    """The pairs 11, 12, 13, 22, 23, 33; M is the geometric mean of A and B.

    The expected laws are what forces of LAMMPS (29 Sep 2021) show, but for `3 1`, which that one
    refuses and later ones exchange.
    """
    said = (line.replace("A", A).replace("B", B) for line in lines)
    atoms, log = three_types(tmp_path, *said)
    found = import_lammps(atoms, None, log, *[None] * 4)
    network = found.network
    kind = (np.arange(network.n_particles) + 1) % 3 + 1
    ends = np.sort([kind[network.particle_i], kind[network.particle_j]], axis=0)
    modulus = {"A": 4e10, "B": 9e10, "M": 6e10}
    for pair, letter in zip(("11", "12", "13", "22", "23", "33"), wanted, strict=True):
        of = (ends == np.array([[int(pair[0])], [int(pair[1])]])).all(axis=0)
        assert of.any()
        normal = np.array([law.normal for law in found.laws])[found.law[of]]
        np.testing.assert_allclose(normal, modulus[letter], rtol=1e-12, err_msg=pair)


@pytest.mark.parametrize(
    ("types", "said"),
    [
        ("A A", "log.lammps: pair_coeff A A: 'A' is no type; give numbers or ranges"),
        ("0 1", "pair_coeff 0 1: '0' is no type"),
        ("3*2 *", r"pair_coeff 3\*2 \*: '3\*2' is no type"),
        ("1*2*3 *", r"'1\*2\*3' is no type"),
        ("2* 1", r"pair_coeff 2\* 1: covers no pair, .*; exchange the two"),
    ],
)
def test_types_that_are_none_are_refused(tmp_path, capsys, types, said):
    atoms, log = three_types(tmp_path, f"* * {A}", f"{types} {B}")
    error = refused(capsys, atoms, "--log", log, "-o", tmp_path / FILE)
    assert re.search(said, error), error


def test_pairs_that_no_line_covers_are_refused(tmp_path, capsys):
    """Mixing needs a law of each of the two types."""
    atoms, log = three_types(tmp_path, f"1 * {A}")
    error = refused(capsys, atoms, "--log", log, "-o", tmp_path / FILE)
    assert "no pair_coeff for types 2 and 2; give one" in error
