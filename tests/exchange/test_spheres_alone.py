"""Spheres alone with a typed law: the same packing as from the program that knows its contacts."""

import numpy as np
import packings
import program_files
import pytest
from refusals import refusal

import modal
from modal.exchange.registry import import_packing

LAW = "granular hertz/material 6e10 0 0.2 tangential mindlin/force NULL 0 0.3"
"""Law of `packings.polydisperse` in LAMMPS' words."""
SAME = "particle_i particle_j normal stiffness_normal stiffness_tangential force_normal overlap"


@pytest.fixture(scope="module")
def walled():
    return packings.polydisperse(False)


@pytest.fixture(scope="module")
def periodic():
    return packings.polydisperse(True)


def spheres_table(path, network, header="x,y,z,r", scale=1.0, size=1.0, before=""):
    """Write centres and radii in another unit of length, under any header."""
    table = np.column_stack([network.position * scale, network.radius * scale * size])
    separator = "," if "," in header else None
    text = program_files.lines(table, by=separator or " ")
    path.write_text(f"{before}{header}\n{text}")
    return path


def cell_lines(network, scale=1.0):
    size = network.cell_size * scale
    axes = " ".join(axis for axis, on in zip("xyz", network.cell_periodic, strict=True) if on)
    low, high = network.wall_position * scale
    walls = "" if network.cell_periodic[2] else f"# walls {low:.17g} {high:.17g}\n"
    bounds = f"0 {size[0]:.17g} 0 {size[1]:.17g} {low:.17g} {high:.17g}"
    return f"# cell {bounds}\n# periodic {axes}\n{walls}"


def test_arrays_have_the_contacts_and_stiffnesses_of_the_law(walled, periodic):
    """Compare with the packings' own stiffnesses, which other code computed by the same law."""
    for network in (walled, periodic):
        walls = None if network.cell_periodic[2] else network.wall_position
        imported = modal.from_spheres(
            network.position, network.radius, cell=network.cell_size, walls=walls, law=LAW
        )
        program_files.assert_same_contacts(imported, network, SAME, 1e-9)


def test_lever_arms_of_lammps_differ_by_words_alone(periodic):
    """Leave out `granular`, and walls that are None."""
    options = {"cell": periodic.cell_size, "walls": (None, np.nan)}
    first = modal.from_spheres(periodic.position, periodic.radius, law=LAW, **options)
    second = modal.from_spheres(
        periodic.position, periodic.radius, law=LAW.removeprefix("granular "), **options
    )
    assert first.fingerprint == second.fingerprint


@pytest.mark.parametrize(
    ("header", "scale", "size"),
    [
        ("x,y,z,r", 1.0, 1.0),
        ("x (mm),y (mm),z (mm),radius (mm)", 1e3, 1.0),
        ("x [um],y,z,diameter", 1e6, 2.0),
        ("Points:0,Points:1,Points:2,d_cm", 1e2, 2.0),
        ("# x y z r", 1.0, 1.0),
        ("#format x_y_z_r", 1.0, 1.0),
    ],
)
def test_headers_and_units(tmp_path, walled, header, scale, size):
    path = tmp_path / "spheres.txt"
    spheres_table(path, walled, header, scale, size, cell_lines(walled, scale))
    imported = import_packing(path, pair=LAW, density=2230.0).network
    assert imported.n_contacts == walled.n_contacts
    np.testing.assert_allclose(imported.radius, walled.radius, rtol=1e-12)
    program_files.assert_same_contacts(imported, walled, "stiffness_normal force_normal", 1e-9)


def test_frequencies_scale_as_the_root_of_the_modulus(periodic):
    """Multiply E: K has it as a factor, so each frequency grows as sqrt(E)."""
    laws = (LAW, LAW.replace("6e10", "2.4e11"))
    frequencies = []
    for law in laws:
        network = modal.from_spheres(
            periodic.position, periodic.radius, cell=periodic.cell_size, law=law
        )
        frequencies.append(modal.eigenmodes(network, highest=3).frequency)
    np.testing.assert_allclose(frequencies[1], 2 * frequencies[0], rtol=1e-9)


