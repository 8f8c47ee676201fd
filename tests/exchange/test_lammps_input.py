"""What LAMMPS' lines of input say of types and walls, read as LAMMPS reads them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import program_files
import pytest
from places import PACKINGS
from program_files import (
    COLUMN_PAIR,
    COLUMN_WALL,
    PackingFiles,
    assert_same_contacts,
    column,
)
from refusals import refusal

import modal
from modal.exchange.lammps import TANGENTIAL
from modal.exchange.registry import import_packing
from modal.packing.network import read_network
from modal.system.assembly import stiffness_matrix


@pytest.fixture
def types(write_files):
    """Write spheres of three types in turn, and a log with these lines of pair_coeff."""

    def make(*lines: str) -> PackingFiles:
        files = write_files("lammps")
        files.rewrite("spheres", lambda row: [row[0], str(int(row[0]) % 3 + 1), *row[2:]], 9)
        text = "".join(f"pair_coeff {line}\n" for line in lines)
        files.log.write_text(f"units si\npair_style granular\n{text}")
        files.options = {"log": files.log}
        return files

    return make


A, B = (f"hertz {modulus} 0 tangential linear_nohistory 0 0.3" for modulus in (4e10, 9e10))


@pytest.mark.parametrize(
    ("lines", "wanted"),
    [
        (("1 1 A", "* * B"), "BBBBBB"),
        (("* * A", "1 * B"), "BBBAAA"),
        (("* * A", "3 * B"), "AAAAAB"),
        (("* * A", "*2 3* B"), "AABABA"),
        (("* * A", "1*2 2*3 B"), "ABBBBA"),
        (("* * A", "3 1 B"), "AABAAA"),
    ],
)
def test_last_pair_coeff_of_a_pair_holds(types, lines, wanted):
    """Check the pairs 11, 12, 13, 22, 23, 33.

    The expected laws are what forces of LAMMPS (29 Sep 2021) show, but for `3 1`, which that one
    refuses, as its manual wants the lower type first: it is taken for `1 3` here.
    """
    files = types(*(line.replace("A", A).replace("B", B) for line in lines))
    result = import_packing(files.spheres, log=files.log)
    network = result.network
    kind = (np.arange(network.n_particles) + 1) % 3 + 1
    ends = np.sort([kind[network.particle_i], kind[network.particle_j]], axis=0)
    modulus = {"A": 4e10, "B": 9e10}
    for pair, letter in zip(("11", "12", "13", "22", "23", "33"), wanted, strict=True):
        is_pair = (ends == np.array([[int(pair[0])], [int(pair[1])]])).all(axis=0)
        assert is_pair.any()
        normal = np.array([law.normal for law in result.laws])[result.law[is_pair]]
        np.testing.assert_allclose(normal, modulus[letter], rtol=1e-12, err_msg=pair)


@pytest.mark.parametrize(
    ("lines", "code", "name"),
    [
        (("* * A", "A A B"), "type_range", "log.lammps: pair_coeff A A: 'A'"),
        (("* * A", "0 1 B"), "type_range", "pair_coeff 0 1: '0'"),
        (("* * A", "3*2 * B"), "type_range", "pair_coeff 3*2 *: '3*2'"),
        (("* * A", "2* 1 B"), "no_pair", "pair_coeff 2* 1:"),
        (("1 * A",), "no_law", "types 2 and 2"),
        (("1 1 A", "2* 2* B"), "no_law", "types 1 and 2"),
    ],
)
def test_types_that_are_none_and_pairs_without_a_law_are_refused(types, lines, code, name):
    files = types(*(re.sub("A$", A, line).replace("B", B) for line in lines))
    files.refused(code, name)


@pytest.mark.parametrize("history", TANGENTIAL)
def test_tangential_models_have_their_coefficients(types, history):
    """Read k_t, x_gammat and mu, as in the manual; a model without history has no k_t."""
    stiffness_word = "" if history == "linear_nohistory" else "5e6 "
    files = types(f"* * hertz 4e10 0 tangential {history} {stiffness_word}0 0.3 twisting marshall")
    (law,) = files.imported()["law"]
    network = read_network(files.out)
    stiffness, rest = law.partition("tangential ")[2].split(" ", 1)
    assert float(stiffness) == (5e6 if stiffness_word else 0.0)
    assert "friction 0.3;" in rest
    assert ("radius; friction" in rest) == ("mindlin" in history)
    radius_i, radius_j = network.radius[[network.particle_i, network.particle_j]]
    twisting = (
        0.5 * float(stiffness) * radius_i * radius_j / (radius_i + radius_j) * network.overlap
    )
    np.testing.assert_allclose(
        network.stiffness_twisting if stiffness_word else 0 * radius_i, twisting, rtol=1e-9
    )


WALL = "wall/gran granular hertz 41666666666.66667 0 tangential linear_nohistory 0 0 zplane"
LOW = "0.0"
HIGH = "0.01889427084603357"
CONTACTS = PACKINGS / "mine.contacts"


def split(capsys, folder: Path, top: str = "41666666666.66667") -> PackingFiles:
    """Write the example with a fix for each wall, the upper one of this modulus, N/m^2."""
    options = {"contacts": CONTACTS, "log": folder / "log.lammps"}
    files = PackingFiles(capsys, folder / "x.atoms", options)
    rows = []
    for line in (PACKINGS / "mine.atoms").read_text().splitlines():
        words = line.split(" ")
        if line.startswith("ITEM: ATOMS"):
            words[-4:] = [f"f_{name}[{k}]" for name in ("top", "bot") for k in (1, 2, 3, 4)]
        elif len(words) > 10:
            absent = ["0"] * 4
            words[-4:] = absent + words[-4:] if float(words[-1]) > 0 else words[-4:] + absent
        rows.append(" ".join(words))
    files.spheres.write_text("\n".join(rows) + "\n")
    files.log.write_text((PACKINGS / "log.lammps").read_text())
    upper = WALL.replace("41666666666.66667", top)
    two = f"fix bot all {WALL} {LOW} NULL contacts\nfix top all {upper} NULL {HIGH} contacts\n"
    files.spoil("log", f"fix wall all {WALL} {LOW} {HIGH} contacts\n", two)
    return files


def test_two_fixes_are_the_walls_of_one(tmp_path, capsys):
    """Compare contacts, forces and stiffnesses, with the log's IDs and with typed walls."""
    files = split(capsys, tmp_path)
    options = {"contacts": CONTACTS, "log": PACKINGS / "log.lammps"}
    expected = modal.read(PACKINGS / "mine.atoms", **options)
    assert [(expected.particle_j == code).sum() for code in (-1, -2)] == [9, 13]
    for wall in (None, f"{WALL.removeprefix('wall/gran ')} {LOW} {HIGH}"):
        network = files.network(wall=wall)
        assert_same_contacts(
            network, expected, "particle_j force_normal force_tangential stiffness_normal"
        )


