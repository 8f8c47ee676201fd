"""Packings of other programs, as networks: what they say, how exact it is, what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import program_files
import pytest
from packings import contact_matrices
from places import PACKINGS
from program_files import PAIR, imported, refused, respelt, sorted_ends

import modal
from modal.__main__ import main
from modal.exchange.registry import import_packing
from modal.packing.network import read_network
from modal.system.assembly import stiffness_matrix

FILE = "out.network.h5"


@pytest.mark.parametrize("periodic_z", [True, False])
def test_lammps_dump_gives_the_packing_back(tmp_path, capsys, periodic_z):
    """Spheres of radii 1:3 and two densities, walls or none, ids in falling order.

    17 digits keep a float64; overlaps, 1e-5 m and more of positions of 1e-2 m, keep 1e-12.
    """
    made = program_files.packing(periodic_z)
    atoms, contacts, log = program_files.lammps(made, tmp_path)
    out = tmp_path / FILE
    told = imported(capsys, atoms, "--contacts", contacts, "--log", log, "-o", out)
    assert told["contacts"] == made.n_contacts
    assert told["wall_contacts"] == made.with_wall.sum()
    assert told["assumed"] == []
    found = read_network(out)
    a, b = sorted_ends(made), sorted_ends(found)
    for name in ("position", "radius", "mass", "inertia", "wall_position", "cell_size"):
        np.testing.assert_allclose(getattr(found, name), getattr(made, name), rtol=1e-15)
    for name in ("particle_i", "particle_j"):
        np.testing.assert_array_equal(getattr(found, name)[b], getattr(made, name)[a])
    for name in ("stiffness_normal", "stiffness_tangential", "overlap", "force_normal"):
        np.testing.assert_allclose(getattr(found, name)[b], getattr(made, name)[a], rtol=1e-9)
    # Angles are as exact as positions: 1e-18 of 1e-3 m.
    np.testing.assert_allclose(found.normal[b], made.normal[a], atol=1e-12)
    scale = made.force_normal.mean()
    np.testing.assert_allclose(
        found.force_tangential[b], made.force_tangential[a], atol=1e-12 * scale
    )


def test_tables_give_the_packing_back(tmp_path, capsys):
    """Stiffnesses stand in the table, so that any law comes in."""
    made = program_files.packing(False)
    spheres, contacts = program_files.tables(made, tmp_path)
    imported(capsys, spheres, "--contacts", contacts, "-o", tmp_path / FILE)
    found = read_network(tmp_path / FILE)
    a, b = sorted_ends(made), sorted_ends(found)
    for name in ("stiffness_normal", "stiffness_tangential", "force_normal", "force_tangential"):
        np.testing.assert_array_equal(getattr(found, name)[b], getattr(made, name)[a])
    np.testing.assert_array_equal(found.particle_j[b], made.particle_j[a])


def test_six_digits_without_forces_are_refused_with_them_hardly_missed(tmp_path, capsys):
    """Frequencies within 1e-5 of those of the whole file where forces tell the overlaps.

    A force of 6 digits gives an overlap to 2/3 of 5e-7, a stiffness to 2e-7, and its components the
    normal to 5e-7; a position of 6 digits would turn it by 1e-7 m over a branch of 2e-3 m.
    """
    made = modal.random_packing(60, stress=1e5, seed=2)
    frequencies = {}
    for digits in (17, 6):
        folder = tmp_path / str(digits)
        folder.mkdir()
        atoms, contacts, log = program_files.lammps(made, folder, digits)
        told = imported(capsys, atoms, "--contacts", contacts, "--log", log, "-o", folder / FILE)
        assert told["overlaps_from"] == ("positions" if digits == 17 else "forces")
        found = read_network(folder / FILE)
        frequencies[digits] = modal.eigenmodes(found, all=True).frequency
    error = refused(capsys, atoms, "--log", log, "-o", tmp_path / FILE)
    assert re.search(r"positions have 6 digits, .* write (9|10|11) digits or more", error)
    firm = frequencies[17] > 1e3  # floppy modes are zero up to round-off
    np.testing.assert_allclose(frequencies[6][firm], frequencies[17][firm], rtol=1e-5)


def test_law_alone_makes_contacts_and_forces_from_full_digits(tmp_path, capsys):
    """Without dump local: the same contacts, no shear forces, which are absent and not zero."""
    made = program_files.packing(True)
    atoms, _, _ = program_files.lammps(made, tmp_path)
    told = imported(capsys, atoms, "--pair", PAIR, "-o", tmp_path / FILE)
    found = read_network(tmp_path / FILE)
    assert found.force_tangential is None and found.sliding is None
    assert any("no shear forces" in remark for remark in told["remarks"])
    total = made.stiffness_normal.sum()
    assert found.n_contacts == made.n_contacts
    np.testing.assert_allclose(found.stiffness_normal.sum(), total, rtol=1e-9)


@pytest.mark.parametrize("periodic_z", [True, False])
def test_liggghts_gives_the_packing_back(tmp_path, capsys, periodic_z):
    """The 32 nameless columns of pair/gran/local; at primitive walls no forces are told."""
    made = program_files.packing(periodic_z)
    atoms, contacts = program_files.liggghts(made, tmp_path)
    arguments = [atoms, "--contacts", contacts, "--pair", program_files.LIGGGHTS]
    if not periodic_z:
        low, high = made.wall_position.tolist()
        arguments += ["--wall", f"zplane {low!r} {high!r}"]
    told = imported(capsys, *arguments, "-o", tmp_path / FILE)
    found = read_network(tmp_path / FILE)
    a, b = sorted_ends(made), sorted_ends(found)
    for name in ("stiffness_normal", "stiffness_tangential", "force_normal"):
        np.testing.assert_allclose(getattr(found, name)[b], getattr(made, name)[a], rtol=1e-9)
    assert "growing circle" in told["terms_of_the_law_over_springs"] or not periodic_z
    # K of overlaps with 12 digits; this program's contact points lie in the middle of the overlap.
    half = (made.radius[made.particle_i] - made.overlap / 2)[:, None] * made.normal
    back = (made.overlap / 2 - made.radius[made.partner])[:, None] * made.normal
    back[made.with_wall] = 0
    K, wanted = (
        stiffness_matrix(each) for each in (found, replace(made, lever_i=half, lever_j=back))
    )
    assert abs(K - wanted).max() < 1e-9 * abs(wanted).max()
    if periodic_z:
        scale = 1e-12 * made.force_normal.mean()
        shear = found.force_tangential[b]
        np.testing.assert_allclose(shear, made.force_tangential[a], atol=scale)
    else:
        assert found.force_tangential is None
    for old, new, said in (
        ("model hertz", "model hooke", "only model hertz"),
        ("0.2 coeff", "0.2 cohesion sjkr coeff", "cohesion is resisted by no spring"),
        ("youngsModulus 6e10 ", "", "no youngsModulus"),
    ):
        arguments[4] = program_files.LIGGGHTS.replace(old, new)
        assert said in refused(capsys, *arguments, "-o", tmp_path / FILE)


def test_cgs_is_the_same_packing(tmp_path, capsys):
    """Lengths in cm, masses in g, forces in dyn and Young's modulus in dyn/cm^2."""
    made = program_files.packing(True)
    atoms, contacts, log = program_files.lammps(made, tmp_path)
    imported(capsys, atoms, "--contacts", contacts, "--log", log, "-o", tmp_path / FILE)
    want = read_network(tmp_path / FILE)
    factors = {atoms: (1, 1, 1e2, 1e2, 1e2, 1e2, 1e3), contacts: (1, 1, 1, *[1e5] * 7)}
    for path, factor in factors.items():
        lines = path.read_text().splitlines()
        for k, line in enumerate(lines):
            words = line.split()
            if 5 <= k < 8:
                lines[k] = " ".join(repr(1e2 * float(word)) for word in words)
            elif k > 8:
                numbers = [float(w) * f for w, f in zip(words, factor, strict=True)]
                lines[k] = " ".join(repr(x) if x != int(x) else str(int(x)) for x in numbers)
        path.write_text("\n".join(lines) + "\n")
    log.write_text(log.read_text().replace("units si", "units cgs").replace("6e10", "6e11"))
    imported(capsys, atoms, "--contacts", contacts, "--log", log, "-o", tmp_path / FILE)
    found = read_network(tmp_path / FILE)
    for name in ("mass", "stiffness_normal", "stiffness_tangential", "force_normal"):
        np.testing.assert_allclose(getattr(found, name), getattr(want, name), rtol=1e-9)


