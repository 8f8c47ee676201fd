"""Packings of two tables: each row is a contact, rounding is told, what cannot be is refused."""

from __future__ import annotations

import gzip
import re
import warnings

import numpy as np
import program_files
import pytest
from program_files import imported, refused, respelt, sorted_ends

import modal
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, read_network

FILE = "out.network.h5"


@pytest.fixture(scope="module")
def mixture():
    """200 spheres of two sizes at 100 kPa, overlaps some 4e-4 of a radius, one below 1e-9 m."""
    return modal.random_packing(200, 1e5, seed=17, aspect=1.5, sizes=("two", 2, 0.5))


def rewritten(path, change, first=1):
    """Change the words of each row of a table below its `first` lines."""
    lines = path.read_text().splitlines()
    rows = [",".join(change(line.split(","))) for line in lines[first:]]
    path.write_text("\n".join([*lines[:first], *rows]) + "\n")


def rounded(digits):
    """A row of spheres whose positions have so many digits."""
    return lambda words: [
        words[0],
        *(f"{float(word):.{digits}g}" for word in words[1:4]),
        *words[4:],
    ]


def tables(network, folder, columns=4):
    """Two tables, of contacts so many columns: 4 without forces, 5 with normal ones."""
    spheres, contacts = program_files.tables(network, folder)
    rewritten(contacts, lambda words: words[:columns], 0)
    return spheres, "--contacts", contacts, "-o", folder / FILE


@pytest.mark.parametrize("columns", [4, 5])
@pytest.mark.parametrize(("digits", "error"), [(7, 1e-5), (5, 1e-3), (4, 1e-2)])
def test_rounded_positions_lose_no_contact(tmp_path, capsys, mixture, columns, digits, error):
    """An angle of normals is the error of positions over a branch; frequencies follow it.

    Steps of 10^(-1 - digits) m over branches of 2.5e-3 m turn normals by 2e-6, 2e-4 and 2e-3 rad.
    """
    files = tables(mixture, tmp_path, columns)
    rewritten(files[0], rounded(digits), 4)
    told = imported(capsys, *files)
    assert told["contacts"] == mixture.n_contacts
    assert any(f"positions have {digits} digits" in remark for remark in told["remarks"])
    assert any("listed contacts have gaps" in remark for remark in told["remarks"])
    found = modal.eigenmodes(read_network(files[-1]), all=True).frequency
    want = modal.eigenmodes(mixture, all=True).frequency
    firm = want > 1.0
    assert (firm == (found > 1.0)).all()
    np.testing.assert_allclose(found[firm], want[firm], rtol=error)


def test_three_digits_are_refused(tmp_path, capsys, mixture):
    """Steps of 0.1 mm turn normals by 0.02 rad, frequencies by 2 %."""
    files = tables(mixture, tmp_path)
    rewritten(files[0], rounded(3), 4)
    error = refused(capsys, *files)
    assert "positions have 3 digits" in error and "write 17 digits" in error


def test_whole_digits_are_not_remarked_on(tmp_path, capsys, mixture):
    (shape,) = imported(capsys, *tables(mixture, tmp_path))["remarks"]
    assert "diameters wide" in shape


