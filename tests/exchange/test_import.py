"""Packings of other programs, as networks: what they say, how exact it is, what is refused."""

from __future__ import annotations

import numpy as np
import packings
import program_files
import pytest
from oracles import asymmetry
from program_files import PAIR, assert_same_contacts, of_law

import modal
from modal.__main__ import main
from modal.modes.eigenmodes import eigenmodes
from modal.modes.first_order import shift_by_law
from modal.packing.network import read_network, write_network
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.operator import ContactOperator
from modal.tools.errors import UnavailableError

STIFFNESSES = "stiffness_normal stiffness_tangential force_normal"


@pytest.mark.parametrize("periodic_z", [True, False])
def test_lammps_dump_gives_the_packing_back(write_files, periodic_z):
    """Import spheres of radii 1:3 and two densities, with and without walls.

    17 digits keep a float64; overlaps, 1e-5 m and more of positions of 1e-2 m, keep 1e-12.
    """
    packing = packings.polydisperse(periodic_z)
    files = write_files("lammps", packing)
    summary = files.imported()
    assert (summary["contacts"], summary["wall_contacts"]) == (
        packing.n_contacts,
        packing.with_wall.sum(),
    )
    network = read_network(files.out)
    for name in ("position", "radius", "mass", "inertia", "wall_position", "cell_size"):
        np.testing.assert_allclose(getattr(network, name), getattr(packing, name), rtol=1e-15)
    assert_same_contacts(network, packing, "particle_i particle_j")
    assert_same_contacts(network, packing, f"{STIFFNESSES} overlap", 1e-9)
    # Angles are as exact as positions: 1e-18 of 1e-3 m.
    assert_same_contacts(network, packing, "normal force_tangential", 1e-12)
    # A friction that the largest share of it just uses up.
    share = np.linalg.norm(packing.force_tangential, axis=1) / packing.force_normal
    files.spoil("log", r"NULL 0 0\.3", f"NULL 0 {share.max():.17g}", count=0)
    assert_same_contacts(files.network(), packing, "sliding")


def test_tables_give_the_packing_back(write_files):
    """Import stiffnesses, which any law may have."""
    packing = packings.polydisperse(False)
    assert_same_contacts(
        write_files("tables", packing).network(),
        packing,
        f"{STIFFNESSES} force_tangential particle_j",
    )


def test_six_digits_without_forces_blur_overlaps_with_them_they_are_hardly_missed(tmp_path, capsys):
    """Compare frequencies with those of the file in full digits, within 1e-5.

    A force of 6 digits gives an overlap to 2/3 of 5e-7, a stiffness to 2e-7, and its components the
    normal to 5e-7; a position of 6 digits would turn it by 1e-7 m over a branch of 2e-3 m.
    """
    packing = modal.random_packing(60, stress=1e5, seed=2)
    frequencies = {}
    for digits in (17, 6):
        files = program_files.write_packing_files(capsys, tmp_path, "lammps", packing, digits)
        summary = files.imported()
        assert summary["overlaps_from"] == ("positions" if digits == 17 else "forces")
        frequencies[digits] = modal.eigenmodes(read_network(files.out), all=True).frequency
    # Steps of 1e-8 m, of places around 2e-2 m, leave 4e-9 m of overlaps of some 5e-7 m.
    assert 1e-3 < files.imported(contacts=None)["error_of_overlaps"] < 1e-1
    program_files.write_packing_files(capsys, tmp_path, "lammps", packing, 4)
    assert files.code(contacts=None) == "few_digits"
    firm = frequencies[17] > 1e3  # floppy modes are zero up to round-off
    np.testing.assert_allclose(frequencies[6][firm], frequencies[17][firm], rtol=1e-5)


def test_law_alone_makes_contacts_and_forces_from_full_digits(write_files):
    """Import without dump local: equal contacts; shear forces are absent, not zero.

    Without law and masses one line names both.
    """
    packing = packings.polydisperse(True)
    files = write_files("lammps", packing)
    summary = files.imported(contacts=None, log=None, pair=PAIR)
    network = read_network(files.out)
    assert {"force_tangential", "sliding"} <= {*summary["absent"]}
    assert network.sliding is None
    assert_same_contacts(network, packing, f"particle_i particle_j {STIFFNESSES}", 1e-9)
    files.spoil("spheres", " mass", " density")
    mass = packing.mass * 4 / 3 * np.pi * packing.radius**3
    np.testing.assert_allclose(files.network(contacts=None, log=None, pair=PAIR).mass, mass)
    files.spoil("spheres", " density", " other")
    files.refused("no_law", "no column mass", "--log", "--pair", "add mass", log=None)


