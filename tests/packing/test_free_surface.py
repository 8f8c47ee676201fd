"""Tests of packings with free surfaces: filled volume, weight, waves."""

from dataclasses import replace
from functools import cache

import numpy as np
import packings
import pytest
import scipy.sparse as sp
from refusals import refusal
from scipy.sparse.linalg import spsolve

import modal
from analysis import measure
from modal.packing.network import Network, write_network
from modal.packing.occupied import core_solid_fractions, occupied_part
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
"""m/s^2, slightly inclined."""


@cache
def cell() -> Network:
    """Return 1,500 spheres in a periodic cube, whose void ratio is that of its volume."""
    return packings.random_sample(
        1500, 1e5, seed=1, aspect=1.5, tolerance=1e-2, periodic=True
    ).network()


CONTACT_COLUMNS = (
    "normal",
    "lever_i",
    "lever_j",
    "stiffness_normal",
    "stiffness_tangential",
    "overlap",
    "force_normal",
    "force_tangential",
    "cell_shift",
)


def part_of(network: Network, inside, **columns) -> Network:
    """Return the spheres that are `inside` (n,), with the contacts among them and with walls."""
    number = np.cumsum(inside) - 1
    has_both_ends = inside[network.particle_i] & (network.with_wall | inside[network.partner])
    part = network.with_contacts(has_both_ends)
    spheres = {name: data[inside] for name, data in network.bodies().items()}
    contacts = {name: getattr(part, name) for name in CONTACT_COLUMNS}
    return replace(
        network,
        **spheres,
        **contacts,
        particle_i=number[part.particle_i],
        particle_j=np.where(part.with_wall, part.particle_j, number[part.partner]),
        sliding=None,
        study={},
        **columns,
    )


def opened(network: Network, inside, axes) -> Network:
    """Return a part of a cell, in one three times as wide and without periods along `axes`."""
    wide = np.isin([0, 1, 2], axes)
    crossing = (network.periods[:, wide] != 0).any(axis=1)
    inner = network.with_contacts(~crossing)
    size = np.where(wide, 3, 1) * network.cell_size
    periodic = network.cell_periodic & ~wide
    columns = {"cell_size": size, "cell_periodic": periodic}
    if wide[2]:
        columns["wall_position"] = np.array([-size[2] / 3, 2 * size[2] / 3])
    return part_of(replace(inner, **columns), inside, **columns)


def shapes(network: Network):
    """Return name -> spheres inside (n,), and axes along which the cell is wider than these."""
    place = network.position / network.cell_size
    off_axis = np.hypot(*(place[:, :2] - 0.5).T)
    return {
        "layer": (place[:, 2] < 0.7, [2]),
        "wall of grains": (place[:, 0] < 0.8, [0]),
        "block": ((place < 0.9).all(axis=1), [0, 1, 2]),
        "cylinder": (off_axis < 0.5, [0, 1, 2]),
        "heap": (off_axis < 0.6 * (1 - place[:, 2] / 1.2), [0, 1, 2]),
    }


SHAPES = ("layer", "wall of grains", "block", "cylinder", "heap")


@pytest.mark.parametrize("shape", SHAPES)
def test_void_ratio_is_that_of_the_packing_it_was_cut_from(shape):
    """Find it within two of its errors, which are a few per cent."""
    network = cell()
    inside, axes = shapes(network)[shape]
    piece = opened(network, inside, axes)
    occupied = occupied_part(piece)
    assert occupied.free.any(axis=1).tolist() == [axis in axes for axis in range(3)]
    assert occupied.cubes > 0
    assert occupied.void_ratio_error < 0.08
    expected = void_ratio(network)
    assert void_ratio(piece) == pytest.approx(expected, abs=2 * occupied.void_ratio_error)
    assert void_ratio(piece) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_summary_has_finite_numbers(shape):
    network = cell()
    inside, axes = shapes(network)[shape]
    numbers = summary(opened(network, inside, axes))
    assert numbers["free_ends"]
    for name, value in numbers.items():
        assert name == "free_ends" or np.isfinite(value).all(), name


def test_layers_end_at_the_surface():
    """Compare the void ratio of the bulk, by caps of spheres in layers, with that of cubes."""
    network = cell()
    piece = opened(network, network.position[:, 2] < 0.7 * network.length, [2])
    layers = profile(piece)
    assert layers.bulk.any()
    bulk = 1 / (1 / (1 + layers.void_ratio[layers.bulk])).mean() - 1
    assert bulk == pytest.approx(void_ratio(network), rel=0.05)
    assert layers.edges[-1] - layers.edges[0] == pytest.approx(0.7 * network.length, rel=0.1)


def test_stress_is_over_the_volume_of_the_grains():
    """Find the pressure of the packing in a piece of it, which is lower only in its skin."""
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
    """Return spheres on one wall, free above, whose springs carry their weight in a tilted box.

    The forces are those of the springs under the weight, so that each sphere is in balance to
    round-off; positions are those without weight.
    """
    network = packings.slender()
    inside = network.position[:, 2] < 0.6 * network.length
    walls = network.length * np.array([0.0, 4.0])
    if upside_down:
        inside = network.position[:, 2] > 0.4 * network.length
        walls = network.length * np.array([-3.0, 1.0])
    piece = part_of(network, inside, wall_position=walls)
    piece = part_of(piece, keeping_contacts(piece, 4))
    stiffness = stiffness_matrix(piece).tocsc()
    # A very weak spring holds spheres that spin freely.
    weak_springs = (
        1e-12 * stiffness.diagonal().mean() * sp.identity(stiffness.shape[0], format="csc")
    )
    load = np.zeros((piece.n_particles, 6))
    load[:, :3] = piece.mass[:, None] * (-GRAVITY if upside_down else GRAVITY)
    motion = spsolve(stiffness + weak_springs, load.ravel()).reshape(-1, 6)
    tangent = contact_tangent(piece)[:, :3]
    force = np.einsum("cab,cb->ca", tangent, motion_of_contacts(piece, motion))
    normal_force = -np.einsum("ca,ca->c", force, piece.normal)
    tangential_force = force + normal_force[:, None] * piece.normal
    assert normal_force.mean() > 0
    return replace(piece, force_normal=normal_force, force_tangential=tangential_force)