def named(atoms: Path, units: str) -> None:
    """Let a dump name its units, as with `dump_modify ... units yes`."""
    atoms.write_text(f"ITEM: UNITS\n{units}\n{atoms.read_text()}")


def tilted(atoms: Path, tilts: str) -> None:
    """Let a dump tell of a triclinic box with these three tilts."""
    lines = atoms.read_text().replace("BOUNDS", "BOUNDS xy xz yz").splitlines()
    lines[5:8] = [f"{line} {tilt}" for line, tilt in zip(lines[5:8], tilts.split(), strict=True)]
    atoms.write_text("\n".join(lines) + "\n")


def test_units_of_the_dump_are_used(tmp_path, capsys):
    """Lengths of micrometres are told by the dump alone; other scales beside it are refused."""
    atoms, *_ = program_files.lammps(program_files.packing(True), tmp_path)
    pair = PAIR.replace("6e10", "6e7")  # 6e10 Pa in pg / (um us^2)
    named(atoms, "micro")
    told = imported(capsys, atoms, "--pair", pair, "-o", tmp_path / FILE)
    assert told["assumed"] == []
    made, found = program_files.packing(True), read_network(tmp_path / FILE)
    np.testing.assert_allclose(found.radius, 1e-6 * made.radius, rtol=1e-12)
    np.testing.assert_allclose(found.mass, 1e-15 * made.mass, rtol=1e-12)
    scales = ("--scales", "1", "1", "1")
    error = refused(capsys, atoms, "--pair", PAIR, *scales, "-o", tmp_path / FILE)
    assert "x.atoms: ITEM: UNITS micro, and --scales 1 1 1; leave --scales out" in error