def test_units_of_the_dump_are_used(write_files):
    """Import lengths in micrometres and moduli in pg / (um us^2); refuse other scales beside them.

    Hertz' forces go with the square of lengths, and 1e-9 N are their unit; stiffnesses as lengths.
    """
    packing = packings.polydisperse(True)
    files = write_files("lammps", packing)
    files.rewrite("contacts", lambda w: [*w[:3], *(repr(1e-3 * float(x)) for x in w[3:])], 9)
    files.options = {"pair": PAIR.replace("6e10", "6e7"), "contacts": files.contacts}
    files.spoil("spheres", r"\A", "ITEM: UNITS\nmicro\n")
    files.spoil("contacts", "c_f.*", "force p1 p2 p3 fx fy fz")
    files.spoil("contacts", r"c_p\[1\] c_p\[2\]", "patom1 patom2")
    assert not any("units" in remark for remark in files.imported()["remarks"])
    network = read_network(files.out)
    units = {"radius": 1e-6, "mass": 1e-15, "stiffness_normal": 1e-6, "stiffness_tangential": 1e-6}
    units |= {"force_normal": 1e-12, "force_tangential": 1e-12}
    expected = packing.unchecked(
        **{name: unit * getattr(packing, name) for name, unit in units.items()}
    )
    np.testing.assert_allclose(network.radius, expected.radius, rtol=1e-12)
    np.testing.assert_allclose(network.mass, expected.mass, rtol=1e-12)
    assert_same_contacts(network, expected, f"{STIFFNESSES} force_tangential", 1e-9)
    files.refused("other_units", "x.atoms:", "micro", "--scales 1 1 1", scales=(1, 1, 1))


def test_a_triclinic_box_without_tilt_is_the_rectangular_one(write_files):
    files = write_files("lammps")
    summary = files.imported(contacts=None)
    files.spoil("spheres", "BOUNDS", "BOUNDS xy xz yz")
    for line, tilt in ((6, "0"), (7, "0.0"), (8, "-0")):
        files.respell("spheres", line, slice(2, 2), [tilt])
    again = files.imported(contacts=None)
    assert all(again[name] == summary[name] for name in ("contacts", "law"))
    files.spoil("spheres", "xy xz yz", "abc origin")
    files.refused("triclinic_cell", "x.atoms, line 9:")


@pytest.mark.parametrize("columns", ["x y z", "xs ys zs"])
def test_a_triclinic_box_of_the_same_periods_is_the_same_packing(write_files, columns):
    """Describe the same packing by the periods a, a + b and c - b instead of a, b and c."""
    files = write_files("lammps")
    expected = files.network(contacts=None)
    side = float(expected.cell_size[0])
    edges = side * np.array([[1, 0, 0], [1, 1, 0], [0, -1, 1]])
    lines = files.spheres.read_text().splitlines()
    lines[4] = lines[4].replace("BOUNDS", "BOUNDS xy xz yz")
    # The smallest rectangular box around the cell, and the tilts xy, xz, yz.
    lines[5:8] = [f"0 {2 * side!r} {side!r}", f"{-side!r} {side!r} 0", f"0 {side!r} {-side!r}"]
    if columns == "xs ys zs":
        lines[8] = lines[8].replace("x y z", columns)
        for row in range(9, len(lines)):
            words = lines[row].split()
            place = np.linalg.solve(edges.T, np.array(words[2:5], float))
            lines[row] = " ".join([*words[:2], *map(repr, place.tolist()), *words[5:]])
    files.spheres.write_text("\n".join(lines) + "\n")
    network = files.network(contacts=None)
    np.testing.assert_allclose(network.cell_vectors, edges)
    assert network.n_contacts == expected.n_contacts
    difference = abs(stiffness_matrix(network) - stiffness_matrix(expected)).max()
    # Overlaps of a thousandth of a radius, and stiffnesses with them, are known to 1e-12.
    assert difference < 1e-10 * abs(stiffness_matrix(expected)).max()
    with_contacts = files.network()
    assert with_contacts.n_contacts == expected.n_contacts
    np.testing.assert_allclose(
        modal.count_modes(with_contacts, 1e5), modal.count_modes(expected, 1e5)
    )