def test_column_whose_spheres_just_touch(tmp_path, capsys):
    """Without overlap and force, positions of two digits: a chain of masses between fixed ends.

    omega = 2 sqrt(k/m) sin(pi r / (2 (n + 1))), exact.
    """
    n, R, kn, mass = 9, 1e-3, 1e6, 1e-5
    spheres, contacts = tmp_path / "s.csv", tmp_path / "c.csv"
    rows = [f"{k},0,0,{(2 * k + 1) / 1000},{R},{mass}" for k in range(n)]
    head = f"# cell -.001 .001 -.001 .001 0 {2 * n / 1000}\nid,x,y,z,radius,mass\n"
    spheres.write_text(head + "\n".join(rows) + "\n")
    ends = [(0, SOURCE_WALL), *((k, k + 1) for k in range(n - 1)), (n - 1, RECEIVER_WALL)]
    rows = [f"{i},{j},{kn},8e5,0,0,0,0" for i, j in ends]
    contacts.write_text("i,j,kn,kt,fn,ftx,fty,ftz\n" + "\n".join(rows) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        told = imported(capsys, spheres, "--contacts", contacts, "-o", tmp_path / FILE)
    assert told["contacts"] == n + 1
    said = "fn is 0 in all listed contacts: kept, as springs without a force"
    assert said in told["remarks"] and not any("digits" in line for line in told["remarks"])
    found = modal.eigenmodes(modal.read(str(tmp_path / FILE)), all=True).frequency
    chain = np.sqrt(kn / mass) / np.pi * np.sin(np.pi * np.arange(1, n + 1) / (2 * (n + 1)))
    assert all(np.isclose(found, f, rtol=1e-9).any() for f in chain)


def test_contact_without_a_force_keeps_its_stiffness(tmp_path, capsys, mixture):
    files = tables(mixture, tmp_path, 5)
    respelt(files[2], 7, 4, "0", ",")
    told = imported(capsys, *files)
    found = read_network(files[-1])
    a, b = sorted_ends(mixture), sorted_ends(found)
    np.testing.assert_array_equal(found.stiffness_normal[b], mixture.stiffness_normal[a])
    assert any(f"fn is 0 in 1 of {mixture.n_contacts} listed" in line for line in told["remarks"])
    # N/mm beside N are still told apart.
    rewritten(files[2], lambda w: [*w[:2], *(repr(1e-3 * float(x)) for x in w[2:4]), w[4]])
    assert "stiffnesses in N/m" in refused(capsys, *files)


@pytest.mark.parametrize(
    "line", ["# periodic X Y", "# periodic: x y", "# Periodic x y", "#PERIODIC = Y x,,,"]
)
def test_periods_are_understood(tmp_path, capsys, mixture, line):
    files = tables(mixture, tmp_path)
    comments = f"{line}\n# made by a program of 2024, step 4000\n# time 0.25 s\n# seed 12\n##\n"
    files[0].write_text(files[0].read_text().replace("# periodic x y\n", comments))
    assert imported(capsys, *files)["contacts"] == mixture.n_contacts
    assert read_network(files[-1]).cell_periodic.tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("# periodic 1 1 0", r"spheres.csv, line 2: '1' is no axis; write # periodic x y"),
        ("# periodic yes yes no", r"spheres.csv, line 2: 'yes' is no axis"),
        ("# periodic xy", r"spheres.csv, line 2: 'xy' is no axis"),
        ("# walls 0", r"spheres.csv, line \d: .*walls.*; write # walls ZLOW ZHIGH"),
        ("# periodic x y\n# periodic x", r"spheres.csv, line 3: # periodic again \(line 2\)"),
        ("# peridoic x y", r"contacts.csv, line \d+: .* not touch, .*; .* with the cell's periods"),
        ("", r"contacts.csv, line \d+: spheres \d+ and \d+ do not touch, there are"),
    ],
)
def test_periods_and_walls_are_not_guessed(tmp_path, capsys, mixture, line, said):
    files = tables(mixture, tmp_path)
    text = files[0].read_text().replace("# periodic x y\n", line + "\n" * bool(line))
    if line == "# walls 0":
        text = re.sub("# walls [^\n]* [^\n]*\n", "", text)
    files[0].write_text(text)
    error = refused(capsys, *files)
    assert re.search(said, error), error


