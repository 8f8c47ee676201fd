"""Restart files of MercuryDPM as networks; what is refused in them."""

from __future__ import annotations

import re

import numpy as np
import packings
import pytest
from mercury_files import (
    ENDS,
    RADIUS,
    mercury_forces,
    two_spheres,
    words,
    write_mindlin,
)
from places import ROOT
from program_files import misfit
from refusals import refusal

import modal
from modal.exchange.registry import import_packing
from modal.packing.network import read_network
from modal.system.assembly import stiffness_matrix
from modal.system.contacts import TANGENTS


def test_mercury_gives_the_frequencies_of_its_chains(cubic):
    """Compare 25 columns of five spheres on a floor, with springs of one stiffness.

    A chain of n masses, fixed at one end: 2 sqrt(k / m) sin((2 j - 1) pi / (4 n + 2)) / (2 pi).
    """
    summary = cubic.imported()
    assert (summary["spheres"], summary["contacts"], summary["wall_contacts"]) == (125, 125, 25)
    frequency = modal.eigenmodes(read_network(cubic.out), all=True).frequency
    k = 75857.5125578386
    m = 1 / 1.00000000895498
    n = 5
    exact = np.sqrt(k / m) / np.pi * np.sin((2 * np.arange(1, n + 1) - 1) * np.pi / (4 * n + 2))
    np.testing.assert_allclose(exact[[0, -1]], [12.4766965, 84.1184433], rtol=1e-8)
    np.testing.assert_allclose(frequency[-125:], np.repeat(exact, 25), rtol=1e-8)


def test_version_1_0_is_read_as_the_next_ones(cubic, tmp_path):
    """It begins as old files do, has normals of walls, and no contact points."""
    text = cubic.spheres.read_text()
    text = re.sub(r"^MercuryDPM 1.0 name (\w+).*", r"restart_version 1.0 name \1", text)
    text = re.sub(r" contactPoint \S+ \S+ \S+", "", text)
    normals = iter(["-1 0 0", "1 0 0", "0 -1 0", "0 1 0", "0 0 -1", "0 0 1"])

    def with_normal(match):
        return f"orientation 0 0 0 0 {match[1]} normal {next(normals)}"

    wall = re.compile(r"orientation \S+ \S+ \S+ \S+ (.*torque 0 0 0)$", re.MULTILINE)
    text = wall.sub(with_normal, text, count=6)
    path = tmp_path / "old.restart"
    path.write_text(text)
    old = import_packing(path).network
    new = import_packing(cubic.spheres).network
    assert old.n_contacts == new.n_contacts == 125
    np.testing.assert_array_equal(old.force_normal, new.force_normal)
    np.testing.assert_array_equal(old.study["gravity"], [0, 0, -1])


def test_stiffness_of_mindlin_is_that_of_mercurys_forces(tmp_path):
    """Compare with central differences over 1e-10 m, whose error is 1e-10 and less.

    Round-off of forces, 1e-16 of 1e3 N over 1e-10 m, is 1e-9 of stiffnesses of 1e6 N/m.
    """
    packing = packings.polydisperse(False, 40)
    file, spring = write_mindlin(packing, tmp_path)
    result = import_packing(file)
    # A step of a rotation moves the surface of a sphere of 1 mm as far as one of a translation.
    arc = np.tile([1.0] * 3 + [1e3] * 3, packing.n_particles)
    spheres = [*range(0, 40, 10), *packing.particle_i[packing.with_wall][[0, -1]]]
    columns = np.concatenate([6 * k + np.arange(6) for k in spheres])
    expected = np.empty((arc.size, columns.size))
    for column, k in zip(expected.T, columns, strict=True):
        motions = np.zeros((2, arc.size))
        motions[:, k] = 1e-10 * arc[k], -1e-10 * arc[k]
        ahead, behind = (
            mercury_forces(packing, spring, motion.reshape(-1, 6))[1] for motion in motions
        )
        column[:] = (behind - ahead).ravel() / (2e-10 * arc[k])
    assert misfit(result.network, expected, columns, TANGENTS["law"]) < 1e-6


