"""Restart files as MercuryDPM writes them, and the forces of its Hertz-Mindlin law."""

from pathlib import Path

import numpy as np
from program_files import PackingFiles

from modal.packing.network import SOURCE_WALL, Network

RADIUS = 0.5
"""Radius of the spheres of `two_spheres`, m."""
ENDS = "0 0 -1 position 0\n0 0 1 position 1.996\n"
"""Walls of `two_spheres`: a floor and a ceiling."""
SPECIES = {(0, 0): (6e10, 2e10, 0.5), (1, 1): (2e11, 8e10, 0.4), (0, 1): (9.2e10, 3.1e10, 0.6)}
"""Effective elastic modulus and shear modulus, Pa, and friction between two species."""
WALL_SPECIES = 1


def words(numbers) -> str:
    """Return numbers in full precision."""
    return " ".join(map(repr, np.ravel(numbers).tolist()))


def write_mindlin(network: Network, folder: Path) -> tuple[Path, np.ndarray]:
    """Write a restart file of Hertz-Mindlin between walls; return its sliding springs (m, 3), m.

    As MercuryDPM 0.14 writes it: even spheres of species 0, odd ones of species 1, its walls, too.
    """
    random = np.random.default_rng(3)
    (low, high) = network.wall_position.tolist()
    spring = np.cross(network.normal, random.standard_normal((network.n_contacts, 3)))
    spring *= 0.2 * network.overlap[:, None]
    force, _ = mercury_forces(network, spring, np.zeros((network.n_particles, 6)))
    x, y, _ = network.cell_size.tolist()
    text = (
        f"MercuryDPM 0.14 name packing\nxMin 0 xMax {x!r} yMin 0 yMax {y!r} zMin {low!r} "
        f"zMax {high!r}\nsystemDimensions 3 particleDimensions 3 gravity 0 0 0\n"
        f"Species {len(SPECIES)}\n"
    )
    for (a, b), (elastic, shear, friction) in SPECIES.items():
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
    text += "Boundaries 3\nDeletionBoundary id 2 normal 1 0 0 distance 9\n"
    for axis, (along, shift) in enumerate((("1 0 0", [x, 0, 0]), ("0 1 0", [0, y, 0]))):
        text += f"PeriodicBoundary id {axis} normal {along} scaleFactor 1 distanceLeft 0 "
        text += f"distanceRight {shift[axis]!r} shift {words(shift)}\n"
    text += f"Particles {network.n_particles}\n"
    for k, (position, radius) in enumerate(zip(network.position, network.radius, strict=True)):
        text += f"BaseParticle id {k} indSpecies {k % 2} position {words(position)} "
        text += f"radius {words(radius)} invMass {words(1 / network.mass[k])}\n"
    text += f"Interactions {network.n_contacts}\n"
    for c, (i, j) in enumerate(zip(network.particle_i, network.particle_j, strict=True)):
        ends = f"particleIds {i} {j}" if j >= 0 else f"particleWallIds {i} {-j - 1}"
        text += f"HertzianViscoelasticMindlinInteraction {ends} timeStamp 1 contactPoint 0 0 0 "
        text += f"force {words(force[c])} torque 0 0 0 slidingSpring {words(spring[c])}\n"
    path = folder / "mindlin.restart"
    path.write_text(text)
    return path, spring


def mercury_forces(
    network: Network, spring: np.ndarray, moved: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return forces (m, 3) on the first sphere of contacts, and forces and torques (n, 6) on all.

    After one step in which they have moved and turned by `moved` (n, 6). From MercuryDPM's account
    of its law: normal n from the second to the first, contact point in the middle of the overlap,
    N = 4/3 E a overlap with a = sqrt(R* overlap), sliding spring s that grows by the motion of the
    contact point across n and is turned into the new plane (not at a wall), Ft = -2/3 (8 G a) s.
    """
    i = network.particle_i
    j = network.partner
    pair = ~network.with_wall
    position = network.position + moved[:, :3]
    motion = moved[:, :3]
    turn = moved[:, 3:]
    image = position[j] + network.cell_shift * network.cell_size
    plane = network.wall_position[np.where(network.particle_j == SOURCE_WALL, 0, 1)]
    image[~pair] = np.column_stack([position[i, :2], plane])[~pair]
    distance = np.linalg.norm(position[i] - image, axis=1)
    normal = (position[i] - image) / distance[:, None]
    radius_i = network.radius[i]
    radius_j = network.radius[j]
    overlap = np.where(pair, radius_i + radius_j, radius_i) - distance
    circle = np.sqrt(
        np.where(pair, radius_i * radius_j / (radius_i + radius_j), radius_i) * overlap
    )
    kinds = np.sort([i % 2, np.where(pair, j % 2, WALL_SPECIES)], axis=0)
    elastic, shear, _ = np.array([SPECIES[a, b] for a, b in kinds.T.tolist()]).T

    def along(vectors: np.ndarray) -> np.ndarray:
        return (vectors * normal).sum(axis=1)[:, None] * normal

    arm = (overlap / 2 - radius_i)[:, None] * normal
    back = position[i] + arm - image
    separation = np.where(pair[:, None], motion[i] - motion[j], 0)
    slip = motion[i] + np.cross(turn[i], arm)
    slip -= np.where(pair[:, None], motion[j] + np.cross(turn[j], back), 0)
    turned = (spring * separation).sum(axis=1) / distance
    stretched = spring - turned[:, None] * normal + slip - along(slip)
    force = (4 / 3 * elastic * circle * overlap)[:, None] * normal
    force -= (2 / 3 * 8 * shear * circle)[:, None] * stretched
    on_spheres = np.zeros((network.n_particles, 6))
    np.add.at(on_spheres, i, np.hstack([force, np.cross(arm, force)]))
    np.subtract.at(on_spheres, j[pair], np.hstack([force, np.cross(back, force)])[pair])
    return force, on_spheres


def two_spheres(capsys, tmp_path: Path, walls: str, z: str = "0.499 1.497") -> PackingFiles:
    """Write two spheres of radius 0.5 on each other at x = 0.5 between walls, without contacts."""
    file = tmp_path / "box.restart"
    rows = [(k, *line.split(" position ")) for k, line in enumerate(walls.splitlines())]
    text = ""
    for k, normal, place in rows:
        vector = np.array(normal.split(), float)
        position = float(place) * vector / max(np.linalg.norm(vector), 1e-300)
        text += f"InfiniteWall id {k} indSpecies 0 position {words(position)} "
        text += f"normal {normal}\n"
    particles = "".join(
        f"BaseParticle id {k} indSpecies 0 position 0.5 2.5000001 {height} radius 0.5 invMass 1\n"
        for k, height in enumerate(z.split())
    )
    file.write_text(
        "MercuryDPM 0.14 name two\nxMin 0 xMax 1 yMin 0 yMax 5 zMin 0 zMax 2\n"
        "systemDimensions 3 particleDimensions 3 gravity 0 0 0\nSpecies 1\n"
        "LinearViscoelasticSpecies id 0 density 1.9 stiffness 2000 dissipation 0\n"
        f"Walls {len(rows)}\n{text}Boundaries 0\nParticles 2\n{particles}Interactions 0\n"
    )
    return PackingFiles(capsys, file, {})
