"""Packings with a free surface: where grains are, what weighs, which waves go through them."""

from dataclasses import replace
from functools import cache

import numpy as np
import packings
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

import modal
from analysis import measure
from modal.packing.network import Network, write_network
from modal.packing.occupied import occupied_part
from modal.packing.plausibility import plausibility
from modal.packing.rattlers import keeping_contacts
from modal.packing.state import profile, residual_forces, void_ratio
from modal.packing.summary import summary
from modal.packing.weight import gravity_of, unbalanced_forces
from modal.system.assembly import stiffness_matrix
from modal.system.contacts import contact_tangent, motion_of_contacts
from modal.tools.errors import InputError
from modal.waves.sources import Plane

GRAVITY = np.array([0.6, 0.0, -9.81])
"""m/s^2, a little askew."""


@cache
def cell() -> Network:
    """1,500 spheres in a cube without walls, whose void ratio is that of its volume."""
    return packings.random_sample(1500, 1e5, seed=1, aspect=1.5, periodic=True).network()


def part_of(network: Network, kept, **columns) -> Network:
    """The spheres that are `kept`, with the contacts among them and with walls."""
    number = np.cumsum(kept) - 1
    i, j = network.particle_i, network.partner
    rows = kept[i] & (network.with_wall | kept[j])
    fewer = network.with_contacts(rows)
    ends = {"particle_i": number[fewer.particle_i]}
    ends["particle_j"] = np.where(fewer.with_wall, fewer.particle_j, number[fewer.partner])
    spheres = {name: data[kept] for name, data in network.bodies().items()}
    contacts = ("normal", "lever_i", "lever_j", "stiffness_normal", "stiffness_tangential")
    known = {name: getattr(fewer, name) for name in contacts}
    known |= {"overlap": fewer.overlap, "force_normal": fewer.force_normal}
    known |= {"force_tangential": fewer.force_tangential, "cell_shift": fewer.cell_shift}
    return replace(network, **spheres, **ends, **known, sliding=None, study={}, **columns)


def opened(network: Network, kept, axes) -> Network:
    """A part of a cell, in one three times as wide and without periods along these `axes`."""
    wide = np.isin([0, 1, 2], axes)
    crossing = (network.periods[:, wide] != 0).any(axis=1)
    inner = network.with_contacts(~crossing)
    size = np.where(wide, 3, 1) * network.cell_size
    periodic = network.cell_periodic & ~wide
    columns = {"cell_size": size, "cell_periodic": periodic}
    if wide[2]:
        columns["wall_position"] = np.array([-size[2] / 3, 2 * size[2] / 3])
    return part_of(replace(inner, **columns), kept, **columns)


def shapes(network: Network):
    """Names, spheres that are kept, and axes along which the cell is wider than these."""
    place = network.position / network.cell_size
    off_axis = np.hypot(*(place[:, :2] - 0.5).T)
    yield "layer", place[:, 2] < 0.7, [2]
    yield "wall of grains", place[:, 0] < 0.8, [0]
    yield "block", (place < 0.9).all(axis=1), [0, 1, 2]
    yield "cylinder", off_axis < 0.5, [0, 1, 2]
    yield "heap", off_axis < 0.6 * (1 - place[:, 2] / 1.2), [0, 1, 2]


@pytest.mark.parametrize("number", range(5))
def test_void_ratio_is_that_of_the_packing_it_was_cut_from(number):
    """Whatever its shape, within two of its errors, which are a few per cent."""
    network = cell()
    _, kept, axes = list(shapes(network))[number]
    piece = opened(network, kept, axes)
    occupied = occupied_part(piece)
    assert occupied.free.any(axis=1).tolist() == [axis in axes for axis in range(3)]
    assert occupied.cubes > 0
    assert occupied.void_ratio_error < 0.08
    wanted = void_ratio(network)
    assert void_ratio(piece) == pytest.approx(wanted, abs=2 * occupied.void_ratio_error)
    assert void_ratio(piece) == pytest.approx(wanted, rel=0.05)


@pytest.mark.parametrize("number", range(5))
def test_nothing_infinite_is_told(number):
    network = cell()
    _, kept, axes = list(shapes(network))[number]
    told = summary(opened(network, kept, axes))
    assert told["free_ends"]
    for name, value in told.items():
        assert name == "free_ends" or np.isfinite(value).all(), name


def test_layers_end_at_the_surface():
    """Void ratio of the bulk by caps of spheres, in layers: as by cubes."""
    network = cell()
    piece = opened(network, network.position[:, 2] < 0.7 * network.length, [2])
    layers = profile(piece)
    assert layers.bulk.any()
    bulk = 1 / (1 / (1 + layers.void_ratio[layers.bulk])).mean() - 1
    assert bulk == pytest.approx(void_ratio(network), rel=0.05)
    assert layers.edges[-1] - layers.edges[0] == pytest.approx(0.7 * network.length, rel=0.1)


