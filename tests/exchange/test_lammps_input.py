"""What LAMMPS' lines of input say of types and walls, read as LAMMPS reads them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import program_files
import pytest
from places import PACKINGS
from program_files import refused

import modal
from modal.exchange.registry import import_packing
from modal.packing.network import read_network
from modal.system.assembly import stiffness_matrix
from modal.tools.errors import InputError

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
    refuses, as its manual wants the lower type first: it is taken for `1 3` here.
    """
    said = (line.replace("A", A).replace("B", B) for line in lines)
    atoms, log = three_types(tmp_path, *said)
    found = import_packing(atoms, log=log)
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


WALL = "wall/gran granular hertz 41666666666.66667 0 tangential linear_nohistory 0 0 zplane"
LOW, HIGH = "0.0", "0.01889427084603357"
CONTACTS = PACKINGS / "mine.contacts"


def split(folder: Path, top: str = "41666666666.66667") -> tuple[Path, Path]:
    """The example with a fix for each wall, that of the upper one of this modulus, N/m^2."""
    atoms, log = folder / "x.atoms", folder / "log.lammps"
    rows = []
    for line in (PACKINGS / "mine.atoms").read_text().splitlines():
        words = line.split(" ")
        if line.startswith("ITEM: ATOMS"):
            words[-4:] = [f"f_{name}[{k}]" for name in ("top", "bot") for k in (1, 2, 3, 4)]
        elif len(words) > 10:
            absent = ["0"] * 4
            words[-4:] = absent + words[-4:] if float(words[-1]) > 0 else words[-4:] + absent
        rows.append(" ".join(words))
    atoms.write_text("\n".join(rows) + "\n")
    text = (PACKINGS / "log.lammps").read_text()
    one = f"fix wall all {WALL} {LOW} {HIGH} contacts\n"
    assert one in text
    upper = WALL.replace("41666666666.66667", top)
    two = f"fix bot all {WALL} {LOW} NULL contacts\nfix top all {upper} NULL {HIGH} contacts\n"
    log.write_text(text.replace(one, two))
    return atoms, log


def test_two_fixes_are_the_walls_of_one(tmp_path):
    """The same contacts, forces and stiffnesses, with the log's IDs and with typed walls."""
    atoms, log = split(tmp_path)
    whole = {"contacts": CONTACTS, "log": PACKINGS / "log.lammps"}
    wanted = modal.read(PACKINGS / "mine.atoms", **whole)
    assert [(wanted.particle_j == code).sum() for code in (-1, -2)] == [9, 13]
    a = program_files.sorted_ends(wanted)
    typed = f"{WALL.removeprefix('wall/gran ')} {LOW} {HIGH}"
    for wall in (None, typed):
        found = modal.read(atoms, contacts=CONTACTS, log=log, wall=wall)
        b = program_files.sorted_ends(found)
        for name in ("particle_j", "force_normal", "force_tangential", "stiffness_normal"):
            np.testing.assert_array_equal(getattr(found, name)[b], getattr(wanted, name)[a])


def test_each_wall_has_the_law_of_its_fix(tmp_path):
    """The upper one 4.8 times as stiff, contacts from positions: kn is proportional to that."""
    wanted = modal.read(PACKINGS / "mine.atoms", log=PACKINGS / "log.lammps")
    atoms, log = split(tmp_path, "2e11")
    found = modal.read(atoms, log=log)
    for code, factor in ((-1, 1.0), (-2, 4.8)):
        stiffness = [each.stiffness_normal[each.particle_j == code] for each in (found, wanted)]
        np.testing.assert_allclose(stiffness[0], factor * stiffness[1], rtol=1e-12)


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("log", f"NULL {HIGH}", f"{LOW} {HIGH}", "fix top wall/gran: a second wall at low z, "),
        ("atoms", "f_top[3]", "f_mine[3]", r"column f_top\[1..4\]: no forces of fix top; write"),
        ("log", f"{LOW} NULL", "NULL NULL", "sphere 1 is pushed in f_bot by a wall that is NULL"),
    ],
)
def test_walls_that_do_not_fit_are_refused(tmp_path, capsys, file, old, new, said):
    atoms, log = split(tmp_path)
    path = {"atoms": atoms, "log": log}[file]
    path.write_text(path.read_text().replace(old, new))
    given = (atoms, "--contacts", CONTACTS, "--log", log, "-o", tmp_path / FILE)
    error = refused(capsys, *given)
    assert re.search(said, error), error