def test_spring_of_mindlin_is_that_of_a_file_of_mercury():
    """Compare with one sphere on a floor, of MercuryDPM 0.14, whose spring bears its force."""
    network = modal.read(ROOT / "tests/data/mercury_mindlin.restart")
    # The overlap of 2.3e-8 m is known to half of 1e-18 m over 1 mm: 1e-9 of its root and less.
    force = network.stiffness_tangential * 5.13696996565198e-09
    np.testing.assert_allclose(force, 3.01592890590078e-05, rtol=1e-8)


@pytest.mark.parametrize(
    ("friction", "static", "slides"), [(0.2, 0.5, 0), (0.2, 0.3, 1), (0, 0.5, 0)]
)
def test_mercury_sticks_up_to_its_static_friction(cubic, friction, static, slides):
    """Shear by 0.32 of the normal force; friction 0 has no shear force, so no spring."""
    cubic.spoil("spheres", "force 0 0 -4.62918369484511", "force 1.5 0 -4.62918369484511")
    law = "LinearViscoelasticSlidingFrictionSpecies slidingStiffness 2e4 slidingDissipation 0 "
    law += f"slidingFrictionCoefficient {friction} slidingFrictionCoefficientStatic {static}"
    cubic.spoil("spheres", "LinearViscoelasticSpecies", law)
    network = cubic.network()
    sheared = network.force_tangential[:, 0] > 1
    assert network.sliding[sheared].tolist() == [bool(slides)]
    assert set(network.stiffness_tangential) == {2e4 if friction else 0.0}


@pytest.mark.parametrize(
    ("wall", "code", "names"),
    [
        ("1 0 0 position 0.995", "other_wall", ["sphere 0", "wall 2"]),
        ("0 0.6 0.8 position 1.5", "other_wall", ["wall 2"]),
        ("0 0 -1 position -0.0005", "other_wall", ["sphere 0", "wall 0"]),
        ("0 0 1 position 1.9965", "other_wall", ["sphere 1", "wall 2"]),
        ("0 0 0 position 0", "no_direction", ["line 9:"]),
    ],
)
def test_walls_that_a_network_has_not_are_refused_where_they_are_touched(
    tmp_path, capsys, wall, code, names
):
    """Refuse walls by positions; overlaps with the floor and the ceiling are 0.001."""
    two_spheres(capsys, tmp_path, f"{ENDS}{wall}\n").refused(code, *names)


def test_walls_that_no_sphere_touches_are_left_out(tmp_path, capsys):
    """Put walls just at the spheres' surfaces, a second floor below, and the floor last."""
    aside = "-1 0 0 position 0\n1 0 0 position 1\n0 0 -1 position 0.3\n0 0 1 position 2.1\n"
    network = two_spheres(capsys, tmp_path, aside + ENDS).network()
    assert sorted(network.particle_j.tolist()) == [-2, -1, 1]
    assert network.wall_position.tolist() == [0.0, 1.996]
    np.testing.assert_allclose(network.force_normal, [2, 4, 2], rtol=1e-9)


def test_a_walls_normal_may_have_any_length(cubic):
    """Turn the walls by quaternions that are ten times as long."""
    expected = cubic.network()
    turned = r"(?m)^(InfiniteWall .*? orientation) (\S+) (\S+) (\S+) (\S+)"
    cubic.spoil("spheres", turned, r"\1 \g<2>e1 \g<3>e1 \g<4>e1 \g<5>e1", 0)
    network = cubic.network()
    assert network.wall_position == pytest.approx(expected.wall_position, rel=1e-12)
    assert np.array_equal(network.particle_j, expected.particle_j)


def test_finite_walls_without_listed_contacts_are_refused(cubic):
    """Refuse them, as nothing shows whether a sphere touches them."""
    cubic.spoil("spheres", "InfiniteWall", "TriangleWall")
    cubic.spoil("spheres", "(?s)Interactions.*", "")
    cubic.refused("other_wall", "wall 0, TriangleWall")