def test_a_triclinic_box_without_tilt_is_the_rectangular_one(tmp_path, capsys):
    """And a log that prints one stress alone has no stress to compare with."""
    atoms, _, log = program_files.lammps(program_files.packing(True), tmp_path)
    told = imported(capsys, atoms, "--log", log, "-o", tmp_path / FILE)
    tilted(atoms, "0 0.0 -0")
    log.write_text(log.read_text() + "   Step          Pxx      \n         7   1e5\n")
    again = imported(capsys, atoms, "--log", log, "-o", tmp_path / FILE)
    assert all(again[name] == told[name] for name in ("contacts", "law"))
    assert "printed_stress_pa" not in again


@pytest.mark.parametrize("program", ["lammps", "mercury", "tables"])
def test_import_remarks_on_what_info_remarks_on(program, tmp_path, capsys):
    made = program_files.packing(False)
    if program == "lammps":
        atoms, contacts, log = program_files.lammps(made, tmp_path)
        given = (atoms, "--contacts", contacts, "--log", log)
    elif program == "mercury":
        given = (PACKINGS / "mercury_CubicPacking.restart",)
    else:
        spheres, contacts = program_files.tables(made, tmp_path)
        given = (spheres, "--contacts", contacts)
    told = imported(capsys, *given, "-o", tmp_path / FILE)["remarks"]
    assert main(["info", str(tmp_path / FILE), "--json"]) == 0
    wanted = json.loads(capsys.readouterr().out)["remarks"]
    assert any("not in balance" in remark for remark in wanted)
    assert set(wanted) <= set(told)