def test_step_chooses_one_time_of_a_dump(write_files):
    files = write_files("lammps")
    first = files.spheres.read_text()
    files.spheres.write_text(first + first.replace("\n7\n", "\n8\n", 1))
    files.options = {"pair": PAIR}
    assert files.imported(step=8)["contacts"] == packings.polydisperse(True).n_contacts
    files.refused("no_such_time", "(7, 8)", "step 9", step=9)


def test_places_in_parts_of_the_box_are_places(write_files):
    """Import columns xs, ys, zs, as `dump atom` of LAMMPS has them, to a few eps of the box.

    Of a box far from the origin; steps are those of doubles between 1/2 and 1, in parts of it.
    """
    packing = packings.polydisperse(True)
    files = write_files("lammps", packing)
    lines = files.spheres.read_text().splitlines(keepends=True)
    low, high = np.loadtxt(lines[5:8]).T
    rows = np.loadtxt(lines[9:])
    rows[:, 2:5] = (rows[:, 2:5] - low) / (high - low)
    shift = 3 * high
    lines[5:8] = program_files.lines(zip(low + shift, high + shift, strict=True)).splitlines(True)
    lines[8] = lines[8].replace(" x y z ", " xs ys zs ")
    files.spheres.write_text("".join(lines[:9]) + program_files.lines(rows))
    overlap_in_errors = files.imported()["overlap_over_error_of_digits"]
    network = read_network(files.out)
    assert overlap_in_errors == pytest.approx(
        2**53 * np.sqrt(6) * np.median(network.overlap) / high.max()
    )
    np.testing.assert_allclose(network.position, packing.position + shift, rtol=1e-15)
    assert_same_contacts(network, packing, f"particle_i particle_j {STIFFNESSES}", 1e-9)


def test_narrow_period_is_refused(write_files):
    """Refuse a period of two diameters, in which a sphere may touch another one and its image."""
    files = write_files("lammps", modal.fcc(cells=(2, 4, 6)))
    files.refused("narrow_cell", "along x", contacts=None)


def test_operator_is_the_matrix_of_the_law_and_survives_a_file(tmp_path):
    write_network(tmp_path / "x.network.h5", of_law())
    network = read_network(tmp_path / "x.network.h5")
    K = stiffness_matrix(network, pre_stress="law")
    u = np.random.default_rng(1).standard_normal((K.shape[0], 3))
    product = ContactOperator(network, pre_stress="law").apply(u)
    np.testing.assert_allclose(product, K @ u, atol=1e-13 * abs(K @ u).max())
    # It is not symmetric: the shear forces of the made packing are a tenth of the normal ones.
    assert asymmetry(K) > 1e-3 > asymmetry(stiffness_matrix(network, pre_stress="full"))


def test_law_is_refused_where_the_network_does_not_know_it(tmp_path, one_line):
    network = packings.polydisperse(False)
    with pytest.raises(UnavailableError) as refused:
        stiffness_matrix(network, pre_stress="law")
    assert refused.value.code == "unknown_column"
    write_network(tmp_path / "x.network.h5", network)
    wave = ["wave", tmp_path / "x.network.h5", "--pre-stress", "law"]
    one_line(main, wave, "contacts/shear_growth", code="unknown_column")


def test_shift_of_modes_is_the_law_to_first_order():
    """Compare with all eigenvalues of the tangent, which is not symmetric, at two forces.

    The error is of second order: a quarter at half the difference. Rigid, well separated modes.
    """
    network = of_law()
    modes = eigenmodes(network, all=True)
    scale = np.sqrt(np.outer(*[mass_diagonal(network)] * 2))
    tangent = stiffness_matrix(network, pre_stress="law").toarray() / scale
    springs = stiffness_matrix(network, pre_stress="none").toarray() / scale
    errors = []
    for share in (0.02, 0.01):
        weak = springs + share * (tangent - springs)
        exact = np.sort(np.sqrt(np.maximum(np.linalg.eigvals(weak).real, 0))) / (2 * np.pi)
        shifted_squares = modes.frequency**2 + share * (
            (modes.frequency + shift_by_law(network, modes)) ** 2 - modes.frequency**2
        )
        shifted = np.sort(np.sqrt(shifted_squares))
        firm = slice(len(exact) // 2, None)
        errors.append(np.linalg.norm((shifted - exact)[firm] / exact[firm]))
        assert errors[-1] < 0.05 * np.linalg.norm((modes.frequency - exact)[firm] / exact[firm])
    assert 3 < errors[0] / errors[1] < 5
