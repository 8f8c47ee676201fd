"""Motions without energy: counted exactly, by kind, against dense null spaces."""

import numpy as np
import pytest
from changes import from_other_end, slippery
from oracles import dense_squares
from packings import diluted

from modal.modes.counts import count_below
from modal.modes.zero_modes import by_structure
from modal.packing import crystal as gallery
from modal.system.linear_system import Limits, LinearSystem

pytestmark = pytest.mark.two_ways


def zero_modes(system: LinearSystem) -> int:
    """Rank deficiency of the dense matrix; round-off is some 1e-14 of the largest eigenvalue."""
    square = dense_squares(system)
    return int((square < 1e-11 * square[-1]).sum())


@pytest.mark.parametrize(
    ("share", "seed", "translations_only"),
    [*((share, seed, False) for share in (0.3, 0.5, 0.6) for seed in (1, 2, 3))]
    + [(0.8, 2, True), (0.9, 2, True)],
)
def test_floppy_modes_of_a_diluted_crystal(share, seed, translations_only):
    """Structure gives exact zero modes, orthonormal, and (these parts are small) all of them.

    Without rotations a single contact with both springs holds a sphere: only clusters are free.
    """
    system = LinearSystem.of(diluted(share, seed), translations_only=translations_only)
    floppy, scale = by_structure(system), system.scaled.diagonal().max()
    assert abs((system.scaled @ floppy.basis).toarray()).max(initial=0.0) < 1e-11 * scale
    gram = (floppy.basis.T @ floppy.basis).toarray()
    assert gram == pytest.approx(np.eye(len(gram)), abs=1e-10)
    assert sum(floppy.kinds.values()) == floppy.total == zero_modes(system)
    assert floppy.total or share < 0.5


def test_parts_too_large_for_a_dense_null_space_count_as_held():
    """What is left is a part of the zero modes, still exact; the counts tell how many there are."""
    network = diluted(0.5, 1)
    everything = by_structure(LinearSystem.of(network))
    system = LinearSystem.of(diluted(0.5, 1), limits=Limits(piece=1))
    assert 0 < by_structure(system).kinds["hinged"] < everything.kinds["hinged"]
    assert by_structure(system).kinds["free_particles"] == everything.kinds["free_particles"]
    basis, scale = by_structure(system).basis, system.scaled.diagonal().max()
    assert abs((system.scaled @ basis).toarray()).max() < 1e-11 * scale
    assert count_below(system, 1.0) == everything.total


def test_two_spheres_and_one_spring():
    """An oblique contact without friction resists one motion of twelve."""
    crystal = gallery.fcc(cells=(2, 2, 3))
    oblique = np.flatnonzero((abs(crystal.normal) > 0.1).sum(axis=1) >= 2)[:1]
    system = LinearSystem.of(slippery(crystal.with_contacts(oblique)))
    assert by_structure(system).total == zero_modes(system) == system.size - 1
    assert by_structure(system).kinds["loose_clusters"] == 11


def test_each_kind_is_named():
    """A free sphere has six zero modes, one on one contact three, one on two contacts one."""
    network = gallery.column(4)
    i, j = network.particle_i, network.particle_j
    free = network.with_contacts((i != 3) & (j != 3))
    kinds = by_structure(LinearSystem.of(free)).kinds
    assert kinds["free_particles"] == 6
    # Sphere 2 hangs on one contact. 0 and 1 turn about the axis, 2 about its contact point, and
    # the whole hanging column swings about the wall: dense rank says how many.
    assert sum(kinds.values()) == zero_modes(LinearSystem.of(free))
    single = network.with_contacts(np.flatnonzero(j == -1))
    kinds = by_structure(LinearSystem.of(single)).kinds
    assert {name: n for name, n in kinds.items() if n} == {"free_particles": 18, "hinged": 3}


@pytest.mark.parametrize("periodic", ["x and y", "x", "none"])
def test_cluster_without_walls_moves_as_a_whole(periodic):
    """Three translations; of the rotations a period leaves one about its own axis, or none."""
    network = gallery.fcc(cells=(4, 4, 5))
    inside = network.particle_j >= 0
    if periodic != "x and y":
        inside &= network.cell_shift[:, 1] == 0
    if periodic == "none":
        inside &= network.cell_shift[:, 0] == 0
    system = LinearSystem.of(network.with_contacts(inside))
    floppy, rigid = by_structure(system), {"x and y": 3, "x": 4, "none": 6}[periodic]
    assert floppy.kinds["loose_clusters"] == rigid and floppy.total == zero_modes(system)


@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
def test_a_cluster_is_followed_through_contacts_named_either_way(share):
    """Its places, and so its rigid rotations, whichever body of a contact comes first."""
    crystal = gallery.fcc(cells=(4, 4, 5))
    network = crystal.with_contacts((crystal.particle_j >= 0) & ~crystal.cell_shift.any(axis=1))
    other = np.random.default_rng(1).random(network.n_contacts) < share
    network = from_other_end(network, other)
    floppy = by_structure(LinearSystem.of(network))
    assert floppy.kinds["loose_clusters"] == floppy.total == 6