REST = "0 0.2 tangential mindlin/force NULL 0 0.3"
ECHOED = f"""variable E equal 6e10
variable H string {{high}}
variable law string hertz/material
variable none string ""
pair_coeff * * ${{law}} $E {REST} # of $E Pa
pair_coeff * * hertz/material $E {REST}
pair_coeff * * hertz/material 60000000000 {REST}
fix w all wall/gran granular ${{law}} $(v_E) {REST} zplane 0 $H contacts
fix w all wall/gran granular hertz/material $(v_E) {REST} zplane 0 $H contacts
fix w all wall/gran granular hertz/material 60000000000 {REST} zplane 0 $H contacts
fix w all wall/gran granular hertz/material 60000000000 {REST} zplane 0 {{high}} contacts
print "pair_coeff: $E"
pair_coeff: 60000000000
variable s string "unfix"
$s q ${{none}}
unfix q ${{none}}
unfix q
${{none}}

"""
"""As LAMMPS (29 Sep 2021) writes it: variables are put in one at a time, each time anew."""


def echoed(folder: Path) -> tuple[Path, Path, Path]:
    """A packing between walls whose log has variables."""
    atoms, contacts, log = program_files.lammps(program_files.packing(False), folder)
    wall = re.search(r"(?m)^fix w .* zplane \S+ (\S+) .*\n", log.read_text())
    text = log.read_text().replace(wall[0], ECHOED.replace("{high}", wall[1]))
    log.write_text(re.sub(r"(?m)^pair_coeff .* 6e10 .*\n", "", text))
    return atoms, contacts, log


def test_variables_of_one_letter_are_read_as_the_log_puts_them_in(tmp_path):
    """The same packing as without variables."""
    atoms, contacts, log = program_files.lammps(program_files.packing(False), tmp_path)
    wanted = modal.read(atoms, contacts=contacts, log=log)
    atoms, contacts, log = echoed(tmp_path)
    found = modal.read(atoms, contacts=contacts, log=log)
    assert found.wall_position.tolist() == wanted.wall_position.tolist()
    np.testing.assert_array_equal(found.stiffness_normal, wanted.stiffness_normal)
    np.testing.assert_array_equal(found.particle_j, wanted.particle_j)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("pair_coeff 1 1 hertz/material ${E} 0 0.2", r"\${E} has no value in this file: pair_co"),
        ("pair_coeff 1 1 hertz/material $E 0 0.2", r"\$E has no value in this file: pair_coeff 1"),
        ("fix v all wall/gran granular $(v_l) zplane 0 NULL", r"\$\(v_l\) has no value"),
        ("fix v all ${kind} $E", r"\${kind} \$E has no value"),
        ("fix r all rigid/small $m", r"\$m has no value"),
        ("$c 1 1 hertz/material 6e10 0 0.2", r"\$c has no value"),
        ("unfix $w", r"line \d+: \$w has no value .*; give the log of the run, or write the value"),
    ],
)
def test_variables_without_a_value_are_refused(tmp_path, capsys, line, said):
    """As in a script that is given for its log; lines that do not count may have them."""
    atoms, contacts, log = program_files.lammps(program_files.packing(False), tmp_path)
    given = (atoms, "--contacts", contacts, "--log", log, "-o", tmp_path / FILE)
    log.write_text(log.read_text() + "fix t all langevin $T $T 1 ${seed}\nrun $n\n")
    program_files.imported(capsys, *given)
    log.write_text(log.read_text() + line + "\n")
    error = refused(capsys, *given)
    assert re.search(said, error), error


def test_the_same_pair_style_once_more_keeps_its_coefficients(tmp_path):
    """As LAMMPS does (29 Sep 2021): its forces are the same with that line and without."""
    atoms, log = three_types(tmp_path, f"* * {A}")
    once = modal.read(atoms, log=log)
    log.write_text(log.read_text() + "pair_style granular\n")
    twice = modal.read(atoms, log=log)
    np.testing.assert_array_equal(twice.stiffness_normal, once.stiffness_normal)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("dimension 2", "line 10: dimension 2; a network has spheres that move in space"),
        ("bond_style bpm/spring", "bond_style bpm/spring: bonds are no contacts"),
        ("fix f all freeze", "fix freeze: frozen spheres"),
        ("fix h all wall/harmonic zlo EDGE 1 1 1", "fix wall/harmonic: walls of this kind are not"),
        (
            "fix h all wall/gran/kk granular hertz 4e10 0 zplane 0 1",
            "fix h wall/gran: a second wall",
        ),
        (
            "fix w all wall/gran granular hertz 4e10 0 zplane 0 1 wiggle z 1 1",
            "fix w .*it wiggles,",
        ),
        ("clear", "no law of contact is known"),
    ],
)
def test_commands_that_change_the_meaning_are_heard(tmp_path, capsys, line, said):
    atoms, contacts, log = program_files.lammps(program_files.packing(False), tmp_path)
    log.write_text(f"{log.read_text()}{line}\n")
    given = (atoms, "--contacts", contacts, "--log", log, "-o", tmp_path / FILE)
    error = refused(capsys, *given)
    assert re.search(said, error), error
    if line.startswith("fix f"):  # and no longer after its unfix
        log.write_text(f"{log.read_text()}unfix f\n")
        program_files.imported(capsys, *given)


