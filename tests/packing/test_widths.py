"""Tests that arrays of other widths, orders and layouts give the same numbers."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

import modal
from modal.packing.network import Network, read_network, write_network
from modal.system.operator import ContactOperator

CRYSTAL = modal.fcc(cells=(2, 2, 30))
"""120 spheres: an index of one byte does not hold six times their number, two bytes would."""
FREE = CRYSTAL.with_contacts(~CRYSTAL.with_wall)
"""Without walls, whose numbers are negative."""
SIGNED = ("i1", "i2", "<i4", ">i2", ">i4", ">i8")
UNSIGNED = ("u1", "u2", "u4", "u8", ">u2", ">u8")


def with_indices(network: Network, width: str) -> Network:
    """Return the network with all columns of integers that fit into this width."""
    columns = {name: getattr(network, name) for name in ("particle_i", "particle_j", "cell_shift")}
    info = np.iinfo(width)
    fits = {
        name: data.astype(width)
        for name, data in columns.items()
        if info.min <= data.min() and data.max() <= info.max
    }
    assert {"particle_i", "particle_j"} <= fits.keys()
    return replace(network, **fits)


@pytest.mark.parametrize("width", SIGNED)
def test_signed_indices_of_any_width_give_the_same_waves_and_moduli(width):
    narrow = with_indices(CRYSTAL, width)
    same_numbers(narrow, CRYSTAL)
    first = modal.propagate(CRYSTAL, 3e-5).signals
    second = modal.propagate(narrow, 3e-5).signals
    for name in ("source_stress", "receiver_stress"):
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))
    settings = {"resolution": 5e3, "highest": 5e4}
    first = modal.frequency_response(CRYSTAL, **settings)
    second = modal.frequency_response(narrow, **settings)
    np.testing.assert_array_equal(second.gain, first.gain)
    stiffness = modal.elastic_moduli(narrow).stiffness
    np.testing.assert_array_equal(stiffness, modal.elastic_moduli(CRYSTAL).stiffness)


@pytest.mark.parametrize("width", UNSIGNED)
def test_indices_without_a_sign_give_the_same_springs(width):
    same_numbers(with_indices(FREE, width), FREE)


def same_numbers(network: Network, other: Network) -> None:
    """Assert that fingerprints and K u agree to the bit."""
    assert network.fingerprint == other.fingerprint
    assert network.particle_i.dtype.isnative
    assert network.particle_i.dtype.itemsize >= 4
    motion = np.random.default_rng(0).standard_normal(6 * network.n_particles)
    force = ContactOperator(other).apply(motion)
    np.testing.assert_array_equal(ContactOperator(network).apply(motion), force)


@pytest.mark.parametrize("column", ["particle_i", "particle_j", "cell_shift"])
def test_a_negative_number_that_has_lost_its_sign_is_refused(column, tmp_path):
    """Refuse 2^64 - 1, which is -1 in 8 bytes without a sign: no wall, and no sphere."""
    lost = getattr(CRYSTAL, column).astype(np.uint64)
    lost[5] = 2**64 - 1
    with refusal("whole_number_too_large"):
        replace(CRYSTAL, **{column: lost})


def test_other_orders_and_layouts_in_memory_are_the_same_network(tmp_path):
    """Pass every second row, a reversed view, columns in memory order, and swapped bytes."""
    doubled = np.repeat(CRYSTAL.position, 2, axis=0)[::2]
    converted = replace(
        CRYSTAL,
        position=doubled,
        mass=CRYSTAL.mass[::-1].copy()[::-1],
        normal=np.asfortranarray(CRYSTAL.normal),
        lever_i=CRYSTAL.lever_i.astype(">f8"),
        stiffness_normal=CRYSTAL.stiffness_normal.astype(np.longdouble),
        particle_i=np.repeat(CRYSTAL.particle_i, 3)[::3],
        cell_periodic=CRYSTAL.cell_periodic.astype("u1"),
    )
    same_numbers(converted, CRYSTAL)
    assert converted.position.flags.c_contiguous
    assert converted.normal.flags.c_contiguous
    write_network(tmp_path / "a.network.h5", converted)
    same_numbers(read_network(tmp_path / "a.network.h5"), CRYSTAL)


def test_radii_of_two_bytes_are_taken_for_the_numbers_that_they_are():
    """Pass a radius of 0.5 m, which two bytes hold exactly."""
    n = CRYSTAL.n_particles
    scale = 0.5 / CRYSTAL.radius[0]
    big = replace(
        CRYSTAL,
        position=scale * CRYSTAL.position,
        radius=np.full(n, 0.5),
        mass=scale**3 * CRYSTAL.mass,
        inertia=scale**5 * CRYSTAL.inertia,
        lever_i=scale * CRYSTAL.lever_i,
        lever_j=scale * CRYSTAL.lever_j,
        cell_size=scale * CRYSTAL.cell_size,
        wall_position=scale * CRYSTAL.wall_position,
        overlap=scale * CRYSTAL.overlap,
        force_normal=scale * CRYSTAL.force_normal,
    )
    same_numbers(replace(big, radius=big.radius.astype(np.float16)), big)


@pytest.mark.parametrize("lock", ["whole", "view", "unlocked again", "flagged base"])
def test_an_array_that_somebody_else_can_write_to_is_copied(lock):
    """Find a copy however it is flagged: an earlier view, or its owner, may write to it."""
    mass = np.full(CRYSTAL.n_particles, CRYSTAL.mass[0])
    early = mass[:]
    argument = mass
    if lock == "view":
        argument = mass.view()
        argument.flags.writeable = False
    else:
        mass.flags.writeable = False
    if lock == "flagged base":
        argument = mass[:]
    network = replace(CRYSTAL, mass=argument)
    if lock == "unlocked again":
        mass.flags.writeable = True
        mass[0] = 7.0
    early[1] = 7.0
    assert (network.mass == CRYSTAL.mass[0]).all()


def test_columns_of_a_network_are_shared_with_those_made_from_it():
    """Find no copy, as they cannot be written to."""
    other = replace(CRYSTAL, study={})
    assert np.shares_memory(other.position, CRYSTAL.position)
    assert np.shares_memory(CRYSTAL.some(slice(3, 9)).normal, CRYSTAL.normal)