def test_cell_and_walls_typed_beside_a_table(tmp_path, capsys, walled):
    path = spheres_table(tmp_path / "spheres.csv", walled)
    low, high = walled.wall_position
    side = walled.cell_size
    files = program_files.PackingFiles(
        capsys,
        path,
        {
            "pair": LAW,
            "wall": f"zplane {low:.17g} {high:.17g}",
            "cell": (0, side[0], 0, side[1], low, high),
            "periodic": "xy",
        },
    )
    summary = files.imported()
    assert summary["contacts"] == walled.n_contacts
    assert summary["wall_contacts"] == walled.with_wall.sum()
    # Without any cell no contact passes through a period.
    bare = files.imported(wall=None, cell=None, periodic=None)
    assert bare["contacts"] == (~walled.periods.any(axis=1) & ~walled.with_wall).sum()


def test_refusals(tmp_path, capsys, walled):
    path = spheres_table(tmp_path / "spheres.csv", walled)
    files = program_files.PackingFiles(capsys, path, {"pair": LAW})
    files.refused("no_law", "--pair", pair=None)
    files.refused("no_stress", "--stress", tolerance=1e-5)
    files.refused("stress", stress=-1e5)
    files.refused("no_cell", "--cell", periodic="xy")
    files.refused("unknown_law", pair="spring 1e5")
    spheres_table(path, walled, scale=1e3)
    files.refused("unit_of_length", "mm")
    assert files.imported(scales=(1e-3, 1, 1), stress=None)["spheres"] == walled.n_particles
    spheres_table(path, walled, "x (mm),y,z,r (um)")
    files.refused("unit_of_length", "mm", "um")
    spheres_table(path, walled, "x (inch),y,z,r")
    files.refused("unit_of_length", "inch")
    spheres_table(path, walled, "x,y,z,size")
    files.refused("no_column", "radius")


def test_arrays_that_are_no_spheres_are_refused(walled):
    position = walled.position
    radius = walled.radius
    for code, arguments in {
        "shape": (position[:, :2], radius),
        "not_finite": (position * np.nan, radius),
        "no_contacts": (position, 0.1 * radius),
        "not_positive": (position, -radius),
    }.items():
        with refusal(code):
            modal.from_spheres(*arguments)
    with refusal("shape"):
        modal.from_spheres(position, radius[:3])


def test_dmt_of_lammps_is_hertz_less_its_attraction():
    """Compare with 4/3 E* sqrt(R*) d^1.5 - 4 pi gamma R*; its kn is Hertz's at the same overlap."""
    radius = 1e-3
    overlap = 2e-7
    position = np.array([[0.0, 0, 0], [2 * radius - overlap, 0, 0]])
    law = "granular {} tangential mindlin NULL 0 0.3"
    sticky = modal.from_spheres(position, [radius] * 2, law=law.format("dmt 6e10 0 0.2 0.5"))
    smooth = modal.from_spheres(position, [radius] * 2, law=law.format("hertz/material 6e10 0 0.2"))
    effective = radius / 2
    young = 6e10 / (2 * (1 - 0.2**2))
    hertz = 4 / 3 * young * np.sqrt(effective) * overlap**1.5
    # The overlap is a difference of positions: eps times 2 R over it, 2e-12.
    assert sticky.force_normal == pytest.approx([hertz - 4 * np.pi * 0.5 * effective], rel=1e-10)
    assert sticky.force_normal[0] < smooth.force_normal[0]
    assert sticky.stiffness_normal == pytest.approx(smooth.stiffness_normal, rel=1e-12)
    with refusal("not_positive"):
        modal.from_spheres(position, [radius] * 2, law=law.format("dmt 6e10 0 0.2 -1"))
