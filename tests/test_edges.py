"""The edges of physics: tiny and huge overlaps, contrasts, few contacts, one sphere, far origins.

Every frequency is compared with a closed form or with the singular values of the springs' stretch
matrix: those carry an absolute error of eps f_max, where eigenvalues of K lose eps f_max^2 / f.
"""

from dataclasses import replace

import numpy as np
import pytest
from changes import OPTIONAL, slippery, stiffer
from oracles import kinematics
from places import SHEARED
from refusals import refusal
from scipy.linalg import qr

from analysis.estimators.layer_lattice import LayerLattice
from modal.__main__ import main
from modal.modes.counts import count_below
from modal.modes.eigenmodes import modes_of
from modal.modes.zero_modes import by_structure
from modal.packing import crystal as gallery
from modal.packing.neighbours import tangents
from modal.packing.network import Network, write_network
from modal.packing.sample import Sample, read_sample
from modal.solvers.factor import factorise
from modal.system.linear_system import LinearSystem
from modal.theory.fcc import FccLattice
from modal.waves.motions import Pulse
from modal.waves.propagate import propagate

EPS = np.finfo(float).eps


def stretch_matrix(network: Network, *, normal_only: bool = False) -> np.ndarray:
    """Rows: root of stiffness times stretch of each spring, per unit mass-scaled motion (6n)."""
    B = kinematics(network)
    directions = [(network.normal, network.stiffness_normal)]
    if not normal_only:
        directions += [(t, network.stiffness_tangential) for t in tangents(network.normal)]
    rows = np.concatenate(
        [np.sqrt(k)[:, None] * np.einsum("ca,cab->cb", along, B) for along, k in directions]
    )
    i, j = (np.tile(index, len(directions)) for index in (network.particle_i, network.particle_j))
    G = np.zeros((len(rows), 6 * network.n_particles))
    for c, row in enumerate(rows):
        G[c, 6 * i[c] : 6 * i[c] + 6] += row[:6]
        if j[c] >= 0:
            G[c, 6 * j[c] : 6 * j[c] + 6] += row[6:]
    return G / np.sqrt(np.column_stack([network.mass] * 3 + [network.inertia] * 3).ravel())


def exact_frequencies(network: Network) -> np.ndarray:
    """All frequencies, Hz, ascending: singular values of the stretch matrix over 2 pi."""
    G = stretch_matrix(network)
    found = np.linalg.svd(G, compute_uv=False)
    return np.sort(np.concatenate([found, np.zeros(max(0, G.shape[1] - len(found)))])) / 2 / np.pi


def bound(f: np.ndarray, top: float, size: int) -> np.ndarray:
    """Relative error of frequencies whose squares carry size * eps * f_max^2 (LAPACK's p(n))."""
    return size * EPS * (top / f) ** 2 + 1e-12


@pytest.mark.parametrize("stress", [2e-8, 1e-4, 1.0, 1e2, 1e5, 1e8, 6.7e8, 9e8])
def test_crystal_from_overlaps_of_1e_12_to_a_tenth_of_the_radius(stress):
    """P resonances against the chain of layers; stress 2e-8 Pa is an overlap of 1e-12 R."""
    network = gallery.fcc(stress, (1, 1, 20))
    modes = modes_of(LinearSystem.of(network), all=True)
    omega, _ = LayerLattice.of_network(network).eigenmodes()
    assert modes.resonance_frequency == pytest.approx(omega / 2 / np.pi, rel=1e-11)
    # A compact sample keeps positions: an overlap is a difference of them.
    rebuilt = Sample(network.position, network.cell_size[:2], network.wall_position, 0.1).network()
    assert rebuilt.n_contacts == network.n_contacts
    loss = 4 * EPS * network.length / FccLattice(stress).overlap
    assert np.sort(rebuilt.overlap) == pytest.approx(np.sort(network.overlap), rel=loss, abs=0)


def contrasted(network: Network, of: str, decades: float, seed: int) -> Network:
    """Contacts whose stiffnesses, or spheres whose masses, lie over so many decades."""
    random = np.random.default_rng(seed)
    if of == "stiffness":
        factor = 10 ** (-decades * random.random(network.n_contacts))
        return stiffer(network, factor, factor)
    factor = 10 ** (decades * random.random(network.n_particles))
    mass, inertia = network.mass * factor, network.inertia * factor ** (5 / 3)
    return network.unchecked(mass=mass, inertia=inertia)


@pytest.mark.parametrize(
    ("of", "decades"), [*(("stiffness", k) for k in (4, 8, 12)), ("mass", 3), ("mass", 6)]
)
def test_contrast(of, decades):
    """Masses over six decades are radii 1 to 100, inertias over ten."""
    network = contrasted(gallery.fcc(cells=(2, 2, 15)), of, decades, 1)
    system, exact = LinearSystem.of(network), exact_frequencies(network)
    found, top = modes_of(system, all=True).frequency, exact[-1]
    assert (abs(found / exact - 1) < bound(exact, top, system.size)).all()
    lowest = modes_of(system, lowest=4)
    assert lowest.attributes["certified"]
    assert (abs(lowest.frequency / exact[:4] - 1) < bound(exact[:4], top, system.size)).all()
    assert modes_of(system, highest=2).frequency == pytest.approx(exact[-2:], rel=1e-10)
    between = (exact[100] + exact[101]) / 2
    assert count_below(system, between) == 101


def test_more_contrast_than_double_precision_holds_is_refused():
    """Masses over nine decades: omega^2 over fourteen; no shift separates the lowest ones."""
    network = contrasted(gallery.fcc(cells=(2, 2, 40)), "mass", 9, 1)
    with refusal("not_converged"):
        modes_of(LinearSystem.of(network), lowest=6)


