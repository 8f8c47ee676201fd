"""Restart files of MercuryDPM, of both ages, as networks; what is refused in them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from places import PACKINGS
from program_files import imported, refused

import modal
from modal.packing.network_file import read_network

FILE = "out.network.h5"


def test_mercury_gives_the_frequencies_of_its_chains(tmp_path, capsys):
    """CubicPackingSelfTest: 25 columns of five spheres on a floor, springs of one stiffness.

    A chain of n masses, fixed at one end: 2 sqrt(k / m) sin((2 j - 1) pi / (4 n + 2)) / (2 pi).
    """
    file = PACKINGS / "mercury_CubicPacking.restart"
    told = imported(capsys, file, "-o", tmp_path / FILE)
    assert (told["spheres"], told["contacts"], told["wall_contacts"]) == (125, 125, 25)
    frequency = modal.eigenmodes(read_network(tmp_path / FILE), all=True).frequency
    k, m, n = 75857.5125578386, 1 / 1.00000000895498, 5
    exact = np.sqrt(k / m) / np.pi * np.sin((2 * np.arange(1, n + 1) - 1) * np.pi / (4 * n + 2))
    np.testing.assert_allclose(exact[[0, -1]], [12.4766965, 84.1184433], rtol=1e-8)
    np.testing.assert_allclose(frequency[-125:], np.repeat(exact, 25), rtol=1e-8)


def test_mercury_of_the_older_format(tmp_path, capsys):
    """restart_version 2 lists numbers without names; two spheres on a floor, springs as above."""
    file = tmp_path / "old.restart"
    overlap = 1e-3
    file.write_text(
        "restart_version 2\nname two\nxmin 0 xmax 5 ymin 0 ymax 5 zmin 0 zmax 3\n"
        "Species 1\nk 2000 disp 25 kt 500 dispt 25 mu 0.5 rho 1.9098593 dim_particle 3\n"
        "Walls 1\nnumFiniteWalls 0 normal 0 0 -1 position 0\n"
        "WallsPeriodic 2\nnormal 1 0 0 pos_left 0 pos_right 5 shift 5 0 0\n"
        "normal 0 1 0 pos_left 0 pos_right 5 shift 0 5 0\nParticles 2\n"
        f"1 1 {0.5 - overlap!r} 0 0 0 0.5 0 0 0 0 0 0 1 10 0\n"
        f"1 1.000000000001 {1.5 - 2 * overlap!r} 0 0 0 0.5 0 0 0 0 0 0 1 10 1 1e-5 0 0 0 -1 25\n"
    )
    imported(capsys, file, "-o", tmp_path / FILE)
    found = read_network(tmp_path / FILE)
    assert found.particle_j.tolist() == [-1, 1]
    np.testing.assert_allclose(found.force_normal, 2000 * overlap, rtol=1e-9)
    assert found.cell_periodic.tolist() == [True, True, False]
    frequency = modal.eigenmodes(found, all=True).frequency
    longitudinal = np.sqrt(2000 * (3 + np.array([-1, 1]) * np.sqrt(5)) / 2) / (2 * np.pi)
    for each in longitudinal:
        assert abs(frequency / each - 1).min() < 1e-8
    file.write_text(file.read_text().replace("shift 5 0 0", "shift 5 0 1"))
    assert "line 9: the period is angled" in refused(capsys, file, "-o", tmp_path / FILE)


def old_box(tmp_path: Path, walls: str, z: str = "0.499 1.497") -> Path:
    """Two spheres of radius 0.5 on each other at x = 0.5 between these walls, y with 13 digits."""
    file = tmp_path / "box.restart"
    lines = walls.splitlines()
    particles = "".join(
        f"0.5 2.500000000001 {each} 0 0 0 0.5 0 0 0 0 0 0 1 10 0\n" for each in z.split()
    )
    file.write_text(
        "restart_version 2\nname two\nxmin 0 xmax 1 ymin 0 ymax 5 zmin 0 zmax 2\n"
        "Species 1\nk 2000 disp 25 kt 500 dispt 25 mu 0.5 rho 1.9098593 dim_particle 3\n"
        f"Walls {len(lines)}\n"
        + "".join(f"numFiniteWalls 0 normal {line}\n" for line in lines)
        + f"WallsPeriodic 0\nParticles 2\n{particles}"
    )
    return file


ENDS = "0 0 -1 position 0\n0 0 1 position 1.996\n"


@pytest.mark.parametrize(
    ("walls", "said"),
    [
        ("-1 0 0 position -0.005\n1 0 0 position 0.995\n", "particle 0: a contact with wall 2, w"),
        ("-2 0 0 position -0.005\n", "particle 0: a contact with wall 2, which is not flat at low"),
        (
            "0 1 0 position 2.9\n",
            "a contact with wall 2, .*; a network knows these two walls alone",
        ),
        ("0 0.6 0.8 position 1.5\n", "a contact with wall 2, which is not flat"),
        ("0 0 -1 position -0.0005\n", "particle 0: .* wall 0, beside wall 2, both at low z; "),
        ("0 0 1 position 1.9965\n", "particle 1: .* wall 2, beside wall 1, both at high z; "),
        ("0 0 0 position 0\n", "line 9: a wall without a direction"),
    ],
)
def test_walls_that_a_network_has_not_are_refused_where_they_are_touched(
    tmp_path, capsys, walls, said
):
    """Contacts follow from the positions there; overlaps with the floor and ceiling of 0.001."""
    error = refused(capsys, old_box(tmp_path, ENDS + walls), "-o", tmp_path / FILE)
    assert re.search(said, error), error


def test_walls_that_no_sphere_touches_are_left_out(tmp_path, capsys):
    """Lateral ones just at the spheres' surfaces, a second floor below, and the floor last."""
    aside = "-1 0 0 position 0\n1 0 0 position 1\n0 0 -1 position 0.3\n0 0 1 position 2.1\n"
    imported(capsys, old_box(tmp_path, aside + ENDS), "-o", tmp_path / FILE)
    found = read_network(tmp_path / FILE)
    assert sorted(found.particle_j.tolist()) == [-2, -1, 1]
    assert found.wall_position.tolist() == [0.0, 1.996]
    np.testing.assert_allclose(found.force_normal, [2, 4, 2], rtol=1e-9)