def test_what_a_log_prints_is_no_command(tmp_path):
    atoms, log = three_types(tmp_path, f"* * {A}")
    once = modal.read(atoms, log=log)
    log.write_text(f'{log.read_text()}print "pair_coeff * * ${{B}}"\npair_coeff * * {B}\n')
    twice = modal.read(atoms, log=log)
    np.testing.assert_array_equal(twice.stiffness_normal, once.stiffness_normal)


def test_types_that_the_law_asks_for_and_the_dump_lacks_are_refused(tmp_path, capsys):
    atoms, log = three_types(tmp_path, f"* * {A}", f"2 2 {B}")
    atoms.write_text(atoms.read_text().replace("id type", "id other"))
    error = refused(capsys, atoms, "--log", log, "-o", tmp_path / FILE)
    assert "column type: no column type among id other x" in error


def test_a_wall_for_a_group_needs_the_contacts(tmp_path, capsys):
    atoms, contacts, log = program_files.lammps(program_files.packing(False), tmp_path)
    log.write_text(log.read_text().replace("fix w all", "fix w few"))
    given = ("--log", log, "-o", tmp_path / FILE)
    program_files.imported(capsys, atoms, "--contacts", contacts, *given)
    error = refused(capsys, atoms, *given)
    assert "fix w pushes the group few alone; give the contacts" in error


def test_radii_of_few_digits_blur_overlaps_as_positions_do(tmp_path, capsys):
    """Positions of 17 digits beside radii of 6, as `%g` writes them: 1e-9 m of the overlaps."""
    atoms, _, log = program_files.lammps(program_files.packing(True), tmp_path)
    told = program_files.imported(capsys, atoms, "--log", log, "-o", tmp_path / FILE)
    assert told["overlap_over_error_of_digits"] > 1e6
    lines = atoms.read_text().splitlines()
    for k, line in enumerate(lines[9:], 9):
        *words, radius, mass = line.split()
        lines[k] = " ".join([*words, f"{float(radius):.6g}", mass])
    atoms.write_text("\n".join(lines) + "\n")
    told = program_files.imported(capsys, atoms, "--log", log, "-o", tmp_path / FILE)
    assert told["overlap_over_error_of_digits"] < 1e5


@pytest.mark.parametrize(("step", "remarked"), [(5, 1), (10, 1), (20, 0), (15, 0)])
def test_a_law_that_changed_after_the_step_of_the_dump_is_remarked_on(tmp_path, step, remarked):
    """Steps of 0 to 10 have the first law, 10 to 20 another one; 15 is printed."""
    atoms, log = three_types(tmp_path, f"* * {A}")
    text = atoms.read_text().replace("TIMESTEP\n7\n", f"TIMESTEP\n{step}\n")
    atoms.write_text(text)
    told = "Step Pxx\n0 1\n10 1\n" + f"pair_coeff * * {B}\n" + "Step Pxx\n15 1\n20 1\n"
    log.write_text(log.read_text() + told)
    remarks = import_packing(atoms, log=log).remarks
    assert sum("changes the law or the walls after step" in line for line in remarks) == remarked


def test_contacts_that_are_not_listed_are_counted(tmp_path, capsys):
    """Three rows less, as of a compute for a group: the spheres still overlap there."""
    atoms, contacts, log = program_files.lammps(program_files.packing(False), tmp_path)
    given = (atoms, "--contacts", contacts, "--log", log, "-o", tmp_path / FILE)
    whole = program_files.imported(capsys, *given)
    assert not any("not listed" in line for line in whole["remarks"])
    lines = contacts.read_text().splitlines()
    count = int(lines[3]) - 3
    contacts.write_text("\n".join([*lines[:3], str(count), *lines[4:-3]]) + "\n")
    told = program_files.imported(capsys, *given)
    assert any(line.startswith("3 contacts that overlap are not") for line in told["remarks"])


