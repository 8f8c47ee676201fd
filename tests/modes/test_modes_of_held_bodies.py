"""Modes of packings whose bodies cannot make some motions, against matrices without those rows."""

from dataclasses import replace

import numpy as np
import pytest
from held_packings import (
    between_rough_walls,
    dense_squares_of_free,
    free_rows,
    held_at_random,
    signed_squares,
    with_inertia_tensors,
)
from oracles import slow_stiffness
from packings import polydisperse, sheared
from scipy.linalg import eig, eigh

import modal
from modal.modes.collective import every_floppy
from modal.modes.damped import damped_modes
from modal.packing.crystal import column, fcc
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem

pytestmark = pytest.mark.two_ways

FLOPPY = 1e-9
"""Largest omega^2 of a floppy mode, divided by the largest of all."""


@pytest.fixture(scope="module")
def small():
    """Return 60 spheres of several sizes, some of them held: few rows for dense matrices."""
    return held_at_random(polydisperse())


@pytest.fixture(scope="module")
def partly_held():
    """Return 150 spheres with friction, enough for lists of modes to be computed by Lanczos."""
    return held_at_random(sheared())


@pytest.fixture(scope="module")
def exact(partly_held):
    """Return all frequencies, Hz, of the elastic modes of `partly_held`, ascending."""
    square = dense_squares_of_free(partly_held)
    return np.sqrt(square[square > FLOPPY * square[-1]]) / (2 * np.pi)


@pytest.fixture(scope="module")
def n_floppy(partly_held, exact):
    """Return the number of floppy modes of `partly_held`."""
    return partly_held.degrees_of_freedom - len(exact)


@pytest.mark.parametrize("pre_stress", ["none", "normal"])
def test_all_modes_are_those_of_the_matrices_without_held_rows(small, pre_stress):
    modes = modal.eigenmodes(small, all=True, pre_stress=pre_stress)
    square = dense_squares_of_free(small, pre_stress)
    assert len(modes.frequency) == small.degrees_of_freedom < 6 * small.n_particles
    # Round-off of a dense solver is some eps of the largest.
    assert abs(signed_squares(modes.frequency) - square).max() < 1e-12 * square[-1]
    assert not modes.mode_shape[:, small.fixed].any()
    assert modes.floppy_modes == (abs(square) < FLOPPY * square[-1]).sum()


def test_modes_of_translations_alone(small):
    modes = modal.eigenmodes(small, all=True, translations_only=True)
    rows = np.flatnonzero(small.free_motions[:, :3])
    K = stiffness_matrix(small, 3).toarray()[np.ix_(rows, rows)]
    M = np.diag(mass_diagonal(small, 3)[rows])
    square = eigh(K, M, eigvals_only=True)
    assert abs(signed_squares(modes.frequency) - square).max() < 1e-12 * square[-1]


def assert_certified_modes(modes, frequency, fixed):
    """Compare a list of modes with exact frequencies; held motions have no part in it."""
    assert modes.certified, modes.attributes
    np.testing.assert_allclose(modes.frequency, frequency, rtol=1e-9)
    assert not modes.mode_shape[:, fixed].any()


def test_lowest_modes(partly_held, exact):
    modes = modal.eigenmodes(partly_held, lowest=9)
    assert_certified_modes(modes, exact[:9], partly_held.fixed)


def test_highest_modes(partly_held, exact):
    modes = modal.eigenmodes(partly_held, highest=4)
    assert_certified_modes(modes, exact[-4:], partly_held.fixed)


def test_modes_between_two_frequencies(partly_held, exact):
    interval = (exact[100] * 0.9999, exact[119] * 1.0001)
    modes = modal.eigenmodes(partly_held, between=interval)
    assert_certified_modes(modes, exact[100:120], partly_held.fixed)


def test_counts_of_modes(partly_held, exact, n_floppy):
    below = np.array([0, 57, 200])
    between_modes = (exact[below] + exact[below + 1]) / 2
    counts = modal.count_modes(partly_held, between_modes)
    assert counts.tolist() == (n_floppy + below + 1).tolist()
    assert modal.count_modes(partly_held, 10 * exact[-1]) == partly_held.degrees_of_freedom


def test_number_of_floppy_modes(partly_held, n_floppy):
    assert every_floppy(LinearSystem.of(partly_held)).total == n_floppy


