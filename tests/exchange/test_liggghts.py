"""LIGGGHTS' own files: a packing that it made, and its forces after spheres were moved.

`examples/packings/ORIGIN.md` says how the files came about. LIGGGHTS is not needed here.
"""

from __future__ import annotations

import numpy as np
import pytest
from places import ROOT
from program_files import assert_same_contacts, misfit

import modal
from modal.packing.network import read_network
from modal.system.contacts import TANGENTS

FOLDER = ROOT / "examples" / "packings" / "liggghts"
ATOMS = FOLDER / "x.atoms"
CONTACTS = FOLDER / "x.contacts"
LOG = FOLDER / "log.liggghts"
PAIR = (
    "gran model hertz tangential history youngsModulus 6e10 poissonsRatio 0.2 "
    "coefficientFriction 0.3"
)


@pytest.fixture
def files(liggghts):
    return liggghts


@pytest.fixture
def network():
    return modal.read(ATOMS, contacts=CONTACTS, log=LOG)


def test_packing_is_at_rest_under_the_forces_of_its_law(network, files):
    """Check the balance, and Hertz' forces of positions in contacts that cross no period.

    The bounds of the cell are rounded to 1e-8 m, a hundredth of an overlap: others show it.
    """
    summary = files.imported()
    assert summary["spheres"] == 125
    assert summary["contacts"] == network.n_contacts == 276
    assert summary["net_force_over_contact_force"] < 1e-11
    assert summary["overlaps_from"] == "forces"
    assert len(summary["law"]) == 3
    assert summary["sliding_share"] == 0
    inside = (network.cell_shift == 0).all(axis=1)
    i = network.particle_i
    j = network.particle_j
    distance = np.linalg.norm(network.position[j] - network.position[i], axis=1)
    overlap = network.radius[i] + network.radius[j] - distance
    np.testing.assert_allclose(network.overlap[inside], overlap[inside], rtol=1e-10)
    assert abs(network.overlap / overlap - 1)[~inside].max() > 1e-3 or (~inside).sum() == 0


def test_stiffness_is_that_of_liggghts(network):
    """Compare with differences of its forces after steps of 1e-10 m of a sphere to both sides.

    Overlaps are 1e-7 m and more: their square leaves 1e-6 of the weakest contacts, 1e-8 of all.
    """
    row, column, value = np.loadtxt(ROOT / "tests" / "data" / "liggghts_differences.txt").T
    row = row.astype(int)
    column = column.astype(int)
    columns = np.unique(column)
    expected = np.zeros((6 * 125, len(columns)))
    expected[row, np.searchsorted(columns, column)] = value
    assert misfit(network, expected, columns, TANGENTS["law"]) < 1e-7
    for term in ("normal force", "shear force", "growing circle"):
        other_terms = tuple(kind for kind in TANGENTS["law"] if kind != term)
        assert misfit(network, expected, columns, other_terms) > 1e-5, term


def rewritten(files, columns, rows, keywords=""):
    """Write contacts in these columns, and a log that names them."""
    head = CONTACTS.read_text().splitlines()[:8]
    head[3] = str(len(rows))
    names = " ".join(f"c_c[{k + 1}]" for k in range(columns))
    lines = [" ".join(f"{number:.17g}" for number in row) for row in rows]
    files.contacts.write_text("\n".join([*head, f"ITEM: ENTRIES {names}", *lines]) + "\n")
    text = LOG.read_text().replace(" id force_normal force_tangential", keywords)
    files.log.write_text(text)