def paired(folder: Path) -> tuple[Path, Path]:
    """Spheres of a periodic packing, two and two of which have a number in mol; a log."""
    atoms, _, log = program_files.lammps(program_files.packing(True), folder)
    lines = atoms.read_text().splitlines()
    lines[8] += " mol"
    # Ids of members lie beside each other; the centres of these pairs, less than half a cell.
    lines[9:] = [f"{line} {0 if int(line.split()[0]) > 2 else 1}" for line in lines[9:]]
    atoms.write_text("\n".join(lines) + "\n")
    log.write_text(log.read_text() + "fix r clumps rigid molecule\n")
    return atoms, log


def test_masses_of_rigid_bodies_may_be_told(tmp_path, capsys):
    """In the format of `fix rigid ... infile`, in place of those of the members."""
    atoms, log = paired(tmp_path)
    plain = modal.read(atoms, log=log)
    assert plain.n_particles == 59
    told = tmp_path / "r.rigid"
    place = " ".join(map(repr, plain.position[0].tolist()))
    told.write_text(f"# bodies\n1\n1 2e-5 {place} 1e-11 2e-11 2.5e-11 1e-12 2e-12 3e-12 0 0 0\n")
    found = modal.read(atoms, log=log, bodies=told)
    assert found.mass[0] == 2e-5 != plain.mass[0]
    wanted = [[1e-11, 1e-12, 2e-12], [1e-12, 2e-11, 3e-12], [2e-12, 3e-12, 2.5e-11]]
    np.testing.assert_array_equal(found.inertia_tensor[0], wanted)
    np.testing.assert_array_equal(found.mass[1:], plain.mass[1:])
    given = (atoms, "--log", log, "--bodies", told, "-o", tmp_path / FILE)
    said = program_files.imported(capsys, *given)
    assert said["spheres"] == 59 and said["spheres_of_bodies"] == 60
    written = read_network(tmp_path / FILE)
    np.testing.assert_array_equal(written.inertia_tensor, found.inertia_tensor)
    told.write_text(told.read_text().replace("1 2e-5", "2 2e-5"))
    with pytest.raises(InputError, match="some bodies have no mass and tensor"):
        modal.read(atoms, log=log, bodies=told)
    with pytest.raises(InputError, match="pre-stress of bodies that are no spheres"):
        stiffness_matrix(found, pre_stress="normal")


def test_members_of_a_body_may_overlap_as_they_like(tmp_path):
    """Two spheres of one size nearly in one place, whose contacts are sought and not listed."""
    atoms, log = paired(tmp_path)
    lines = atoms.read_text().splitlines()
    one, two = (next(k for k in range(9, 69) if lines[k].startswith(f"{n} ")) for n in (1, 2))
    words = lines[one].split()
    words[0], words[2] = "2", repr(float(words[2]) + 0.02 * float(words[5]))
    lines[two] = " ".join(words)
    atoms.write_text("\n".join(lines) + "\n")
    found = modal.read(atoms, log=log)
    assert found.n_particles == 59
    assert found.mass[0] == pytest.approx(2 * float(words[6]), rel=1e-15)
    log.write_text(log.read_text() + "unfix r\n")
    with pytest.raises(InputError, match="overlap by more than 0.3 of the smaller radius"):
        modal.read(atoms, log=log)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rigid molecule", "rigid single", "fix r rigid single: which spheres are one body is not"),
        ("rigid molecule", "rigid molecule infile r.txt", r"masses of its own \(infile\); give"),
        ("rigid molecule", "rigid molecule\nfix s clumps rigid molecule", "several fix rigid"),
        ("rigid molecule", "rigid custom i_body", "x.atoms, line 9, .* no column i_body among"),
        ("r clumps", "r all", "a mol of 0, which is one more body to fix rigid; make single"),
    ],
)
def test_bodies_that_a_dump_does_not_tell_are_refused(tmp_path, old, new, said):
    atoms, log = paired(tmp_path)
    log.write_text(log.read_text().replace(old, new))
    with pytest.raises(InputError, match=said):
        modal.read(atoms, log=log)
    with pytest.raises(InputError, match="spheres of one mol may be one rigid body or"):
        modal.read(atoms, pair=program_files.PAIR)
    atoms.write_text(atoms.read_text().replace("mol", "vx"))
    with pytest.raises(InputError, match="--bodies: no fix rigid is known; give the log"):
        modal.read(atoms, pair=program_files.PAIR, bodies=log)
