"""Packings of two tables: each row is a contact, rounding is told, what cannot be is refused."""

from __future__ import annotations

import gzip
import warnings

import numpy as np
import packings
import pytest
from program_files import PackingFiles, assert_same_contacts, sorted_ends

import modal
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, read_network


@pytest.fixture
def tables(write_files, mixture):
    """Write two tables; 4 columns of contacts have no forces, 5 have normal ones."""

    def make(columns=4, digits=17) -> PackingFiles:
        files = write_files("tables", mixture)
        files.rewrite("contacts", lambda words: words[:columns], 0)
        if digits < 17:
            files.rewrite("spheres", lambda words: rounded(words, digits), 4)
        return files

    return make


def rounded(words: list[str], digits: int) -> list[str]:
    """Return a row of spheres whose places, some centimetres, have this many digits."""
    return [words[0], *(f"{float(word):.{digits + 1}f}" for word in words[1:4]), *words[4:]]


@pytest.mark.parametrize(
    ("columns", "digits", "error"), [(4, 7, 1e-5), (5, 7, 1e-5), (4, 5, 1e-3), (5, 4, 1e-2)]
)
def test_rounded_positions_lose_no_contact(tables, mixture, columns, digits, error):
    """Compare frequencies within the angles by which rounding turns normals.

    Steps of 10^(-1 - digits) m over branches of 2.5e-3 m turn normals by 2e-6, 2e-4 and 2e-3 rad.
    """
    files = tables(columns, digits)
    summary = files.imported()
    assert summary["contacts"] == mixture.n_contacts
    read = read_network(files.out)
    off = (read.overlap[sorted_ends(read)] - mixture.overlap[sorted_ends(mixture)]).std()
    # Of some hundred distances, of which those to walls have one end.
    overlap_in_errors = np.median(read.overlap) / off
    assert summary["overlap_over_error_of_digits"] == pytest.approx(overlap_in_errors, rel=0.2)
    frequency = modal.eigenmodes(read, all=True).frequency
    expected = modal.eigenmodes(mixture, all=True).frequency
    firm = expected > 1.0
    assert (firm == (frequency > 1.0)).all()
    np.testing.assert_allclose(frequency[firm], expected[firm], rtol=error)


def test_few_digits_are_refused_and_all_not_remarked_on(tables):
    """Refuse steps of 0.1 mm, which turn normals by 0.02 rad and change frequencies by 2 %."""
    tables(digits=3).refused("few_digits", "3 digits", "4 digits")
    (shape,) = tables().imported()["remarks"]
    assert "diameters wide" in shape