def spoilt(what: str, atoms: Path, contacts: Path, log: Path) -> None:
    """Do to the files of a packing what users do."""
    text = log.read_text()
    lines = contacts.read_text().splitlines()
    match what:
        case "no radius":
            atoms.write_text(atoms.read_text().replace("radius", "vx"))
        case "no number":
            respelt(atoms, 14, 3, "1.2e")
        case "not finite":
            respelt(contacts, 12, 4, "nan")
        case "short row":
            atoms.write_text(atoms.read_text().rsplit(" ", 3)[0] + "\n")
        case "cut off":
            contacts.write_text("\n".join(lines[:-3]) + "\n")
        case "twice":
            words = lines[15].split()
            words[1:3] = lines[10].split()[2:0:-1]
            lines[15] = " ".join(words)
            contacts.write_text("\n".join(lines) + "\n")
        case "ghosts":
            respelt(atoms, 20, 0, "60")
        case "unknown sphere":
            respelt(contacts, 13, 2, "777")
        case "triclinic":
            tilted(atoms, "0 1e-4 0")
        case "ellipsoids":
            atoms.write_text(atoms.read_text().replace("mass", "mass shapex", 1))
        case "other units":
            named(atoms, "cgs")
        case "several times":
            atoms.write_text(atoms.read_text() + atoms.read_text().replace("\n7\n", "\n8\n", 1))
        case "cohesion":
            log.write_text(text.replace("hertz/material 6e10 0 0.2", "jkr 6e10 0 0.2 1"))
        case "rolling":
            log.write_text(text.replace("0.3\n", "0.3 rolling coulomb 1 1 1\n"))
        case "unknown law":
            log.write_text(text.replace("pair_style granular", "pair_style gran/shm/history 1 2"))
        case "clumps":
            log.write_text(text + "fix r all rigid/small molecule\n")
        case "GPa":
            log.write_text(text.replace("6e10", "60"))
        case "softer":
            log.write_text(text.replace("6e10", "6e7"))
        case "lj":
            log.write_text(text.replace("units si", "units lj"))
        case "no units":
            log.write_text(text.replace("units si", ""))
        case "no title":
            atoms.write_text(re.sub("ITEM: ATOMS.*", "ITEM: ", atoms.read_text()))
        case "wall":
            log.write_text(text.replace("zplane", "xplane"))
        case "outside":
            respelt(atoms, 16, 4, "1.5")
        case "wrong order":
            kept = atoms.read_text()
            atoms.write_text(contacts.read_text())
            contacts.write_text(kept)
        case "nameless":
            text = re.sub(r"compute .*\n(radius\n)?", "", text)
            log.write_text(text)


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("no radius", r"x.atoms, line 9, column radius: no column radius.*; add radius"),
        ("no number", r"x.atoms, line 14, column y: '1.2e' is no number"),
        ("not finite", r"x.contacts, line 12, column c_f\[2\]: nan"),
        ("short row", r"x.atoms, line 69, column f_w\[2\]: has 8 columns"),
        ("cut off", r"x.contacts, line \d+: \d+ rows of \d+: the file ends in the middle"),
        ("twice", r"x.contacts, line 16: the contact of line 11 again; list each contact once"),
        ("ghosts", r"x.atoms, line 20, column id: sphere 60 again .line 10.; .*ghosts"),
        ("unknown sphere", r"x.contacts, line 13, column c_p\[2\]: sphere 777 is not among"),
        ("triclinic", r"x.atoms, line 9: the cell is triclinic"),
        ("ellipsoids", r"x.atoms, line 9, column shapex: .*bodies that are no spheres, which are"),
        (
            "other units",
            r"x.atoms: ITEM: UNITS cgs, and .*log.lammps has units si; give the log of",
        ),
        ("several times", r"x.atoms: it has 2 times \(7, 8\); choose one with --step"),
        ("cohesion", r"log.lammps: jkr is cohesive"),
        ("rolling", r"log.lammps: rolling 'coulomb' is not known"),
        ("unknown law", r"log.lammps: gran/shm/history is not known"),
        ("clumps", r"x.atoms, line 9, column mol: no column mol among"),
        ("GPa", r"log.lammps: Young's modulus 60 Pa is that of no material; write it in Pa"),
        ("softer", r"x.atoms: the law makes overlaps of .*; give stiffnesses, forces and lengths"),
        ("lj", r"log.lammps: units lj .*--scales"),
        ("no title", r"x.atoms, line 9: ITEM: without a name"),
        ("no units", r"log.lammps: units lj .*--scales"),
        ("wall", r"fix w wall/gran: xplane is not known"),
        ("outside", r"x.atoms: sphere 54 lies outside the cell along z"),
        ("wrong order", r"x.atoms, line 9: ITEM: ENTRIES where spheres"),
        ("nameless", r"x.contacts, line 9, column c_p\[1\]: what the 2 columns of c_p mean"),
    ],
)
def test_lammps_is_refused_by_file_line_and_column(tmp_path, capsys, what, said):
    files = program_files.lammps(program_files.packing(False), tmp_path)
    spoilt(what, *files)
    atoms, contacts, log = files
    arguments = (atoms, "--contacts", contacts, "--log", log, "-o", tmp_path / FILE)
    error = refused(capsys, *arguments)
    assert re.search(said, error), error
    assert not (tmp_path / FILE).exists()