def test_stress_is_over_the_volume_of_the_grains():
    """A piece of a packing under a pressure bears it inside: its mean is less by its skin alone."""
    network = cell()
    piece = opened(network, network.position[:, 2] < 0.7 * network.length, [2])
    lateral = np.array(summary(piece)["stress_pa"])[:2]
    assert lateral == pytest.approx([1e5, 1e5], rel=0.3)


def test_full_cells_have_no_free_end():
    for network in (cell(), packings.slender(), modal.fcc(cells=(2, 2, 5))):
        assert occupied_part(network) is None
        assert not summary(network).keys() & {"free_ends", "void_ratio_error"}


@cache
def deposit(upside_down: bool = False) -> Network:
    """Spheres on one wall, open above, whose springs carry their weight in a tilted box.

    The forces are those of the springs under the weight, so that each sphere is in balance to
    round-off; positions are those without weight.
    """
    network = packings.slender()
    kept = network.position[:, 2] < 0.6 * network.length
    if upside_down:
        kept = network.position[:, 2] > 0.4 * network.length
    height = network.length * np.array([0.0, 4.0] if not upside_down else [-3.0, 1.0])
    piece = part_of(network, kept, wall_position=height)
    piece = part_of(piece, keeping_contacts(piece, 4))
    stiffness = stiffness_matrix(piece).tocsc()
    # Spheres that spin freely are held by next to nothing.
    held = 1e-12 * stiffness.diagonal().mean() * sp.identity(stiffness.shape[0], format="csc")
    load = np.zeros((piece.n_particles, 6))
    load[:, :3] = piece.mass[:, None] * (-GRAVITY if upside_down else GRAVITY)
    motion = spsolve(stiffness + held, load.ravel()).reshape(-1, 6)
    tangent = contact_tangent(piece)[:, :3]
    force = np.einsum("cab,cb->ca", tangent, motion_of_contacts(piece, motion))
    along = -np.einsum("ca,ca->c", force, piece.normal)
    across = force + along[:, None] * piece.normal
    assert along.mean() > 0
    return replace(piece, force_normal=along, force_tangential=across)


@pytest.mark.parametrize("upside_down", [False, True])
def test_weight_is_told_with_its_size_and_direction(upside_down):
    network = deposit(upside_down)
    assert residual_forces(network).mean() > 0.1
    wanted = -GRAVITY if upside_down else GRAVITY
    assert gravity_of(network) == pytest.approx(wanted, rel=1e-3, abs=1e-3)
    assert unbalanced_forces(network).mean() < 1e-3
    told = plausibility(network)
    assert told["gravity_m_per_s2"] == pytest.approx(wanted, rel=1e-3, abs=1e-3)
    assert told["net_force_over_contact_force"] < 1e-3


def test_what_is_out_of_balance_beside_the_weight_is_told():
    network = deposit()
    force = network.force_normal.copy()
    force[force.argmax()] *= 1.5
    told = plausibility(replace(network, force_normal=force))
    assert told["largest_net_force_over_contact_force"] > 0.5


def test_no_weight_where_forces_are_mixed_up():
    """At rest without gravity, permuted, or of one sphere that moves: no weight explains it."""
    network = packings.slender()
    permuted = np.random.default_rng(1).permutation(network.force_normal)
    assert gravity_of(network) is None
    assert gravity_of(replace(network, force_normal=permuted)) is None


def test_waves_go_through_a_deposit(tmp_path, printed):
    """From its wall up, and from a plane: the layers are recorded though there is no chain."""
    network = deposit()
    signals = modal.propagate(network, 1e-4).signals
    assert not len(signals.chain_particle) and not len(signals.receiver_stress)
    assert abs(signals.layer_displacement[:, -1]).max() > 0
    middle = float(np.median(network.position[:, 2]))
    opened_plane = modal.propagate(network, 1e-4, source=Plane(middle)).signals
    assert abs(opened_plane.layer_displacement).max() > 0
    write_network(tmp_path / "a.network.h5", network)
    assert printed("wave", tmp_path / "a.network.h5")["largest_displacement_m"] > 0


def test_sources_that_move_nothing_are_refused():
    with pytest.raises(InputError) as refused:
        modal.propagate(deposit(upside_down=True), 1e-4)
    assert refused.value.code == "no_source_wall"
    with pytest.raises(InputError) as refused:
        modal.propagate(deposit(), 1e-4, source=Plane(0.9 * deposit().wall_position[1]))
    assert refused.value.code == "plane_beside_spheres"


def test_measure_tells_the_void_ratio_with_its_error():
    found = measure(deposit(), quantities=["void_ratio", "void_ratio_of_bulk", "residual"])
    error = occupied_part(deposit()).void_ratio_error
    assert found["void_ratio"].error == pytest.approx(error)
    assert np.isfinite(found["void_ratio"].value) and found["residual"].value < 1e-3