@pytest.mark.parametrize(
    ("table", "line", "column", "text", "said"),
    [
        ("spheres", 9, 0, "14.5", r"spheres.csv, line 9, column id: 14.5 is no whole number"),
        ("spheres", 9, 0, "-1", r"spheres.csv, line 9, column id: id -1 is negative"),
        ("contacts", 9, 0, "14.5", r"contacts.csv, line 9, column i: 14.5 is no whole number"),
        ("contacts", 9, 1, "-1.5", r"contacts.csv, line 9, column j: -1.5 is no whole number"),
        (
            "contacts",
            9,
            slice(0, 2),
            ["12", "12"],
            r"contacts.csv, line 9: a contact of sphere 12 ",
        ),
        (
            "spheres",
            9,
            slice(1, 4),
            "of another",
            r"contacts.csv, line \d+: spheres (14 and|\d+ and 14)",
        ),
        ("contacts", 9, 3, "\x1b[31m" * 99, r"line 9, column kt: '\\x1b\[31m[^\n]{,250} is no num"),
    ],
)
def test_rows_that_cannot_be_are_refused_by_line(
    tmp_path, capsys, mixture, table, line, column, text, said
):
    """Without a warning of numpy before the one line."""
    files = tables(mixture, tmp_path)
    path = {"spheres": files[0], "contacts": files[2]}[table]
    if text == "of another":
        near = next(
            c
            for c in range(mixture.n_contacts)
            if 4 in (mixture.particle_i[c], mixture.particle_j[c]) and mixture.particle_j[c] >= 0
        )
        other = int(mixture.particle_i[near] + mixture.particle_j[near] - 4)
        text = [repr(float(x)) for x in mixture.position[other]]
    lines = path.read_text().splitlines()
    words = lines[line - 1].split(",")
    words[column] = text
    lines[line - 1] = ",".join(words)
    path.write_text("\n".join(lines) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        error = refused(capsys, *files)
    assert re.search(said, error), error


@pytest.mark.parametrize(("code", "wall"), [(SOURCE_WALL, "lower"), (RECEIVER_WALL, "upper")])
def test_wall_contacts_of_a_packing_without_walls(tmp_path, capsys, code, wall):
    """Periodic along z, with a sphere within reach of the period's end; and walls that are NULL."""
    made = program_files.packing(True)
    files = tables(made, tmp_path)
    z, low = made.position[:, 2], made.wall_position
    end = low[0] if code == SOURCE_WALL else low[1]
    at = int(np.argmin(abs(abs(z - end) - made.radius)))
    files[2].write_text(files[2].read_text() + f"{at + 10},{code},1e6,1e6\n")
    error = refused(capsys, *files)
    line = made.n_contacts + 2
    said = rf"contacts.csv, line {line}, column j: a contact with the {wall} wall, but the packing"
    assert re.search(said, error), error
    lines = files[0].read_text().splitlines()
    files[0].write_text("\n".join([*lines[:2], "# walls 0 1", *lines[2:]]) + "\n")
    assert "walls beside a period along z" in refused(capsys, *files)
    files[0].write_text("\n".join([lines[0], "# walls NULL NULL", *lines[2:]]) + "\n")
    assert "# walls says NULL" in refused(capsys, *files)


@pytest.mark.parametrize("table", ["spheres", "contacts"])
def test_table_without_rows(tmp_path, capsys, mixture, table):
    files = tables(mixture, tmp_path)
    path = {"spheres": files[0], "contacts": files[2]}[table]
    head = 4 if table == "spheres" else 1
    path.write_text("\n".join(path.read_text().splitlines()[:head]) + "\n")
    error = refused(capsys, *files)
    assert re.search(rf"{table}.csv, line {head + 1}: no rows below the names", error), error


@pytest.mark.parametrize("harm", ["none", "cut off", "spoilt", "no archive"])
@pytest.mark.parametrize("table", ["spheres", "contacts"])
def test_damaged_archives_are_refused(tmp_path, capsys, mixture, table, harm):
    files = list(tables(mixture, tmp_path))
    which = {"spheres": 0, "contacts": 2}[table]
    packed = gzip.compress(files[which].read_bytes())
    files[which] = tmp_path / f"{table}.csv.gz"
    middle = len(packed) // 2
    files[which].write_bytes(
        {
            "none": packed,
            "cut off": packed[:middle],
            "spoilt": packed[:middle] + b"\0" * 99 + packed[middle + 99 :],
            "no archive": b"i,j,kn,kt\n",
        }[harm]
    )
    if harm == "none":
        assert imported(capsys, *files)["contacts"] == mixture.n_contacts
    else:
        error = refused(capsys, *files)
        assert re.search(rf"{table}.csv.gz: .*; the archive is damaged, write it again", error)


@pytest.mark.parametrize("name", ["x.atoms.gz", "x.restart.gz", "log.gz"])
def test_damaged_archives_of_programs_are_refused(tmp_path, capsys, name):
    """A dump, a restart file and a log, which are read in other places."""
    atoms, _, log = program_files.lammps(program_files.packing(True), tmp_path)
    said = b"MercuryDPM 1.0\n" * 99 if "restart" in name else atoms.read_bytes()
    said = gzip.compress(log.read_bytes() if "log" in name else said)
    path = tmp_path / name
    path.write_bytes(said[: len(said) - 20])
    arguments = {"log.gz": [atoms, "--log", path], "x.atoms.gz": [path, "--log", log]}
    error = refused(capsys, *arguments.get(name, [path]), "-o", tmp_path / FILE)
    assert re.search(rf"{name}: .*; the archive is damaged, write it again", error), error


def test_byte_order_marks_are_no_part_of_a_name(tmp_path, capsys, mixture):
    """As Excel writes CSV of UTF-8: before the lines of the cell, and before the names."""
    files = tables(mixture, tmp_path)
    for path in (files[0], files[2]):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert imported(capsys, *files)["contacts"] == mixture.n_contacts


@pytest.mark.parametrize(
    ("head", "said"),
    [
        (
            b"i;j;kn;kt",
            "no column i among 'i;j;kn;kt'; name the columns .*, with commas: i,j,kn,kt",
        ),
        (b'"i","j","kn","kt"', "no column i among"),
        ("i,j,kn,kt".encode("utf-16"), "name the columns in a line of text in UTF-8"),
        (b"\x1b[2J\xff\x00" * 999, r"no column i among '[^\n]{,400}'...; name the columns"),
        (b"i,j,kn,kt,bond\x1b[2J", r"column bond\\x1b\[2J: it is not known, and may change"),
    ],
)
def test_names_of_columns_that_are_not_known(tmp_path, capsys, mixture, head, said):
    files = tables(mixture, tmp_path)
    files[2].write_bytes(files[2].read_bytes().replace(b"i,j,kn,kt", head, 1))
    error = refused(capsys, *files)
    assert re.search(said, error), error
    assert error.strip().isprintable() and len(error) < 600


def test_tables_may_tell_stiffnesses_against_rolling_and_twisting(tmp_path, capsys, mixture):
    """In N m/rad."""
    files = tables(mixture, tmp_path)
    kr, kw = np.random.default_rng(1).uniform(1e-3, 1e-2, (2, mixture.n_contacts))
    lines = files[2].read_text().splitlines()
    rows = [
        f"{line},{float(a)!r},{float(b)!r}" for line, a, b in zip(lines[1:], kr, kw, strict=True)
    ]
    files[2].write_text("\n".join([f"{lines[0]},kr,kw", *rows]) + "\n")
    imported(capsys, *files)
    found = read_network(files[-1])
    order = sorted_ends(mixture), sorted_ends(found)
    for name, wanted in (("stiffness_rolling", kr), ("stiffness_twisting", kw)):
        np.testing.assert_array_equal(getattr(found, name)[order[1]], wanted[order[0]])
