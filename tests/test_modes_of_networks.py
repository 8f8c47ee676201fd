"""Lists of modes know the network that they are of, and refuse any other."""

import hashlib
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

import modal
from modal.modes.damped import decay_rates
from modal.modes.mode_set import ModeSet, read_modes, write_modes
from modal.packing.network import Network, write_network
from modal.system.damping import ContactDamping


@pytest.fixture(scope="module")
def network() -> Network:
    return modal.random_packing(spheres=100, seed=3, aspect=2.5)


@pytest.fixture
def modes(network) -> ModeSet:
    """Return three modes; a test may change their attributes."""
    return modal.eigenmodes(network, lowest=3)


def assert_refused(modes, network):
    """Assert that what needs the network of a list of modes refuses this one."""
    with refusal("modes_of_another_network"):
        modes.participation(network)
    with refusal("modes_of_another_network"):
        decay_rates(modes, network, ContactDamping(0.1, 0.1))


@pytest.fixture(params=["memory", "file"])
def any_modes(request, modes, tmp_path) -> ModeSet:
    """Return the modes as they were computed, or as they are read from a file."""
    if request.param == "memory":
        return modes
    write_modes(tmp_path / "a.modes.h5", modes)
    return read_modes(tmp_path / "a.modes.h5")


def test_network_of_the_modes_is_known(any_modes, network):
    assert any_modes.participation(replace(network)).shape == (3,)


def test_other_spheres_of_the_same_mass_are_refused(any_modes):
    assert_refused(any_modes, modal.random_packing(spheres=100, seed=4))


def test_fewer_spheres_are_refused(any_modes):
    assert_refused(any_modes, modal.fcc(cells=(1, 1, 8)))


@pytest.mark.parametrize(
    "change",
    [
        lambda network: {"stiffness_normal": network.stiffness_normal * 1.001},
        lambda network: {"stiffness_tangential": network.stiffness_tangential * 0.5},
        lambda network: {"force_normal": network.force_normal * 1.001},
        lambda network: {"sliding": np.arange(network.n_contacts) == 7},
        lambda network: {"cell_size": network.cell_size * (1 + 1e-9)},
        lambda network: {"cell_shift": None},
        lambda network: {
            "stiffness_rolling": np.zeros(network.n_contacts),
            "stiffness_twisting": np.zeros(network.n_contacts),
        },
    ],
    ids=["kn", "kt", "forces", "sliding", "cell", "periods", "rolling and twisting"],
)
def test_same_spheres_with_other_contacts_are_refused(change, modes, network):
    """Refuse them although no sphere has moved."""
    other = replace(network, **change(network))
    assert other.fingerprint != network.fingerprint
    assert_refused(modes, other)


def test_same_spheres_with_fewer_contacts_are_refused(modes, network):
    other = network.with_contacts(slice(1, None))
    assert other.fingerprint != network.fingerprint
    assert_refused(modes, other)


@pytest.mark.parametrize(
    "change",
    [
        deepcopy,
        lambda network: replace(network, study={"seed": 7}),
        lambda network: replace(network, particle_i=network.particle_i.astype("i4")),
    ],
    ids=["copy", "other notes", "other integers"],
)
def test_copy_of_the_network_is_known(change, modes, network):
    assert modes.participation(change(network)).shape == (3,)


def test_network_that_was_written_and_read_is_known(modes, network, tmp_path):
    write_network(tmp_path / "a.network.h5", network)
    assert modes.participation(modal.read(tmp_path / "a.network.h5")).shape == (3,)


def test_modes_with_sliding_contacts_are_of_the_network_that_slides(network):
    sliding = replace(network, sliding=np.arange(network.n_contacts) % 5 == 0)
    modes = modal.eigenmodes(sliding, lowest=3, sliding="slip")
    assert modes.participation(sliding).shape == (3,)
    assert_refused(modes, network)


@pytest.fixture
def early_modes(modes, network) -> ModeSet:
    """Return modes as version 0.1.0 has written them.

    They hold the digest of position, radius, mass and inertia by rows.
    """
    rows = np.column_stack([network.position, network.radius, network.mass, network.inertia])
    modes.attributes["packing"] = hashlib.sha256(rows.tobytes()).hexdigest()
    return modes


def test_modes_of_earlier_files_know_their_packing_by_its_spheres(early_modes, network):
    assert early_modes.participation(network).shape == (3,)


def test_modes_of_earlier_files_refuse_other_spheres(early_modes):
    assert_refused(early_modes, modal.random_packing(spheres=100, seed=4))