def emptied(path: Path) -> Path:
    """The same dump without its rows."""
    lines = path.read_text().splitlines()[:9]
    empty = path.with_name(f"empty.{path.name}")
    empty.write_text("\n".join([*lines[:3], "0", *lines[4:]]) + "\n")
    return empty


@pytest.mark.parametrize("program", ["lammps", "liggghts"])
@pytest.mark.parametrize("what", ["contacts", "spheres"])
def test_files_without_a_row_are_refused_by_name(tmp_path, capsys, program, what):
    made = program_files.packing(True)
    spheres, contacts, *log = getattr(program_files, program)(made, tmp_path)
    law = {"lammps": ["--log", *log], "liggghts": ["--pair", program_files.LIGGGHTS]}
    if what == "contacts":
        contacts = emptied(contacts)
    else:
        spheres = emptied(spheres)
    given = (spheres, "--contacts", contacts, *law[program], "-o", tmp_path / FILE)
    error = refused(capsys, *given)
    if what == "spheres":
        assert f"{spheres}: no spheres; dump those of the packing" in error
    else:
        assert re.search(
            rf"{contacts.name}.*: no two spheres touch.*; dump a packing under stress", error
        )


def test_step_chooses_one_time_of_a_dump(tmp_path, capsys):
    made = program_files.packing(True)
    atoms, _, _ = program_files.lammps(made, tmp_path)
    first = atoms.read_text()
    atoms.write_text(first + first.replace("\n7\n", "\n8\n", 1).replace(" 1 0", " 1 0"))
    told = imported(capsys, atoms, "--pair", PAIR, "--step", "8", "-o", tmp_path / FILE)
    assert told["contacts"] == made.n_contacts
    error = refused(capsys, atoms, "--pair", PAIR, "--step", "9", "-o", tmp_path / FILE)
    assert "no step 9, but 7, 8" in error