ROLLING = 3e3
TORSION = 7e2
SHEAR_MODULUS = 3e4
LINEAR = (
    "LinearViscoelasticFrictionSpecies id 0 density 1.9 stiffness 2000 dissipation 0 "
    "slidingStiffness 500 slidingDissipation 0 slidingFrictionCoefficient 0.3 "
    f"slidingFrictionCoefficientStatic 0.3 rollingStiffness {ROLLING} rollingDissipation 0 "
    "rollingFrictionCoefficient 0.1 rollingFrictionCoefficientStatic 0.1 "
    f"torsionStiffness {TORSION} torsionDissipation 0 "
    "torsionFrictionCoefficient 0.1 torsionFrictionCoefficientStatic 0.1"
)
MINDLIN = (
    "HertzianViscoelasticMindlinRollingTorsionSpecies id 0 density 1.9 elasticModulus 1e5 "
    f"dissipation 0 shearModulus {SHEAR_MODULUS} slidingFrictionCoefficient 0.3 "
    "rollingFrictionCoefficient 0.1 rollingFrictionCoefficientStatic 0.1 "
    "torsionFrictionCoefficient 0 torsionFrictionCoefficientStatic 0"
)


@pytest.mark.parametrize(("species", "mindlin"), [(LINEAR, False), (MINDLIN, True)])
def test_rolling_and_torsion_store_the_energy_of_mercurys_springs(
    tmp_path, capsys, species, mindlin
):
    """Compare with k |D n x t|^2 / 2 + k' (D n . t)^2 / 2 for turns t, with D = 2 R*.

    Mindlin's k is 8 G a with the circle's radius a. The same without both has the rest.
    """
    energies = []
    random = np.random.default_rng(1)
    motion = random.standard_normal((2, 6))
    without = re.sub(r"((rolling|torsion)FrictionCoefficient\S*) \S+", r"\1 0", species)
    for line in (without, species):
        file = two_spheres(capsys, tmp_path, ENDS)
        file.spoil("spheres", "LinearViscoelasticSpecies.*", line)
        network = file.network()
        energies.append(motion.ravel() @ stiffness_matrix(network) @ motion.ravel() / 2)
    expected = 0.0
    for first, second, effective in ((0, 1, RADIUS / 2), (0, None, RADIUS), (1, None, RADIUS)):
        turn = motion[first, 3:] - (0 if second is None else motion[second, 3:])
        overlap = 0.002 if second == 1 else 0.001
        rolling = ROLLING
        torsion = TORSION
        if mindlin:
            rolling = 8 * SHEAR_MODULUS * np.sqrt(effective * overlap)
            torsion = 0.0
        arcs = 2 * effective * turn
        expected += rolling * (arcs[:2] ** 2).sum() / 2 + torsion * arcs[2] ** 2 / 2
    # Overlaps of 1e-3 are known to 1e-16: to 1e-13 of themselves.
    assert energies[1] - energies[0] == pytest.approx(expected, rel=1e-10)


def test_spheres_may_lie_outside_of_the_domain(tmp_path, capsys):
    """Import a domain that is smaller than two spheres on a floor; compare with their chain."""
    file = two_spheres(capsys, tmp_path, "0 0 -1 position 0\n")
    expected = file.network()
    file.spoil("spheres", "xMin 0 xMax 1 yMin 0 yMax 5 zMin 0 zMax 2", DOMAIN)
    network = file.network()
    assert network.n_contacts == 2
    np.testing.assert_array_equal(network.force_normal, expected.force_normal)
    low, high = network.wall_position
    assert low == 0
    assert high == pytest.approx(1.497 + RADIUS, rel=1e-15)
    along_z = modal.eigenmodes(network, all=True).frequency[-2:]
    exact = np.sqrt(2000) / np.pi * np.sin(np.array([1, 3]) * np.pi / 10)
    np.testing.assert_allclose(along_z, exact, rtol=1e-10)