def test_each_wall_has_the_law_of_its_fix(tmp_path, capsys):
    """Make the upper wall 4.8 times as stiff: kn of contacts from positions follows."""
    example = modal.read(PACKINGS / "mine.atoms", log=PACKINGS / "log.lammps")
    stiffened = split(capsys, tmp_path, "2e11").network(contacts=None)
    for code, factor in ((-1, 1.0), (-2, 4.8)):
        stiffness = [
            network.stiffness_normal[network.particle_j == code] for network in (stiffened, example)
        ]
        np.testing.assert_allclose(stiffness[0], factor * stiffness[1], rtol=1e-12)


@pytest.mark.parametrize(
    ("file", "old", "new", "code", "name"),
    [
        ("log", f"NULL {HIGH}", f"{LOW} {HIGH}", "second_wall", "fix top wall/gran:"),
        ("spheres", r"f_top\[3\]", "f_mine[3]", "no_column", "column f_top[3]:"),
        ("log", f"{LOW} NULL", "NULL NULL", "no_wall", "x.atoms: sphere 1"),
    ],
)
def test_walls_that_do_not_fit_are_refused(tmp_path, capsys, file, old, new, code, name):
    files = split(capsys, tmp_path)
    files.spoil(file, old, new)
    files.refused(code, name)


PRINTED = f'print "pair_coeff * * ${{B}}"\npair_coeff * * {B}'


@pytest.mark.parametrize("more", ["pair_style granular", PRINTED])
def test_lines_that_change_no_law(types, more):
    """Repeat pair_style, which keeps its coefficients; print a line that looks like a command.

    As LAMMPS does (29 Sep 2021): its forces are the same with that line and without.
    """
    files = types(f"* * {A}")
    once = files.network()
    files.log.write_text(f"{files.log.read_text()}{more}\n")
    assert_same_contacts(files.network(), once, "stiffness_normal")


def test_a_law_that_changes_after_the_dump_is_told(types):
    """Import step 7 with a law that changes after step 9 (a remark), or after step 5 (none)."""
    files = types(f"* * {A}")
    log = files.log.read_text()
    for step, is_remarked in ((5, False), (9, True)):
        files.log.write_text(
            f"{log}Step N\n0 6\n{step} 6\nLoop\n99\npair_coeff * * {B}\nStep\n20\n"
        )
        remarks = " ".join(files.imported()["remarks"])
        assert (f"changes the law or the walls after step {step}" in remarks) == is_remarked


def test_types_that_the_law_asks_for_and_the_dump_lacks_are_refused(types):
    files = types(f"* * {A}", f"2 2 {B}")
    files.spoil("spheres", "id type", "id other")
    files.refused("no_column", "column type:", "'id other x")