def test_finite_walls_without_listed_contacts_are_refused(tmp_path, capsys):
    """Nothing tells whether a sphere touches them."""
    file = mercury(tmp_path, "InfiniteWall", "TriangleWall")
    before, listed, _ = file.read_text().partition("Interactions")
    assert listed
    file.write_text(before)
    error = refused(capsys, file, "-o", tmp_path / FILE)
    assert "wall 0, TriangleWall, do not follow from positions; write" in error


def mercury(tmp_path: Path, old: str, new: str) -> Path:
    path = tmp_path / "spoilt.restart"
    text = (PACKINGS / "mercury_CubicPacking.restart").read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("LinearViscoelasticSpecies", "LinearPlasticViscoelasticSpecies", "line 12: .*hysteretic"),
        ("LinearViscoelasticSpecies", "LinearViscoelasticBondedSpecies", "line 12: .*bonded"),
        ("stiffness 75857.5", "stiffness x75857.5", "line 12: stiffness x.* is no number"),
        ("Boundaries 0", "Boundaries 1\nAngledPeriodicBoundary normal 1 0 0", "line 21: .*angled"),
        ("particleWallIds 120 4", "particleWallIds 120 0", "line 173: a contact with wall 0"),
        ("particleIds 115 116", "particleIds 120 121", "line 149: the contact of line 148 again"),
        ("particleIds 120 121", "particleIds 120 900", "line 148: particle 900 is not"),
        ("BaseParticle id 1 ", "MultiParticle id 1 ", "line 23: MultiParticle is no sphere"),
        ("invMass 1.00000000895498", "invMass 0", "line 22: a fixed particle"),
    ],
)
def test_mercury_is_refused_by_line(tmp_path, capsys, old, new, said):
    error = refused(capsys, mercury(tmp_path, old, new), "-o", tmp_path / FILE)
    assert re.search(said, error), error


@pytest.mark.parametrize(
    "lines, said",
    [
        (15, "2 Walls of 6"),
        (64, "43 Particles of 125"),
        (220, "73 Interactions of 125"),
    ],
)
def test_mercury_that_ends_early_is_refused(tmp_path, capsys, lines, said):
    """By the numbers that each section announces: what is left would be a smaller packing."""
    whole = (PACKINGS / "mercury_CubicPacking.restart").read_text().splitlines(keepends=True)
    part = tmp_path / "part.restart"
    part.write_text("".join(whole[:lines]))
    error = refused(capsys, part, "-o", tmp_path / FILE)
    assert said in error and "ends early" in error


def test_older_mercury_that_ends_early_is_refused(tmp_path, capsys):
    whole = old_box(tmp_path, ENDS).read_text().splitlines(keepends=True)
    part = tmp_path / "part.restart"
    part.write_text("".join(whole[:-1]))
    error = refused(capsys, part, "-o", tmp_path / FILE)
    assert "fewer than announced" in error
