"""Tests of stresses, layers, contacts and order against crystals, energies and integrals."""

from dataclasses import replace

import numpy as np
import pytest
from packings import polydisperse, random_sample
from places import PACKINGS, SHEARED
from refusals import refusal

from modal.packing import crystal as gallery
from modal.packing import state
from modal.packing.contact_law import RADIUS
from modal.packing.layers import Layers
from modal.packing.network import RECEIVER_WALL, Network, read_network, write_network
from modal.packing.order import crystalline
from modal.packing.rattlers import firmly_held, force_bearing
from modal.packing.sample import Sample, read_sample, write_sample
from modal.packing.summary import summary
from modal.theory.fcc import FccLattice


def overlapping(seed: int = 1, n: int = 120) -> Sample:
    """Return a packing squeezed to overlaps of a tenth of the radius and shaken, out of balance."""
    packed = random_sample(n, 1e6, seed, aspect=1.5)
    shake = np.random.default_rng(seed).uniform(-0.03, 0.03, (n, 3)) * RADIUS
    side = 0.95 * packed.side
    walls = 0.95 * packed.walls
    position = 0.95 * packed.position + shake
    position[:, :2] %= side
    return replace(packed, position=position, side=side, walls=walls)


def sheared(network: Network, seed: int = 2) -> Network:
    """Return the network with random shear forces, a tenth of the normal force."""
    size = 0.1 * network.force_normal[:, None]
    force = size * np.random.default_rng(seed).standard_normal(network.normal.shape)
    along = (force * network.normal).sum(axis=1)[:, None] * network.normal
    return network.unchecked(force_tangential=force - along)


def elastic_energy(sample: Sample, stretch: np.ndarray) -> float:
    """Return the Hertz energy, 2/5 of force times overlap, of a sample stretched along its axes."""
    stretched = replace(
        sample,
        position=sample.position * stretch,
        side=sample.side * stretch[:2],
        walls=sample.walls * stretch[2],
    )
    network = stretched.network()
    return float(0.4 * network.force_normal @ network.overlap)


def test_stress_is_the_derivative_of_the_energy():
    """Compare with -dE / d(log L) / V for each axis, walls included (virial theorem)."""
    sample = overlapping()
    network = sample.network()
    stress = np.diag(state.stress_tensor(network))
    volume = network.cell_size.prod()
    errors = []
    for step in (4e-4, 2e-4):
        derivative = []
        for axis in np.eye(3):
            shorter = elastic_energy(sample, 1 - step * axis)
            longer = elastic_energy(sample, 1 + step * axis)
            derivative.append((shorter - longer) / (2 * step * volume))
        errors.append(abs(np.array(derivative) / stress - 1).max())
    # Hertz energies grow as overlap^(5/2): contacts that open or close at the step leave an error
    # of order between 3/2 and 2.
    assert errors[1] < 1e-5
    assert np.log2(errors[0] / errors[1]) > 1.3


@pytest.mark.parametrize("stress", [1e3, 1e5, 1e7])
def test_crystal_in_balance(stress):
    network = gallery.fcc(stress, (3, 3, 20))
    crystal = FccLattice(stress)
    assert state.wall_stress(network) == pytest.approx([stress, stress], rel=1e-12)
    assert state.residual_forces(network).max() <= 1e-12
    layers = state.profile(network, thickness=0.37 * RADIUS)
    # A plane anywhere carries what the walls carry.
    assert layers.stress[:, 2] == pytest.approx(np.full(len(layers.stress), stress), rel=1e-9)
    # In the plane 20 layers hold their own contacts, the 19 gaps between them as many again.
    contact = stress * crystal.spacing / np.sqrt(8)
    lateral = np.diag(state.stress_tensor(network))[:2] * network.length
    assert lateral == pytest.approx(np.full(2, (20 + 19) * contact), rel=1e-12)
    assert np.diag(state.stress_tensor(network))[2] == pytest.approx(stress, rel=1e-12)
    fabric = state.fabric_tensor(gallery.fcc(stress, (3, 3, 400)))
    assert fabric == pytest.approx(np.eye(3) / 3, abs=1e-3)


def test_densities_and_coordination_are_counted_sphere_by_sphere():
    """Count in a loop, for radii 1:3 of glass and steel."""
    network = polydisperse()
    solid = sum(4 / 3 * np.pi * r**3 for r in network.radius)
    cell_volume = network.cell_size.prod()
    assert state.void_ratio(network) == pytest.approx(cell_volume / solid - 1, rel=1e-12)
    touching = np.zeros(network.n_particles)
    for i, j in zip(network.particle_i, network.particle_j, strict=True):
        touching[i] += 1
        if j >= 0:
            touching[j] += 1
    np.testing.assert_array_equal(state.contacts_per_particle(network), touching)
    layers = state.profile(network)
    assert layers.particles.sum() == network.n_particles
    volume = cell_volume / len(layers.void_ratio)
    assert (volume / (1 + layers.void_ratio)).sum() == pytest.approx(solid, rel=1e-12)