@pytest.mark.parametrize("upside_down", [False, True])
def test_weight_is_reported_with_its_size_and_direction(upside_down):
    network = deposit(upside_down)
    assert residual_forces(network).mean() > 0.1
    gravity = -GRAVITY if upside_down else GRAVITY
    assert gravity_of(network) == pytest.approx(gravity, rel=1e-3, abs=1e-3)
    assert unbalanced_forces(network).mean() < 1e-3
    numbers = plausibility(network)
    assert numbers["gravity_m_per_s2"] == pytest.approx(gravity, rel=1e-3, abs=1e-3)
    assert numbers["net_force_over_contact_force"] < 1e-3


def test_a_net_force_besides_the_weight_is_reported():
    network = deposit()
    force = network.force_normal.copy()
    force[force.argmax()] *= 1.5
    numbers = plausibility(replace(network, force_normal=force))
    assert numbers["largest_net_force_over_contact_force"] > 0.5


def test_forces_at_rest_or_permuted_show_no_weight():
    network = packings.slender()
    permuted = np.random.default_rng(1).permutation(network.force_normal)
    assert gravity_of(network) is None
    assert gravity_of(replace(network, force_normal=permuted)) is None


def test_waves_go_through_a_deposit(tmp_path, printed):
    """Record the layers of waves from the wall and from a plane, though there is no chain."""
    network = deposit()
    signals = modal.propagate(network, 1e-4).signals
    assert len(signals.chain_particle) == 0
    assert len(signals.receiver_stress) == 0
    assert abs(signals.layer_displacement[:, -1]).max() > 0
    middle = float(np.median(network.position[:, 2]))
    opened_plane = modal.propagate(network, 1e-4, source=Plane(middle)).signals
    assert abs(opened_plane.layer_displacement).max() > 0
    write_network(tmp_path / "a.network.h5", network)
    assert printed("wave", tmp_path / "a.network.h5")["largest_displacement_m"] > 0


def test_sources_that_move_nothing_are_refused():
    with pytest.raises(InputError) as error_info:
        modal.propagate(deposit(upside_down=True), 1e-4)
    assert error_info.value.code == "no_source_wall"
    with refusal("plane_beside_spheres"):
        modal.propagate(deposit(), 1e-4, source=Plane(0.9 * deposit().wall_position[1]))


def test_measure_gives_the_void_ratio_an_error():
    values = measure(deposit(), quantities=["void_ratio", "void_ratio_of_bulk", "residual"])
    error = occupied_part(deposit()).void_ratio_error
    assert values["void_ratio"].error == pytest.approx(error)
    assert np.isfinite(values["void_ratio"].value)
    assert values["residual"].value < 1e-3


def test_a_packing_without_a_height_fills_no_part_of_its_cell():
    """Put spheres at one height, with free sides along x and y, and without walls."""
    network = opened(cell(), np.ones(1500, bool), (0, 1))
    assert occupied_part(network) is not None
    no_walls = np.zeros(2)
    flat = network.unchecked(cell_periodic=np.zeros(3, bool), wall_position=no_walls)
    assert occupied_part(flat) is None


def test_a_packing_that_floats_ends_as_far_from_its_middle_above_as_below():
    """Move both ends, by as much, to where the packing would be equally dense."""
    network = opened(cell(), cell().position[:, 2] < 0.7 * cell().length, (2,))
    occupied = occupied_part(network)
    assert occupied.free_names == ["-z", "+z"]
    height = network.position[:, 2]
    outermost = (height - network.radius).min() + (height + network.radius).max()
    assert occupied.low + occupied.high == pytest.approx(outermost, abs=1e-9)


def test_each_free_end_adds_its_roughness_to_the_error_of_a_small_packing():
    """Add half a diameter at each of two free ends of a packing without a core."""
    network = opened(cell(), cell().position[:, 2] < 3 * cell().radius[0], (2,))
    floating = occupied_part(network)
    assert floating.cubes == 0
    assert floating.free_names == ["-z", "+z"]
    height = float(np.ptp(network.position[:, 2]))
    relative = floating.void_ratio_error / (1 + floating.void_ratio)
    assert relative == pytest.approx(2 * 0.5 * 2 * network.radius.mean() / height, rel=1e-9)


def test_the_error_of_a_void_ratio_follows_from_the_scatter_of_many_cubes():
    """Compare with the standard error of the mean over cubes, by e = 1 / fraction - 1.

    With a few cubes a tenth is assumed.
    """
    network = opened(cell(), cell().position[:, 2] < 0.7 * cell().length, (2,))
    fractions = core_solid_fractions(network)
    assert len(fractions) >= 8
    standard_error = fractions.std(ddof=1) / len(fractions) ** 0.5
    expected = standard_error / fractions.mean() ** 2
    assert occupied_part(network).void_ratio_error == pytest.approx(expected)