DOMAIN = "xMin 0.7 xMax 0.8 yMin 0 yMax 5 zMin 0 zMax 1.2"


def test_fixed_particles_are_held(cubic):
    """Fix the second of five spheres in a chain: one below and three above move by themselves."""
    free = cubic.network()
    lowest = np.argmin(free.position.sum(axis=1))
    second = np.argsort(abs(free.position - free.position[lowest] - [0, 0, 1]).sum(axis=1))[0]
    lines = cubic.spheres.read_text().splitlines()
    rows = [k for k, line in enumerate(lines) if "invMass" in line]
    assert len(rows) == free.n_particles
    row = rows[second]
    lines[row] = re.sub("invMass [^ ]+", "invMass 0", lines[row])
    lines[row] = re.sub("invInertia [^ ]+", "invInertia 0", lines[row])
    cubic.spheres.write_text("\n".join(lines) + "\n")
    network = cubic.network()
    assert network.held.tolist() == (np.arange(125) == second).tolist()
    np.testing.assert_allclose(network.mass, free.mass, rtol=1e-7)
    k = 75857.5125578386
    m = 1 / 1.00000000895498
    frequency = modal.eigenmodes(network, all=True).frequency
    assert len(frequency) == 6 * 125 - 6
    chain_omega = 2 * np.sqrt(k / m) * np.sin((2 * np.arange(1, 4) - 1) * np.pi / 14)
    for omega in [np.sqrt(2 * k / m), *chain_omega]:
        assert abs(2 * np.pi * frequency / omega - 1).min() < 1e-8


def cubic_lattice(boundary: str) -> str:
    """Return a restart file of 3 x 3 x 3 spheres that overlap by 1e-3 m, also through periods."""
    text = (
        "MercuryDPM 1.0 name lattice\nxMin 0 xMax 2.997 yMin 0 yMax 2.997 zMin 0 zMax 2.997\n"
        "systemDimensions 3 particleDimensions 3 gravity 0 0 0\nSpecies 1\n"
        "LinearViscoelasticSpecies id 0 density 1.9 stiffness 1e5 dissipation 0\n"
        f"Walls 0\nBoundaries 1\n{boundary}\nParticles 27\n"
    )
    for number, place in enumerate(np.ndindex(3, 3, 3)):
        position = words(0.51234567890123 + 0.999 * np.array(place))
        text += f"BaseParticle id {number} indSpecies 0 position {position} radius 0.5 invMass 1\n"
    return text


CONTROL = (
    "StressStrainControlBoundary id 0 stressGoal 1e3 {} 0 0 1e3 0 0 0 1e3 strainRate 0 0 0 0 0 0 "
    "0 0 0 gainFactor 1e-4 0 0 0 1e-4 0 0 0 1e-4 isStrainRateControlled 1 integratedShift 0"
)


def test_controlled_periods_are_periods_of_the_domain(tmp_path):
    """Count six neighbours of each sphere of a cubic lattice, none of them through a wall."""
    path = tmp_path / "a.restart"
    path.write_text(cubic_lattice(CONTROL.format("0")))
    network = import_packing(path).network
    assert network.cell_periodic.all()
    assert network.n_contacts == 3 * 27


@pytest.mark.parametrize(
    ("boundary", "code"),
    [
        (CONTROL.format("50"), "angled_period"),
        (CONTROL.format("0").replace("strainRate 0 0", "strainRate 0 1"), "angled_period"),
        ("SubcriticalMaserBoundary id 0 normal 1 0 0 distanceLeft 0", "unknown_boundary"),
        ("ConstantMassFlowMaserBoundary id 0 normal 1 0 0", "unknown_boundary"),
    ],
)
def test_boundaries_that_join_spheres_in_other_ways_are_refused(tmp_path, boundary, code):
    path = tmp_path / "a.restart"
    path.write_text(cubic_lattice(boundary))
    with refusal(code):
        import_packing(path)