@pytest.mark.parametrize("thickness", [0.3, 1.0, 2.7, 100.0])
def test_layers_add_up_to_the_whole(thickness):
    network = sheared(overlapping(3).network())
    layers = state.profile(network, thickness * 2 * RADIUS)
    count = len(layers.stress)
    stress = np.diag(state.stress_tensor(network))
    assert layers.stress.mean(axis=0) == pytest.approx(stress, rel=1e-12)
    solid = 1 / (1 + layers.void_ratio)
    assert 1 / solid.mean() - 1 == pytest.approx(network.study["void_ratio"], abs=1e-12)
    assert layers.particles.sum() == network.n_particles
    ends = (layers.coordination * layers.particles).sum()
    assert ends / network.n_particles == pytest.approx(network.study["coordination_number"])
    assert layers.edges[[0, -1]] == pytest.approx(network.wall_position)
    assert layers.edges == pytest.approx(np.linspace(*network.wall_position, count + 1))


def test_volume_of_a_cut_sphere():
    """Compare one sphere with the integral of its circular sections."""
    cell = np.full(3, 8 * RADIUS)
    centre = np.array([[0.1, 0.2, 3.3]]) * RADIUS
    network = Sample(centre, cell[:2], np.array([0, cell[2]]), friction=0.0).network()
    layers = state.profile(network, RADIUS)
    solid = RADIUS * cell[0] * cell[1] / (1 + layers.void_ratio)
    z = np.linspace(0, cell[2], 8 * 20000 + 1)
    section = np.pi * np.maximum(RADIUS**2 - (z - centre[0, 2]) ** 2, 0)
    slabs = (section[:-1] + section[1:]).reshape(8, -1).sum(axis=1) / 2 * (z[1] - z[0])
    assert solid == pytest.approx(slabs, abs=1e-7 * slabs.max())


def test_rattlers_leave_with_their_contacts():
    """Add to a column a sphere that touches it, another that touches that one, and a free one."""
    column = gallery.column(4)
    overlap = column.overlap[1]
    aside = column.position[1] + [2 * RADIUS - overlap, 0, 0]
    further = aside + [2 * RADIUS - overlap, 0, 0]
    free = [0, 6 * RADIUS, 3 * RADIUS]
    position = np.vstack([column.position, aside, further, free])
    network = Sample(position, np.full(2, 12 * RADIUS), column.wall_position, 0.0).network()
    bearing, rattlers = state.coordination_without_rattlers(network)
    assert (bearing, rattlers) == (2.0, 3)
    assert network.study["coordination_number"] == pytest.approx((4 * 2 + 2 + 2) / 7)


def test_share_of_friction():
    network = gallery.column(2)
    shear = np.zeros((network.n_contacts, 3))
    shear[1, 0] = 0.05 * network.force_normal[1]
    network = replace(network, force_tangential=shear)
    assert state.friction_used(network, 0.1) == pytest.approx([0, 0.5, 0])
    assert summary(network, 0.1)["largest_share_of_friction"] == pytest.approx(0.5)
    assert state.friction_used(gallery.column(2), 0.0) == pytest.approx([0, 0, 0])


def test_wall_layers_are_told_from_the_bulk():
    network = gallery.fcc(cells=(2, 2, 40))
    layers = state.profile(network)
    middle = (layers.edges[1:] + layers.edges[:-1]) / 2
    depth = np.minimum(middle, network.length - middle)
    assert (layers.bulk == (depth > 11 * RADIUS * (1 - 1e-9))).all()
    numbers = summary(network)
    perfect = FccLattice(1e5)
    cell = perfect.spacing**2 * perfect.layer_distance
    void_ratio = cell / (4 / 3 * np.pi * RADIUS**3) - 1
    assert numbers["void_ratio_of_bulk"] == pytest.approx(void_ratio, rel=2e-2)
    assert "void_ratio_of_bulk" not in summary(gallery.fcc(cells=(2, 2, 8)))


def test_info_reads_the_compact_form(tmp_path, printed):
    """Find equal numbers, to the last digit, from a sample and from its network."""
    sample = replace(read_sample(SHEARED), study={"mu_wave": 0.3})
    write_sample(tmp_path / "x.sample.h5", sample)
    write_network(tmp_path / "x.network.h5", sample.network())
    of_sample = printed("info", tmp_path / "x.sample.h5")
    of_network = printed("info", tmp_path / "x.network.h5")
    for name in ("seconds", "peak_memory_bytes"):
        del of_sample[name]
        del of_network[name]
    assert of_sample == of_network
    assert of_sample["largest_share_of_friction"] > 0