def test_column_whose_spheres_just_touch(tmp_path, capsys):
    """Compare with a chain of masses between fixed ends, without overlap and force.

    omega = 2 sqrt(k/m) sin(pi r / (2 (n + 1))), exact.
    """
    n = 9
    R = 1e-3
    kn = 1e6
    mass = 1e-5
    files = PackingFiles(capsys, tmp_path / "s.csv", {"contacts": tmp_path / "c.csv"})
    rows = [f"{k},0,0,{(2 * k + 1) / 1000},{R},{mass}" for k in range(n)]
    head = f"# cell -.001 .001 -.001 .001 0 {2 * n / 1000}\nid,x,y,z,radius,mass\n"
    files.spheres.write_text(head + "\n".join(rows) + "\n")
    ends = [(0, SOURCE_WALL), *((k, k + 1) for k in range(n - 1)), (n - 1, RECEIVER_WALL)]
    rows = [f"{i},{j},{kn},8e5,0,0,0,0" for i, j in ends]
    files.contacts.write_text("i,j,kn,kt,fn,ftx,fty,ftz\n" + "\n".join(rows) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        summary = files.imported()
    assert summary["contacts"] == n + 1
    frequency = modal.eigenmodes(read_network(files.out), all=True).frequency
    chain = np.sqrt(kn / mass) / np.pi * np.sin(np.pi * np.arange(1, n + 1) / (2 * (n + 1)))
    assert all(np.isclose(frequency, f, rtol=1e-9).any() for f in chain)


def test_units_and_contacts_without_a_force(tables, mixture):
    """Keep the stiffness of a contact without force; notice N/mm beside N, and g beside m."""
    files = tables(5)
    files.respell("contacts", 7, 4, "0")
    assert_same_contacts(files.network(), mixture, "stiffness_normal")
    files.rewrite("contacts", lambda w: [*w[:2], *(f"{k}e-3" for k in w[2:4]), w[4]], 1)
    files.refused("force_ratio", "contacts.csv:")
    files = tables()
    files.rewrite("spheres", lambda w: [*w[:5], repr(1e3 * float(w[5]))], 4)
    assert any("density of no solid" in line for line in files.imported()["remarks"])


@pytest.mark.parametrize("line", ["# periodic: x y", "#PERIODIC = Y x,,,"])
def test_periods_are_understood(tables, line):
    files = tables()
    comments = f"{line}\n# made by a program of 2024, step 4000\n# time 0.25 s\n# seed 12\n##\n"
    files.spoil("spheres", "# periodic x y\n", comments)
    assert files.network().cell_periodic.tolist() == [True, True, False]


@pytest.mark.parametrize(("code", "wall"), [(SOURCE_WALL, "lower"), (RECEIVER_WALL, "upper")])
def test_wall_contacts_of_a_packing_without_walls(write_files, code, wall):
    """Refuse wall contacts of a packing that is periodic along z, or whose walls are NULL."""
    packing = packings.polydisperse(True)
    files = write_files("tables", packing)
    end = packing.wall_position[0 if code == SOURCE_WALL else 1]
    sphere = int(np.argmin(abs(abs(packing.position[:, 2] - end) - packing.radius)))
    files.spoil("contacts", r"\Z", f"{sphere + 10},{code},1e6,1e6,1,0,0,0\n")
    line = packing.n_contacts + 2
    place = f"contacts.csv, line {line}, column j:"
    files.refused("no_wall", place, wall)
    files.respell("spheres", 2, slice(99, 99), ["\n# walls 0 1"])
    files.refused("wall_in_period", "spheres.csv, line 3:")
    files.spoil("spheres", "# periodic.*\n.*", "# walls NULL NULL")
    files.refused("no_wall", place, "NULL")


def test_packed_tables_are_read_and_damaged_archives_refused(tables, mixture):
    files = tables()
    plain = files.spheres, files.contacts
    files.spheres, files.options["contacts"] = (path.with_suffix(".csv.gz") for path in plain)
    files.contacts.write_bytes(gzip.compress(plain[1].read_bytes()))
    for table, path in zip(plain, (files.spheres, files.contacts), strict=True):
        packed = gzip.compress(table.read_bytes())
        middle = len(packed) // 2
        spoilt = packed[:middle] + b"\0" * 99 + packed[middle + 99 :]
        for harmed in (packed[:middle], spoilt, b"i,j,kn,kt\n"):
            path.write_bytes(harmed)
            files.refused("damaged_archive", f"{path.name}:")
        path.write_bytes(packed)
    assert files.imported()["contacts"] == mixture.n_contacts


def test_byte_order_marks_are_no_part_of_a_name(tables, mixture):
    """Skip byte order marks, which Excel writes before the first line."""
    files = tables()
    for path in (files.spheres, files.contacts):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert files.imported()["contacts"] == mixture.n_contacts


def test_tables_may_tell_stiffnesses_against_rolling_and_twisting(tables, mixture):
    """Read columns in N m/rad."""
    files = tables()
    rows = np.random.default_rng(1).uniform(1e-3, 1e-2, (mixture.n_contacts, 2))
    texts = [["kr", "kw"], *([repr(float(x)) for x in row] for row in rows)]
    files.rewrite("contacts", lambda words: [*words, *texts.pop(0)], 0)
    expected = mixture.unchecked(stiffness_rolling=rows[:, 0], stiffness_twisting=rows[:, 1])
    assert_same_contacts(files.network(), expected, "stiffness_rolling stiffness_twisting")


@pytest.mark.parametrize(
    ("columns", "code"),
    [
        (["kr"], "no_column"),
        (["kw"], "no_column"),
        (["kr", "kw", "kr"], "repeated_column"),
        (["kn"], "repeated_column"),
    ],
)
def test_columns_that_would_be_left_out_without_a_word_are_refused(tables, columns, code):
    """Refuse one stiffness of a pair, and a second column of a name."""
    files = tables()
    heads = [columns]
    files.rewrite(
        "contacts", lambda words: [*words, *(heads.pop() if heads else ["1"] * len(columns))], 0
    )
    files.refused(code, "contacts.csv, line 1")


def test_shear_forces_have_three_components(tables):
    files = tables(5)
    heads = [["ftx", "fty"]]
    files.rewrite("contacts", lambda words: [*words, *(heads.pop() if heads else ["0", "0"])], 0)
    files.refused("no_column", "contacts.csv, line 1", "ftz")
