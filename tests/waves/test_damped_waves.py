"""Viscous contacts: the damped chain, quadratic eigenproblems, a response from its wave."""

import numpy as np
import pytest
from changes import stiffer
from refusals import refusal
from scipy.linalg import eig

import modal
from modal.modes.damped import damped_modes, decay_rates
from modal.packing.crystal import column
from modal.solvers import arnoldi
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.theory.fcc import FccLattice

CRYSTAL = FccLattice(1e5)
DAMPING = ContactDamping(0.05, 0.03)


def layer_dashpot(damping: ContactDamping) -> float:
    """Return the dashpot between layers of the crystal, N s/m for each sphere.

    It is 2 (cn + ct), like the springs of Eq. 8.
    """
    critical = [2 * np.sqrt(k * CRYSTAL.mass / 2) for k in (CRYSTAL.kn, CRYSTAL.kt)]
    return 2 * (damping.normal * critical[0] + damping.tangential * critical[1])


def test_complex_modes_against_a_dense_quadratic_eigenproblem():
    network = modal.random_packing(spheres=60, seed=5)
    system = LinearSystem.of(network)
    A = system.dynamical_matrix.toarray()
    size = system.size
    scale = 1 / np.sqrt(mass_diagonal(network))
    C = scale[:, None] * stiffness_matrix(DAMPING.dashpots(network)).toarray() * scale
    w = 1e6  # a unit of rate in which both halves of the companion are of one size
    companion = np.block([[np.zeros((size, size)), np.eye(size)], [-A / w**2, -C / w]])
    rates = eig(companion, right=False) * w
    # Of a pair of conjugates one; the mode of zero energy is no oscillation.
    rates = rates[rates.imag > 1.0]
    for near in (1e2, 2e4, 1e5):
        modes = damped_modes(network, DAMPING, near=near, count=6)
        rate = -modes.decay + 2j * np.pi * modes.frequency
        exact = rates[np.argsort(abs(rates - 2j * np.pi * near))[:6]]
        exact = exact[np.argsort(exact.imag)]
        # Round-off of the companion's largest entries against those of the mode.
        assert rate == pytest.approx(exact, rel=1e-8)
        # Arnoldi's 1e-10 of the inverse, times |A| / |lambda|^2 of some 500 for the slowest.
        assert modes.residual.max() < 5e-8
        assert modes.quality == pytest.approx(abs(exact) / (-2 * exact.real), rel=1e-6)


def smooth_ends(network, contacts, mass):
    """Return spheres with some of their contacts, other masses, and normal springs alone."""
    smooth = stiffer(network.with_contacts(np.array(contacts)), 1, 0)
    mass = np.array(mass)
    return smooth.unchecked(mass=mass, inertia=0.4 * mass * network.radius**2)


PAIR = smooth_ends(column(2), [1], [1e-5, 8e-5])
AT_WALL = smooth_ends(column(1), [0], [2e-5])


@pytest.mark.parametrize(("network", "effective"), [(PAIR, 8e-5 / 9), (AT_WALL, 2e-5)])
@pytest.mark.parametrize("beta", [0.1, 0.7])
def test_ratios_are_those_of_the_critical_damping(network, effective, beta):
    """Compare with one spring: lambda^2 + 2 beta omega lambda + omega^2 = 0.

    omega^2 is k / m*. m* of masses m and 8 m is 8/9 m; at a wall it is the mass of the sphere.
    """
    omega = np.sqrt(network.stiffness_normal[0] / effective)
    near = omega / (2 * np.pi) / 3
    modes = damped_modes(network, ContactDamping(beta, 0), near=near, count=1)
    exact = omega * np.sqrt(1 - beta**2) / (2 * np.pi)
    # Arnoldi's rates have converged to 1e-10 of themselves.
    assert modes.frequency == pytest.approx([exact], rel=1e-9)
    assert modes.decay == pytest.approx([beta * omega], rel=1e-9)


@pytest.mark.parametrize(
    ("beta", "count"),
    [
        pytest.param(0.1, 2, id="the conjugate of a mode, or rigid motion"),
        pytest.param(1.5, 1, id="overdamped motion"),
    ],
)
def test_only_what_oscillates_is_a_mode(beta, count):
    with refusal("mode_count"):
        damped_modes(PAIR, ContactDamping(beta, 0), near=1e3, count=count)


def test_negative_frequency_is_refused():
    with refusal("frequency", "-5"):
        damped_modes(PAIR, DAMPING, near=-5.0)


def test_fraction_of_a_mode_is_refused():
    with refusal("argument", "1.5"):
        damped_modes(PAIR, ContactDamping(0.1, 0), near=1e3, count=1.5)


def test_modes_that_do_not_converge_are_said_in_one_line(monkeypatch):
    """Allow Arnoldi's iteration one restart for forty of thousands of nearly equal rates."""
    crystal = modal.fcc(cells=(2, 2, 12))
    eigs = arnoldi.eigs
    monkeypatch.setattr(arnoldi, "eigs", lambda *a, **k: eigs(*a, **k | {"maxiter": 1, "ncv": 43}))
    with refusal("not_converged", "150000"):
        damped_modes(crystal, DAMPING, near=1.5e5, count=40)


def test_modes_of_the_endless_crystal_decay_as_its_chain_does():
    """Compare with m lambda^2 + (C + lambda D) 4 sin^2(kappa l / 2) = 0.

    kappa is a wave number of the cell.
    """
    network = modal.fcc(cells=(1, 1, 8), periodic_z=True)
    kappa = 2 * np.pi * 2 / network.length
    s2 = 4 * np.sin(kappa * CRYSTAL.layer_distance / 2) ** 2
    roots = np.roots([CRYSTAL.mass, layer_dashpot(DAMPING) * s2, CRYSTAL.C * s2])
    exact_rate = roots[roots.imag > 0][0]
    modes = damped_modes(network, DAMPING, near=exact_rate.imag / (2 * np.pi), count=6)
    rate = -modes.decay + 2j * np.pi * modes.frequency
    # Arnoldi's rates have converged to 1e-10 of themselves.
    assert abs(rate / exact_rate - 1).min() < 1e-9


def test_decay_of_elastic_modes_is_that_of_little_damping():
    """Compare to first order in the damping, off by its square; the sum of all rates is exact."""
    little = ContactDamping(0.005, 0.003)
    crystal = modal.fcc(cells=(1, 1, 20))
    elastic = modal.eigenmodes(crystal, lowest=120)
    rates = decay_rates(elastic, crystal, little)
    exact = damped_modes(crystal, little, near=4e3, count=3)
    near = np.argsort(abs(elastic.frequency - 4e3))[:3]
    assert np.sort(rates[near]) == pytest.approx(np.sort(exact.decay), rel=1e-3)
    total = stiffness_matrix(little.dashpots(crystal)).diagonal() / mass_diagonal(crystal)
    assert rates.sum() == pytest.approx(total.sum() / 2, rel=1e-9)