def test_floppy_modes_of_a_free_body():
    """Count the three free motions of a sphere with no contact."""
    pair = fcc(cells=(1, 1, 2)).with_contacts(slice(0))
    fixed = np.zeros((2, 6), bool)
    fixed[0] = True
    fixed[1, 2:5] = True
    floppy = every_floppy(LinearSystem.of(replace(pair, fixed=fixed)))
    assert floppy.kinds["free_particles"] == 3
    assert floppy.total == 3


def test_floppy_modes_of_a_plane_column_without_tangential_springs():
    """Count one translation across and one turn of each of three spheres in a plane."""
    chain = column(3)
    fixed = np.zeros((3, 6), bool)
    fixed[:, [1, 3, 5]] = True
    chain = replace(chain, stiffness_tangential=0 * chain.stiffness_tangential, fixed=fixed)
    square = dense_squares_of_free(chain)
    assert (square < FLOPPY * square[-1]).sum() == 6
    assert every_floppy(LinearSystem.of(chain)).total == 6


@pytest.fixture(scope="module", params=[1e-3, 0.03], ids=["exact traces", "random vectors"])
def states(partly_held, request):
    """Return the density of states to a tolerance that needs exact traces, or random vectors."""
    return modal.density_of_states(partly_held, tolerance=request.param)


# An estimate from random vectors has a standard error; five of them are allowed.


def test_density_has_the_floppy_modes(states, n_floppy):
    assert states.zero_modes.sum() == pytest.approx(n_floppy)


def test_density_counts_the_free_motions(partly_held, states):
    """Compare the total, and the number of free motions of each component."""
    value, error = states.count_below([states.highest])
    n_free = [*partly_held.free_motions.sum(axis=0), partly_held.degrees_of_freedom]
    assert (abs(value[0] - n_free) <= 5 * error[0] + 1e-6).all()


def test_density_counts_the_modes_below_their_median(partly_held, states, exact):
    """Leave out modes within 3 % of it: the kernel is a hundredth of the spectrum wide."""
    median = float(np.median(exact))
    value, error = states.count_below([median])
    below = partly_held.degrees_of_freedom - len(exact) / 2
    uncertain = (abs(exact / median - 1) < 0.03).sum()
    assert abs(value[0, 6] - below) < uncertain + 5 * error[0, 6]


def test_modes_of_bodies_with_a_tensor_of_inertia():
    """Hold some turns of bodies: the remaining rows of M have an inverse root of their own."""
    network = with_inertia_tensors()
    M = np.diag(mass_diagonal(network))
    for k in range(network.n_particles):
        turns = slice(6 * k + 3, 6 * k + 6)
        M[turns, turns] = network.inertia_tensor[k]
    rows = np.ix_(free_rows(network), free_rows(network))
    square = eigh(slow_stiffness(network)[rows], M[rows], eigvals_only=True)
    frequency = modal.eigenmodes(network, all=True).frequency
    assert abs(signed_squares(frequency) - square).max() < 1e-11 * square[-1]


def test_damped_modes():
    """Compare four modes near 0.3 of the highest frequency with those of the dense pencil."""
    rough = between_rough_walls(polydisperse(n=40))
    damping = ContactDamping(0.02, 0.03)
    highest = LinearSystem.of(rough).highest_frequency
    modes = damped_modes(rough, damping, near=0.3 * highest, count=4)
    rows = free_rows(rough)
    mass = mass_diagonal(rough)[rows, None]
    K = stiffness_matrix(rough).toarray()[np.ix_(rows, rows)] / mass
    C = stiffness_matrix(damping.dashpots(rough)).toarray()[np.ix_(rows, rows)] / mass
    # Time in units of 1 / omega_max, which balances the blocks of the state matrix.
    unit = 2 * np.pi * highest
    identity = np.eye(len(rows))
    state = np.block([[0 * identity, identity], [-K / unit**2, -C / unit]])
    rate = eig(state, right=False) * unit
    forwards = rate[rate.imag > 0.05 * unit]
    distance = abs(forwards - 2j * np.pi * 0.3 * highest)
    nearest = forwards[np.argsort(distance)[:4]]
    exact = np.sort(nearest.imag) / (2 * np.pi)
    np.testing.assert_allclose(modes.frequency, exact, rtol=1e-8)
    assert not modes.shape[:, rough.fixed].any()