def test_columns_that_nobody_named_are_understood(network, files):
    """Read 25 columns of a bare compute, and split the whole force."""
    listed = np.loadtxt(CONTACTS.read_text().splitlines()[9:])
    rows = np.zeros((len(listed), 25))
    rows[:, 12:14] = listed[:, :2]
    rows[:, 15:18] = listed[:, 3:6] + listed[:, 6:9]
    rewritten(files, 25, rows)
    imported = files.network()
    # Directions of contacts through the periods are as good as the bounds: 1e-8 m of 2e-3 m.
    scale = network.force_normal.mean()
    np.testing.assert_allclose(imported.force_normal, network.force_normal, atol=1e-5 * scale)
    np.testing.assert_allclose(
        imported.force_tangential, network.force_tangential, atol=1e-4 * scale
    )
    rewritten(files, 12, rows[:, :12], " pos vel")
    files.refused("no_column", "x.contacts, line 9, column id1:")
    # All 32, of a version that writes the forces on the second sphere; the law is typed.
    rows = np.zeros((len(listed), 32))
    rows[:, 12:14] = listed[:, :2]
    rows[:, 18:24] = -listed[:, 3:9]
    rewritten(files, 32, rows)
    imported = files.network(log=None, pair=PAIR)
    assert_same_contacts(imported, network, "force_normal force_tangential")
    # Hertz: kn^3 = 6 E*^2 R* N; Mindlin: kt / kn = 2 (1 - nu) / (2 - nu).
    radius_i = network.radius[network.particle_i]
    radius_j = network.radius[network.partner]
    effective = radius_i * radius_j / (radius_i + radius_j)
    modulus = 6e10 / (2 * (1 - 0.2**2))
    expected = np.cbrt(6 * modulus**2 * effective * network.force_normal)
    np.testing.assert_allclose(imported.stiffness_normal, expected, rtol=1e-12)
    np.testing.assert_allclose(imported.stiffness_tangential, 1.6 / 1.8 * expected, rtol=1e-12)


def test_rounded_bounds_without_forces_blur_overlaps(files):
    files.options["contacts"] = None
    assert files.imported()["error_of_overlaps"] > 1e-3
    for line in (6, 7, 8):
        files.respell("spheres", line, slice(9), ["0.0022", "0.0133"])
    assert "error_of_overlaps" not in files.imported()


def test_units_of_the_log_count(network, files):
    """Read the numbers as cm, g and dyn: lengths are a hundredth, forces 1e-5 of those in SI.

    Young's modulus of 6e10 dyn/cm^2 is a tenth of that many Pa, so that Hertz' overlaps in cm stay.
    """
    files.spoil("log", "units si", "units cgs")
    converted = files.network()
    np.testing.assert_allclose(converted.radius, 1e-2 * network.radius, rtol=1e-14)
    np.testing.assert_allclose(converted.force_normal, 1e-5 * network.force_normal, rtol=1e-14)
    np.testing.assert_allclose(
        converted.stiffness_normal, 1e-3 * network.stiffness_normal, rtol=1e-9
    )


def test_walls_are_of_the_type_that_is_said(network, files):
    """Read types from the log's fixes or --wall; without one assume that of each sphere.

    With listed contacts, of those through no period, the walls' follow from the positions.
    """
    rows = np.array([line.split()[4:6] for line in ATOMS.read_text().splitlines()[9:]], float)
    low = float((rows[:, 0] - rows[:, 1]).min() + 1e-6)
    high = float(rows.sum(axis=1).max() - 1e-6)
    files.spoil("spheres", "pp pp pp", "pp pp ff")
    for line in (6, 7, 8):
        files.respell("spheres", line, slice(9), ["0", "0.0133"])
    inside = (network.cell_shift == 0).all(axis=1)
    listed = np.loadtxt(CONTACTS.read_text().splitlines()[9:])[inside]
    rewritten(files, 9, listed, " id force_normal force_tangential")
    fix = "fix {0} all wall/gran model hertz tangential history primitive type {1} zplane {2!r}\n"
    stiff = {}
    for name, commands, wall in (
        ("log", fix.format("up", 2, high) + fix.format("down", 2, low), None),
        ("typed", "", f"type 2 zplane {low!r} {high!r}"),
        ("unsaid", "", f"zplane {low!r} {high!r}"),
    ):
        files.log.write_text(LOG.read_text() + commands)
        listed_network = files.network(wall=wall)
        assert listed_network.force_tangential is None
        assert (~listed_network.with_wall).sum() == inside.sum()
        summary = files.imported(wall=wall, contacts=None)
        alone = read_network(files.out)
        np.testing.assert_array_equal(
            listed_network.stiffness_normal[listed_network.with_wall],
            alone.stiffness_normal[alone.with_wall],
        )
        stiff[name] = listed_network.stiffness_normal[listed_network.with_wall].sum()
        assert summary["wall_contacts"] >= 2
        assert any("material of each sphere" in remark for remark in summary["remarks"]) == (
            name == "unsaid"
        )
    assert stiff["log"] == stiff["typed"] != stiff["unsaid"]
    files.spoil("log", r"\Z", "fix w all wall/gran model hertz mesh n_meshes 1 meshes c\n")
    files.refused("other_wall", "--wall")