def test_layers_of_a_cell_without_walls_know_no_end():
    """Find equal stresses in all layers, and layers that move with a packing round the cell.

    Net forces in YADE's packing are 1e-6 of the contact forces.
    """
    network = read_network(PACKINGS / "triaxial.network.h5")
    layers = state.profile(network)
    assert layers.bulk.all()
    assert layers.stress[:, 2] == pytest.approx(layers.stress[:, 2].mean(), rel=1e-5)
    volume = network.cell_size.prod() / len(layers.void_ratio)
    solid = (4 / 3 * np.pi * network.radius**3).sum()
    assert (volume / (1 + layers.void_ratio)).sum() == pytest.approx(solid, rel=1e-12)
    step = np.diff(layers.edges)[0]
    low = network.wall_position[0]
    position = network.position.copy()
    position[:, 2] += step
    beyond_end = position[:, 2] >= network.wall_position[1]
    position[beyond_end, 2] -= network.cell_size[2]
    assert beyond_end.any()
    assert position[:, 2].min() >= low
    shift = network.cell_shift.copy()
    shift[:, 2] += beyond_end[network.partner].astype(int) - beyond_end[network.particle_i]
    shifted = state.profile(replace(network, position=position, cell_shift=shift))
    assert shifted.void_ratio == pytest.approx(np.roll(layers.void_ratio, 1), rel=1e-9)
    assert shifted.stress == pytest.approx(np.roll(layers.stress, 1, axis=0), rel=1e-9)


@pytest.mark.parametrize(("strength", "lowest", "highest"), [(0.02, 0.99, 1.0), (0.35, 0.0, 0.1)])
def test_shaken_crystal_loses_its_order(strength, lowest, highest):
    network = gallery.fcc(cells=(5, 5, 10))
    shake = np.random.default_rng(7).standard_normal(network.position.shape)
    network = network.unchecked(position=network.position + strength * 2 * RADIUS * shake)
    assert lowest <= crystalline(network).mean() <= highest


def test_centres_that_coincide_through_a_period_have_no_bond():
    """Move a sphere of a column by a period onto the next one: no direction leads from it."""
    crystal = gallery.fcc(cells=(1, 1, 8))
    width = crystal.cell_size[0]
    position = np.zeros((8, 3))
    position[:, 2] = np.arange(8) * width
    position[3] = position[2] + [width, 0, 0]
    network = crystal.unchecked(position=position)
    with np.errstate(all="raise"):
        assert not crystalline(network)[[0, 7]].any()


def test_turned_crystal_is_as_crystalline():
    """Turn a crystal in the middle of a large cell by one radian."""
    cluster = gallery.fcc(cells=(6, 6, 8)).position
    cluster = cluster - cluster.mean(axis=0)
    cosine = np.cos(1.0)
    sine = np.sin(1.0)
    turn = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    cell = 40 * RADIUS
    shares = []
    for rotation in (np.eye(3), turn):
        position = cluster @ rotation.T + cell / 2
        sample = Sample(position, np.full(2, cell), np.array([0, cell]), friction=0.0)
        shares.append(crystalline(sample.network()).sum())
    assert shares[0] == shares[1] > 100


def test_a_dangling_chain_bears_no_force():
    """Take the upper wall's contact from a column: all its spheres then hang on one contact."""
    column = gallery.column(4)
    assert force_bearing(column).all()
    cut = column.with_contacts(column.particle_j != RECEIVER_WALL)
    assert not force_bearing(cut).any()
    with refusal("carries_no_wave"):
        Layers(cut)


def test_means_equal_a_loop():
    network = gallery.fcc(cells=(3, 3, 20))
    position = network.position.copy()
    position[:, 2] += np.random.default_rng(0).uniform(-1e-4, 1e-4, network.n_particles)
    network = network.unchecked(position=position)
    layers = Layers(network)
    values = np.random.default_rng(1).standard_normal(network.n_particles)
    for k, (z, mean) in enumerate(zip(layers.position, layers.means(values), strict=True)):
        inside = layers.layer == k
        assert mean == pytest.approx(values[inside].mean(), rel=1e-12)
        assert z == pytest.approx(network.position[inside, 2].mean(), rel=1e-12)
    # The slabs are equal and one diameter thick to within half a diameter over all of them.
    width = np.diff(layers.position)
    assert (width > 0).all()
    assert len(width) + 1 == round(network.length / (2 * network.radius[0]))


def test_particles_on_hardly_loaded_contacts_are_left_out():
    """Give one sphere of a crystal a thousandth of the force: it bears force, but hardly."""
    crystal = gallery.fcc(cells=(4, 4, 6))
    has_sphere = (crystal.particle_i == 40) | (crystal.particle_j == 40)
    force = np.where(has_sphere, 1e-3, 1.0)
    weak = replace(crystal, force_normal=force)
    assert force_bearing(weak).all()
    assert np.flatnonzero(~firmly_held(weak)).tolist() == [40]
    assert np.flatnonzero(Layers(weak).layer < 0).tolist() == [40]
    assert firmly_held(replace(crystal, force_normal=0 * force)).all()


def test_centres_told_in_another_period_are_in_their_layers():
    """Move centres by whole periods along z, as a DEM run leaves them in a cell without walls."""
    cell = gallery.fcc(cells=(2, 2, 6), periodic_z=True)
    periods = np.random.default_rng(2).integers(-2, 3, cell.n_particles)
    position = cell.position + periods[:, None] * [0, 0, cell.length]
    layers = Layers(cell)
    moved = Layers(cell.unchecked(position=position))
    assert len(layers.position) == round(cell.length / (2 * cell.radius[0]))
    np.testing.assert_array_equal(moved.layer, layers.layer)
    np.testing.assert_allclose(moved.position, layers.position, rtol=1e-12)