def test_a_wall_for_a_group_needs_the_contacts(walled):
    walled.spoil("log", "fix w all", "fix w few")
    walled.imported()
    walled.refused("wall_of_group", "fix w", "few", contacts=None)


def test_radii_of_few_digits_blur_overlaps_as_positions_do(write_files):
    """Import positions of 17 digits with radii of 6, as `%g` writes them."""
    files = write_files("lammps")
    files.options["contacts"] = None
    assert files.imported()["overlap_over_error_of_digits"] > 1e6
    files.rewrite("spheres", lambda row: [*row[:5], f"{float(row[5]):.6g}", *row[6:]], 9)
    assert files.imported()["overlap_over_error_of_digits"] < 1e5


def test_contacts_that_are_not_listed_are_counted(walled):
    """Remove three rows, as a compute for a group does; the spheres still overlap there."""

    def missing() -> list[str]:
        return [text for text in walled.imported()["remarks"] if "contacts missing" in text]

    assert not missing()
    count = int(walled.contacts.read_text().splitlines()[3])
    walled.respell("contacts", 4, 0, str(count - 3))
    walled.spoil("contacts", r"(.*\n){3}\Z", "")
    assert len(missing()) == 1


def test_masses_of_rigid_bodies_may_be_told(paired):
    """Read masses in the format of `fix rigid ... infile` in place of those of the members."""
    plain = paired.network()
    assert plain.n_particles == 59
    bodies_file = paired.spheres.with_name("r.rigid")
    centre = " ".join(map(repr, plain.position[0].tolist()))
    bodies_file.write_text(
        f"# bodies\n1\n1 2e-5 {centre} 1e-11 2e-11 2.5e-11 1e-12 2e-12 3e-12 0 0 0\n"
    )
    assert paired.imported(bodies=bodies_file)["spheres"] == 59
    network = read_network(paired.out)
    assert network.mass[0] == 2e-5 != plain.mass[0]
    expected = [[1e-11, 1e-12, 2e-12], [1e-12, 2e-11, 3e-12], [2e-12, 3e-12, 2.5e-11]]
    np.testing.assert_array_equal(network.inertia_tensor[0], expected)
    np.testing.assert_array_equal(network.mass[1:], plain.mass[1:])
    bodies_file.write_text(bodies_file.read_text().replace("1 2e-5", "2 2e-5"))
    paired.refused("incomplete_bodies", "x.atoms:", bodies=bodies_file)
    with refusal("pre_stress_of_bodies"):
        stiffness_matrix(network, pre_stress="normal")


def test_members_of_a_body_may_overlap_as_they_like(paired):
    """Join two spheres that are nearly in one place, with contacts from positions."""
    lines = paired.spheres.read_text().splitlines()
    first, second = (next(k for k in range(9, 69) if lines[k].startswith(f"{n} ")) for n in (1, 2))
    words = lines[first].split()
    beside = ["2", words[1], repr(float(words[2]) + 0.02 * float(words[5])), *words[3:]]
    paired.respell("spheres", second + 1, slice(0, 99), beside)
    network = paired.network()
    assert network.n_particles == 59
    assert network.mass[0] == pytest.approx(2 * float(words[6]), rel=1e-15, abs=0)
    paired.spoil("log", r"\Z", "unfix r\n")
    assert paired.code(contacts=None)


def test_numbers_of_bodies_need_a_log(paired):
    files = paired
    law = {"log": None, "pair": program_files.PAIR}
    files.refused("unknown_bodies", "x.atoms:", **law)
    files.spoil("spheres", "mol", "vx")
    files.refused("no_bodies", "--bodies:", **law, bodies=files.log)


@pytest.mark.parametrize(
    "lines",
    [
        "hooke",
        "pair_style granular hooke",
        "pair_coeff * * hooke",
        "pair_coeff 1 1 hooke",
        "pair_style granular; pair_coeff * * hooke",
        "pair_style granular\npair_coeff * * hooke",
    ],
)
def test_typed_law_may_be_whole_lines_of_a_script(tmp_path, lines):
    pair = COLUMN_PAIR.replace("granular hooke", lines)
    network = modal.read(column(tmp_path), pair=pair, wall=COLUMN_WALL)
    assert network.n_contacts == 4
    np.testing.assert_array_equal(network.stiffness_normal, 1e5)


@pytest.mark.parametrize("pair", ["pair_coeff 1", "pair_coeff 1 1 hooke 1 0 pair_coeff 2 2", "; "])
def test_typed_lines_that_are_no_law_are_refused(tmp_path, pair):
    with refusal("no_law", "--pair"):
        modal.read(column(tmp_path), pair=pair, wall=COLUMN_WALL)