@pytest.mark.parametrize("ratio", [0.0, 1e-9, 1e-6, 1e-3, 0.5, 1.0])
def test_tangential_over_normal_stiffness(ratio):
    network = gallery.fcc(cells=(2, 2, 6))
    network = replace(network, stiffness_tangential=ratio * network.stiffness_normal)
    system, exact = LinearSystem.of(network), exact_frequencies(network)
    found = modes_of(system, all=True).frequency
    error = system.size * EPS * exact[-1] ** 2
    assert abs(np.sign(found) * found**2 - exact**2).max() < error
    spins = 3 * network.n_particles if ratio == 0 else 0
    # Without tangential springs every sphere spins and the whole slides along both walls.
    assert by_structure(system).total == spins + 2 * (ratio == 0)


def _ball(normals: np.ndarray) -> Network:
    """One sphere, held at fixed points in the directions `normals` (m, 3)."""
    one, m = gallery.column(1), len(normals)
    return one.unchecked(
        particle_i=np.zeros(m, int),
        particle_j=np.full(m, -1),
        normal=normals,
        lever_i=one.radius[0] * normals,
        lever_j=0 * normals,
        stiffness_normal=np.full(m, 1e6),
        stiffness_tangential=np.full(m, 8e5),
        **dict.fromkeys(OPTIONAL),
    )


@pytest.mark.parametrize("angle", [1e-1, 1e-2, 1e-3, 1e-4])
def test_nearly_coincident_contacts(angle):
    """Three contacts within a small angle: soft rocking proportional to it, never lost."""
    s, c = np.sin(angle), np.cos(angle)
    network = _ball(np.array([[0, 0, -1], [s, 0, -c], [0, s, -c]]))
    system, exact = LinearSystem.of(network), exact_frequencies(network)
    found = modes_of(system, all=True).frequency
    assert by_structure(system).total == 0
    assert (abs(found / exact - 1) < bound(exact, exact[-1], 6)).all()


def test_isostatic_network_without_stress():
    """As many springs as motions: no zero mode; every spring taken away gives one (Maxwell)."""
    crystal = gallery.fcc(cells=(4, 4, 16))
    # Spheres off their places: no symmetry and no state of self-stress by accident.
    random = np.random.default_rng(3)
    normal = crystal.normal + 0.05 * random.standard_normal(crystal.normal.shape)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    crystal = crystal.unchecked(normal=normal, stiffness_tangential=0 * crystal.overlap)
    translations = np.arange(6 * crystal.n_particles).reshape(-1, 6)[:, :3].ravel()
    G = stretch_matrix(crystal, normal_only=True)[:, translations]
    order = qr(G.T, mode="r", pivoting=True)[1][: G.shape[1]]
    for removed in (0, 1, 5):
        kept = np.sort(order[: len(order) - removed])
        system = LinearSystem.of(crystal.with_contacts(kept), translations_only=True)
        softest = np.linalg.svd(G[kept], compute_uv=False)[-1] / 2 / np.pi
        assert softest > 1e-5 * 2e5  # far enough above round-off, sqrt(eps) f_max, to be counted
        assert count_below(system, softest / 2) == removed
        factor = factorise(system.shifted((np.pi * softest) ** 2), solver="blocks", kept=False)
        assert factor.negative == removed


@pytest.mark.parametrize("distance", [1.0, 1e3])
def test_far_from_the_origin(distance):
    """A network's springs do not know where it is; a sample's overlaps lose eps times distance."""
    sample = read_sample(SHEARED)
    network = sample.network()
    walls = network.wall_position + distance
    moved = replace(network, position=network.position + distance, wall_position=walls)
    # The default pulse is of the length between walls, which a shift rounds.
    wave = {"motion": Pulse(), "interval": 1e-6}
    here, there = (propagate(net, 2e-5, **wave).signals for net in (network, moved))
    assert np.array_equal(here.chain_particle, there.chain_particle)
    assert np.array_equal(here.chain_displacement, there.chain_displacement)
    up = {"position": sample.position + [0, 0, distance], "walls": sample.walls + distance}
    far = replace(sample, **up).network()
    loss = 2 * EPS * distance
    assert far.n_contacts == network.n_contacts
    assert abs(far.overlap - network.overlap).max() < loss


@pytest.mark.parametrize("network", [gallery.column(1), gallery.fcc(cells=(1, 1, 1))])
@pytest.mark.parametrize("slips", [False, True])
def test_a_single_sphere(network, slips, tmp_path):
    """Between walls, alone or touching its own images: a receiver wall's number, -2, is beyond
    the only sphere when it is taken for one."""
    assert network.n_particles == 1
    if slips:
        network = slippery(network)
    exact = exact_frequencies(network)
    zero = int((exact < 1e-6 * exact[-1]).sum())
    system = LinearSystem.of(network)
    assert by_structure(system).total == zero
    assert modes_of(system, all=True).frequency[zero:] == pytest.approx(exact[zero:], rel=1e-12)
    assert count_below(system, exact[-1] / 2) == int((exact < exact[-1] / 2).sum())
    assert propagate(network, 1e-5).signals.chain_displacement[-1] > 0
    # Every command takes it.
    path, out = str(tmp_path / "one.network.h5"), str(tmp_path / "out.h5")
    write_network(path, network)
    lists = "modes --lowest 1", "modes --highest 1", "modes --all"
    wave = f"wave --duration 1e-5 -o {out}"
    for command in ("info", *lists, "count --at 1e5", "density", wave, "response"):
        name, *options = command.split()
        assert main([name, path, *options]) == 0, command
