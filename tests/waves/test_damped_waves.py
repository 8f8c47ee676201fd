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
    """Between layers of the crystal, for each sphere, N s/m: 2 (cn + ct), as Eq. 8 of springs."""
    critical = [2 * np.sqrt(k * CRYSTAL.mass / 2) for k in (CRYSTAL.kn, CRYSTAL.kt)]
    return 2 * (damping.normal * critical[0] + damping.tangential * critical[1])


def test_complex_modes_against_a_dense_quadratic_eigenproblem():
    network = modal.random_packing(spheres=60, seed=5)
    system = LinearSystem.of(network)
    A, size = system.dynamical_matrix.toarray(), system.size
    scale = 1 / np.sqrt(mass_diagonal(network))
    C = scale[:, None] * stiffness_matrix(DAMPING.dashpots(network)).toarray() * scale
    w = 1e6  # a unit of rate in which both halves of the companion are of one size
    companion = np.block([[np.zeros((size, size)), np.eye(size)], [-A / w**2, -C / w]])
    every = eig(companion, right=False) * w
    # Of a pair of conjugates one; the mode of zero energy is no oscillation.
    every = every[every.imag > 1.0]
    for near in (1e2, 2e4, 1e5):
        found = damped_modes(network, DAMPING, near=near, count=6)
        rate = -found.decay + 2j * np.pi * found.frequency
        wanted = every[np.argsort(abs(every - 2j * np.pi * near))[:6]]
        wanted = wanted[np.argsort(wanted.imag)]
        # Round-off of the companion's largest entries against those of the mode.
        assert rate == pytest.approx(wanted, rel=1e-8)
        # Arnoldi's 1e-10 of the inverse, times |A| / |lambda|^2 of some 500 for the slowest.
        assert found.residual.max() < 5e-8
        assert found.quality == pytest.approx(abs(wanted) / (-2 * wanted.real), rel=1e-6)


def smooth_ends(network, contacts, mass):
    """Spheres with some of their contacts, other masses, and springs along the normals alone."""
    chosen, mass = stiffer(network.with_contacts(np.array(contacts)), 1, 0), np.array(mass)
    return chosen.unchecked(mass=mass, inertia=0.4 * mass * network.radius**2)


PAIR = smooth_ends(column(2), [1], [1e-5, 8e-5])
AT_WALL = smooth_ends(column(1), [0], [2e-5])


@pytest.mark.parametrize(("network", "effective"), [(PAIR, 8e-5 / 9), (AT_WALL, 2e-5)])
@pytest.mark.parametrize("beta", [0.1, 0.7])
def test_ratios_are_those_of_the_critical_damping(network, effective, beta):
    """One spring: lambda^2 + 2 beta omega lambda + omega^2 = 0, omega^2 = k / m*.

    m* of masses m and 8 m is 8/9 m; at a wall it is the sphere's own.
    """
    omega = np.sqrt(network.stiffness_normal[0] / effective)
    near = omega / (2 * np.pi) / 3
    found = damped_modes(network, ContactDamping(beta, 0), near=near, count=1)
    exact = omega * np.sqrt(1 - beta**2) / (2 * np.pi)
    assert found.frequency == pytest.approx([exact], rel=1e-9)
    assert found.decay == pytest.approx([beta * omega], rel=1e-9)


def test_only_what_oscillates_is_a_mode():
    """Neither the other one of a conjugate pair, nor what creeps back, nor rigid motion."""
    with refusal("mode_count"):
        damped_modes(PAIR, ContactDamping(0.1, 0), near=1e3, count=2)
    with refusal("mode_count"):
        damped_modes(PAIR, ContactDamping(1.5, 0), near=1e3, count=1)
    with refusal("frequency", "-5"):
        damped_modes(PAIR, DAMPING, near=-5.0)
    with refusal("argument", "1.5"):
        damped_modes(PAIR, ContactDamping(0.1, 0), near=1e3, count=1.5)


def test_modes_that_do_not_converge_are_said_in_one_line(monkeypatch):
    """Arnoldi's iteration is given one restart for forty of thousands of nearly equal rates."""
    crystal, own = modal.fcc(cells=(2, 2, 12)), arnoldi.eigs
    monkeypatch.setattr(arnoldi, "eigs", lambda *a, **k: own(*a, **k | {"maxiter": 1, "ncv": 43}))
    with refusal("not_converged", "150000"):
        damped_modes(crystal, DAMPING, near=1.5e5, count=40)


def test_modes_of_the_endless_crystal_decay_as_its_chain_does():
    """m lambda^2 + (C + lambda D) 4 sin^2(kappa l / 2) = 0 at the wave numbers of the cell."""
    network = modal.fcc(cells=(1, 1, 8), periodic_z=True)
    kappa = 2 * np.pi * 2 / network.length
    s2 = 4 * np.sin(kappa * CRYSTAL.layer_distance / 2) ** 2
    roots = np.roots([CRYSTAL.mass, layer_dashpot(DAMPING) * s2, CRYSTAL.C * s2])
    wanted = roots[roots.imag > 0][0]
    found = damped_modes(network, DAMPING, near=wanted.imag / (2 * np.pi), count=6)
    rate = -found.decay + 2j * np.pi * found.frequency
    assert abs(rate / wanted - 1).min() < 1e-9
    # A little damping: the decay of elastic modes to first order, off by its square.
    little = ContactDamping(0.005, 0.003)
    crystal = modal.fcc(cells=(1, 1, 20))
    elastic = modal.eigenmodes(crystal, lowest=120)
    rates = decay_rates(elastic, crystal, little)
    exact = damped_modes(crystal, little, near=4e3, count=3)
    near = np.argsort(abs(elastic.frequency - 4e3))[:3]
    assert np.sort(rates[near]) == pytest.approx(np.sort(exact.decay), rel=1e-3)
    total = stiffness_matrix(little.dashpots(crystal)).diagonal() / mass_diagonal(crystal)
    assert rates.sum() == pytest.approx(total.sum() / 2, rel=1e-9)
