"""Restart files of MercuryDPM as networks; what is refused in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from places import PACKINGS, ROOT
from program_files import Given, misfit, packing

import modal
from modal.exchange.registry import import_packing
from modal.packing.network import SOURCE_WALL, Network, read_network
from modal.system.contacts import TANGENTS

CUBIC = PACKINGS / "mercury_CubicPacking.restart"


def test_mercury_gives_the_frequencies_of_its_chains(cubic):
    """CubicPackingSelfTest: 25 columns of five spheres on a floor, springs of one stiffness.

    A chain of n masses, fixed at one end: 2 sqrt(k / m) sin((2 j - 1) pi / (4 n + 2)) / (2 pi).
    """
    told = cubic.imported()
    assert (told["spheres"], told["contacts"], told["wall_contacts"]) == (125, 125, 25)
    frequency = modal.eigenmodes(read_network(cubic.out), all=True).frequency
    k, m, n = 75857.5125578386, 1 / 1.00000000895498, 5
    exact = np.sqrt(k / m) / np.pi * np.sin((2 * np.arange(1, n + 1) - 1) * np.pi / (4 * n + 2))
    np.testing.assert_allclose(exact[[0, -1]], [12.4766965, 84.1184433], rtol=1e-8)
    np.testing.assert_allclose(frequency[-125:], np.repeat(exact, 25), rtol=1e-8)


SPECIES = {(0, 0): (6e10, 2e10, 0.5), (1, 1): (2e11, 8e10, 0.4), (0, 1): (9.2e10, 3.1e10, 0.6)}
"""Effective elastic modulus and shear modulus, Pa, and friction between two species."""
WALL_SPECIES = 1


def mindlin(network: Network, folder: Path, species: dict = SPECIES) -> tuple[Path, np.ndarray]:
    """A restart file of Hertz-Mindlin between two walls, and its sliding springs (m, 3), m.

    As MercuryDPM 0.14 writes it: even spheres of species 0, odd ones of species 1, its walls, too.
    """
    random = np.random.default_rng(3)
    low, high = network.wall_position.tolist()
    side = network.cell_size.tolist()
    spring = np.cross(network.normal, random.standard_normal((network.n_contacts, 3)))
    spring *= 0.2 * network.overlap[:, None]
    still = np.zeros((network.n_particles, 6))
    force, _ = mercury(network, spring, still, species)
    text = (
        f"MercuryDPM 0.14 name packing\nxMin 0 xMax {side[0]!r} yMin 0 yMax {side[1]!r} "
        f"zMin {low!r} zMax {high!r}\nsystemDimensions 3 particleDimensions 3 gravity 0 0 0\n"
        f"Species {len(species)}\n"
    )
    for (a, b), (elastic, shear, friction) in species.items():
        named = f"Species id {a}" if a == b else f"MixedSpecies idA {b} idB {a}"
        text += (
            f"HertzianViscoelasticMindlin{named} density 2500 elasticModulus {elastic!r} "
            f"dissipation 0 slidingDissipation 0 slidingFrictionCoefficient {friction!r} "
            f"slidingFrictionCoefficientStatic {friction!r} shearModulus {shear!r}\n"
        )
    text += "Walls 2\n"
    for k, (z, sign) in enumerate(((low, 1), (high, -1))):
        text += f"InfiniteWall id {k} indSpecies {WALL_SPECIES} position 0 0 {z!r} "
        text += f"orientation 0.707106781186548 0 {sign * 0.707106781186548!r} 0\n"
    text += "Boundaries 2\n"
    for axis, normal in enumerate(("1 0 0", "0 1 0")):
        shift = " ".join(repr(side[axis]) if word == "1" else "0" for word in normal.split())
        text += f"PeriodicBoundary id {axis} normal {normal} scaleFactor 1 distanceLeft 0 "
        text += f"distanceRight {side[axis]!r} shift {shift}\n"
    text += f"Particles {network.n_particles}\n"
    rows = np.column_stack([network.position, network.radius, 1 / network.mass]).tolist()
    for k, (*place, radius, heavy) in enumerate(rows):
        text += f"BaseParticle id {k} indSpecies {k % 2} position {' '.join(map(repr, place))} "
        text += f"radius {radius!r} invMass {heavy!r}\n"
    text += f"Interactions {network.n_contacts}\n"
    for i, j, vector, lengths in zip(
        network.particle_i, network.particle_j, force.tolist(), spring.tolist(), strict=True
    ):
        ends = f"particleIds {i} {j}" if j >= 0 else f"particleWallIds {i} {-j - 1}"
        text += f"HertzianViscoelasticMindlinInteraction {ends} timeStamp 1 contactPoint 0 0 0 "
        text += f"force {' '.join(map(repr, vector))} torque 0 0 0 "
        text += f"slidingSpring {' '.join(map(repr, lengths))}\n"
    path = folder / "mindlin.restart"
    path.write_text(text)
    return path, spring


def mercury(
    network: Network, spring: np.ndarray, moved: np.ndarray, species: dict = SPECIES
) -> tuple[np.ndarray, np.ndarray]:
    """Force (m, 3) on the first of each contact, and on all spheres force and torque (n, 6).

    After one step in which they have moved and turned by `moved` (n, 6). From MercuryDPM's account
    of its law: normal n from the second to the first, contact point in the middle of the overlap,
    N = 4/3 E a overlap with a = sqrt(R* overlap), sliding spring s that grows by the motion of the
    contact point across n and is turned into the new plane (not at a wall), Ft = -2/3 (8 G a) s.
    """
    forces, on_spheres = [], np.zeros((network.n_particles, 6))
    position, motion, turn = network.position + moved[:, :3], moved[:, :3], moved[:, 3:]
    for c, (p, q) in enumerate(zip(network.particle_i, network.particle_j, strict=True)):
        if q >= 0:
            image = position[q] + network.cell_shift[c] * network.cell_size
            distance, reach = np.linalg.norm(position[p] - image), network.radius[[p, q]].sum()
            normal = (position[p] - image) / distance
            effective = network.radius[p] * network.radius[q] / reach
        else:
            up = 1.0 if q == SOURCE_WALL else -1.0
            distance, reach = abs(position[p, 2] - network.wall_position[-q - 1]), network.radius[p]
            normal, effective, image = np.array([0, 0, up]), reach, None
        overlap = reach - distance
        kinds = (p % 2, q % 2 if q >= 0 else WALL_SPECIES)
        elastic, shear, _ = species[min(kinds), max(kinds)]
        circle = np.sqrt(effective * overlap)
        arm = -(network.radius[p] - overlap / 2) * normal
        slip = motion[p] + np.cross(turn[p], arm)
        stretched = spring[c].copy()
        if q >= 0:
            other = position[p] + arm - image
            slip -= motion[q] + np.cross(turn[q], other)
            stretched -= normal * (spring[c] @ (motion[p] - motion[q])) / distance
        stretched += slip - normal * (normal @ slip)
        force = 4 / 3 * elastic * circle * overlap * normal
        force -= 2 / 3 * 8 * shear * circle * stretched
        forces.append(force)
        on_spheres[p] += *force, *np.cross(arm, force)
        if q >= 0:
            on_spheres[q] -= *force, *np.cross(other, force)
    return np.array(forces), on_spheres


def test_stiffness_of_mindlin_is_that_of_mercurys_forces(tmp_path):
    """Central differences over 1e-10 m against overlaps of 1e-5 m: an error of 1e-10 and less.

    Round-off of forces, 1e-16 of 1e3 N over 1e-10 m, is 1e-9 of stiffnesses of 1e6 N/m.
    """
    made = packing(False, 40)
    file, spring = mindlin(made, tmp_path)
    found = import_packing(file)
    arc = np.tile([1.0] * 3 + [1e3] * 3, made.n_particles)  # of rotations, a step is one of 1 mm
    spheres = [*range(0, 40, 10), *made.particle_i[made.with_wall][[0, -1]]]
    own = np.concatenate([6 * k + np.arange(6) for k in spheres])
    wanted = np.empty((arc.size, own.size))
    for column, k in zip(wanted.T, own, strict=True):
        moved = np.zeros((2, arc.size))
        moved[:, k] = 1e-10 * arc[k], -1e-10 * arc[k]
        ahead, behind = (mercury(made, spring, way.reshape(-1, 6))[1] for way in moved)
        column[:] = (behind - ahead).ravel() / (2e-10 * arc[k])
    assert misfit(found.network, wanted, own, TANGENTS["law"]) < 1e-6


def test_spring_of_mindlin_is_that_of_a_file_of_mercury():
    """One sphere on a floor, of MercuryDPM 0.14: its sliding spring bears its force, 15 digits."""
    network = modal.read(ROOT / "tests/data/mercury_mindlin.restart")
    # The overlap of 2.3e-8 m is known to half of 1e-18 m over 1 mm: 1e-9 of its root and less.
    np.testing.assert_allclose(
        network.stiffness_tangential * 5.13696996565198e-09, 3.01592890590078e-05, rtol=1e-8
    )


@pytest.mark.parametrize(
    ("friction", "static", "slides"), [(0.2, 0.5, 0), (0.2, 0.3, 1), (0, 0.5, 0)]
)
def test_mercury_sticks_up_to_its_static_friction(cubic, friction, static, slides):
    """A shear of 1.5 N under 4.63 N, 0.32 of it; friction 0 has no shear force, so no spring."""
    cubic.spoil("spheres", "force 0 0 -4.62918369484511", "force 1.5 0 -4.62918369484511")
    law = "LinearViscoelasticSlidingFrictionSpecies slidingStiffness 2e4 slidingDissipation 0 "
    law += f"slidingFrictionCoefficient {friction} slidingFrictionCoefficientStatic {static}"
    cubic.spoil("spheres", "LinearViscoelasticSpecies", law)
    network = cubic.network()
    sheared = network.force_tangential[:, 0] > 1
    assert network.sliding[sheared].tolist() == [bool(slides)]
    assert set(network.stiffness_tangential) == {2e4 if friction else 0.0}


def box(capsys, tmp_path: Path, walls: str, z: str = "0.499 1.497") -> Given:
    """Two spheres of radius 0.5 on each other at x = 0.5 between these walls, none listed."""
    file = tmp_path / "box.restart"
    rows = [(k, *line.split(" position ")) for k, line in enumerate(walls.splitlines())]
    text = ""
    for k, normal, place in rows:
        vector = np.array(normal.split(), float)
        at = float(place) * vector / max(np.linalg.norm(vector), 1e-300)
        text += f"InfiniteWall id {k} indSpecies 0 position {' '.join(map(repr, at.tolist()))} "
        text += f"normal {normal}\n"
    particles = "".join(
        f"BaseParticle id {k} indSpecies 0 position 0.5 2.5000001 {each} radius 0.5 invMass 1\n"
        for k, each in enumerate(z.split())
    )
    file.write_text(
        "MercuryDPM 0.14 name two\nxMin 0 xMax 1 yMin 0 yMax 5 zMin 0 zMax 2\n"
        "systemDimensions 3 particleDimensions 3 gravity 0 0 0\nSpecies 1\n"
        "LinearViscoelasticSpecies id 0 density 1.9 stiffness 2000 dissipation 0\n"
        f"Walls {len(rows)}\n{text}Boundaries 0\nParticles 2\n{particles}Interactions 0\n"
    )
    return Given(capsys, file, {})


ENDS = "0 0 -1 position 0\n0 0 1 position 1.996\n"


@pytest.mark.parametrize(
    ("wall", "said"),
    [
        ("1 0 0 position 0.995", "sphere 0 has a contact with wall 2; a network knows one flat"),
        ("0 0.6 0.8 position 1.5", "a contact with wall 2; "),
        ("0 0 -1 position -0.0005", "sphere 0 has a contact with wall 0; "),
        ("0 0 1 position 1.9965", "sphere 1 has a contact with wall 2; "),
        ("0 0 0 position 0", "line 9: a wall without a direction"),
    ],
)
def test_walls_that_a_network_has_not_are_refused_where_they_are_touched(
    tmp_path, capsys, wall, said
):
    """Contacts follow from the positions there; overlaps with the floor and ceiling of 0.001."""
    box(capsys, tmp_path, f"{ENDS}{wall}\n").refused(said)


def test_walls_that_no_sphere_touches_are_left_out(tmp_path, capsys):
    """Lateral ones just at the spheres' surfaces, a second floor below, and the floor last."""
    aside = "-1 0 0 position 0\n1 0 0 position 1\n0 0 -1 position 0.3\n0 0 1 position 2.1\n"
    found = box(capsys, tmp_path, aside + ENDS).network()
    assert sorted(found.particle_j.tolist()) == [-2, -1, 1]
    assert found.wall_position.tolist() == [0.0, 1.996]
    np.testing.assert_allclose(found.force_normal, [2, 4, 2], rtol=1e-9)


def test_a_walls_normal_may_have_any_length(cubic):
    """Of today's format: the same walls, turned by quaternions that are ten times as long."""
    wanted = cubic.network()
    turned = r"(?m)^(InfiniteWall .*? orientation) (\S+) (\S+) (\S+) (\S+)"
    cubic.spoil("spheres", turned, r"\1 \g<2>e1 \g<3>e1 \g<4>e1 \g<5>e1", 0)
    found = cubic.network()
    assert found.wall_position == pytest.approx(wanted.wall_position, rel=1e-12)
    assert np.array_equal(found.particle_j, wanted.particle_j)


def test_finite_walls_without_listed_contacts_are_refused(cubic):
    """Nothing tells whether a sphere touches them."""
    cubic.spoil("spheres", "InfiniteWall", "TriangleWall")
    cubic.spoil("spheres", "(?s)Interactions.*", "")
    cubic.refused("wall 0, TriangleWall, do not follow from positions; write")