@pytest.mark.parametrize(
    ("table", "line", "column", "text", "said"),
    [
        (
            "contacts",
            5,
            0,
            "9999",
            r"contacts.csv, line 5, column i: sphere 9999 is not among the spheres",
        ),
        ("contacts", 1, 2, "stiff", r"contacts.csv, line 1, column kn: no column kn among"),
        (
            "contacts",
            1,
            4,
            "rolling",
            r"contacts.csv, line 1, column rolling: it is not known, and may",
        ),
        ("spheres", 6, 0, "10", r"spheres.csv, line 6, column id: sphere 10 again \(line 5\)"),
        ("spheres", 9, 4, "-1e-3", r"spheres.csv: sphere 14 has radius <= 0"),
        ("spheres", 9, slice(None), "", r"spheres.csv, line 9: an empty line between the rows"),
        ("spheres", 1, 0, "# cell 0 1", r"spheres.csv, line 1: no bounds of the cell"),
        ("contacts", 7, 3, "inf", r"contacts.csv, line 7, column kt: inf is no finite number"),
        ("contacts", 9, 4, "-2", r"contacts.csv, line 9, column fn: -2 pulls; write compression"),
        ("spheres", 9, 3, "1e-9", r"contacts.csv, line \d+: sphere.* 14 .*do not touch, there are"),
    ],
)
def test_tables_are_refused_by_line(tmp_path, capsys, table, line, column, text, said):
    files = dict(
        zip(
            ("spheres", "contacts"),
            program_files.tables(program_files.packing(False), tmp_path),
            strict=True,
        )
    )
    respelt(files[table], line, column, text, ",")
    error = refused(
        capsys, files["spheres"], "--contacts", files["contacts"], "-o", tmp_path / FILE
    )
    assert re.search(said, error), error


def test_tables_in_other_units_are_refused(tmp_path, capsys):
    """Stiffnesses in N/mm beside forces in N."""
    spheres, contacts = program_files.tables(program_files.packing(False), tmp_path)
    head, *rows = contacts.read_text().splitlines()
    rows = [row.split(",") for row in rows]
    for row in rows:
        row[2:4] = [repr(1e-3 * float(word)) for word in row[2:4]]
    contacts.write_text("\n".join([head, *(",".join(row) for row in rows)]) + "\n")
    error = refused(capsys, spheres, "--contacts", contacts, "-o", tmp_path / FILE)
    assert "force" in error and "N/m" in error, error


def test_masses_in_other_units_are_remarked(tmp_path, capsys):
    """Grams beside metres: of no solid, said at once and not only by `info`."""
    spheres, contacts = program_files.tables(program_files.packing(False), tmp_path)
    lines = spheres.read_text().splitlines()
    rows = [line.split(",") for line in lines[4:]]
    rows = [",".join([*row[:5], repr(1e3 * float(row[5]))]) for row in rows]
    spheres.write_text("\n".join([*lines[:4], *rows]) + "\n")
    told = imported(capsys, spheres, "--contacts", contacts, "-o", tmp_path / FILE)
    assert any("density of no solid" in remark for remark in told["remarks"])


def test_narrow_period_is_refused(tmp_path, capsys):
    """Within two diameters a sphere may touch another one and its image."""
    atoms, _, _ = program_files.lammps(modal.fcc(cells=(2, 4, 6)), tmp_path)
    error = refused(capsys, atoms, "--pair", PAIR, "-o", tmp_path / FILE)
    assert "period along x" in error and "take a wider cell" in error


def test_law_tangent_without_its_own_terms_is_the_springs_matrix(tmp_path):
    """And with the terms that YADE's law shares, all but the twist, its full tangent."""
    made = program_files.packing(False)
    atoms, contacts, log = program_files.lammps(made, tmp_path)
    found = import_packing(atoms, contacts=contacts, log=log)
    network = found.network
    scale = abs(contact_matrices(network)).max()
    springs = contact_matrices(network, ())
    np.testing.assert_allclose(springs, contact_matrices(network), atol=1e-12 * scale)
    shared = contact_matrices(network, ("normal force", "shear force"))
    full = contact_matrices(network, "full")
    # The twist acts in the columns of rotations alone: those of displacements are equal.
    for columns in (slice(0, 3), slice(6, 9)):
        np.testing.assert_allclose(shared[:, :, columns], full[:, :, columns], atol=1e-12 * scale)
    assert abs(shared - full).max() > 1e-9 * scale
