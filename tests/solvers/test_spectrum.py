"""The end of the spectrum, its highest mode, what lies beyond, what is said to be needed."""

import tracemalloc
from functools import partial

import numpy as np
import pytest
import scipy.sparse as sp
from operators import Known
from oracles import PRE_STRESS
from packings import disordered, random_springs, sheared
from scipy.linalg import eigh

from modal.modes import density
from modal.modes.collective import every_floppy
from modal.modes.density import density_of_states
from modal.packing import crystal as gallery
from modal.solvers import spectrum
from modal.solvers.chebyshev import chebyshev
from modal.solvers.lanczos import TOLERANCE
from modal.solvers.spectrum import GrowthError, bound_of_spectrum, top_mode
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.tools import loops
from modal.waves import integrators as wave
from modal.waves.chebyshev import PRODUCTS_BETWEEN_CHECKS, readings
from modal.waves.propagate import propagate

pytestmark = pytest.mark.two_ways


SPECTRA = {
    "one value": np.full(50, 7.0),
    "two values": np.repeat([1.0, 9.0], 25),
    "even": np.linspace(0, 1, 500),
    "an edge like a packing's": 1 - np.linspace(0, 1, 3000) ** 2,
    "huge": 1e30 * np.linspace(0, 1, 500),
    "tiny": 1e-30 * np.linspace(0, 1, 500),
}


@pytest.mark.parametrize("name", SPECTRA)
def test_end_of_known_spectra(name):
    """Check that the bound is above the largest eigenvalue by 4 % at most."""
    operator = Known(SPECTRA[name])
    top, products = bound_of_spectrum(operator)
    assert SPECTRA[name].max() < top < 1.04001 * SPECTRA[name].max()
    assert products == operator.products


@pytest.mark.parametrize("beyond", [0.05, 0.3, 3.0])
@pytest.mark.parametrize("name", ["even", "an edge like a packing's"])
def test_bound_holds_for_a_mode_that_the_start_hardly_contains(name, beyond, monkeypatch):
    """Find the bound with a start that contains 1e-6 / (2 size / pi)^1/2 of the highest mode.

    A smaller share has a chance below 1e-6. A mode that the start does not contain at all is
    missed.
    """
    square = np.append(SPECTRA[name], 1 + beyond)
    least_share = 1e-6 / np.sqrt(2 * len(square) / np.pi)
    bounds = []
    for share in (1.0, 0.0):
        start = np.random.default_rng(1).standard_normal((len(square), 1))
        start /= np.linalg.norm(start)
        start[-1] = share * least_share
        monkeypatch.setattr(spectrum, "start_block", lambda *_, start=start: start)
        bounds.append(bound_of_spectrum(Known(square))[0])
    assert bounds[1] < 1 + beyond < bounds[0]


@pytest.mark.parametrize("pre_stress", PRE_STRESS)
@pytest.mark.parametrize("make", [sheared, lambda: random_springs(3)])
def test_bound_of_a_packing_is_above_the_real_parts(make, pre_stress):
    """Compare the bound with the symmetric part of A, which exceeds the real parts.

    The margin is a tenth here.
    """
    system = LinearSystem(make(), pre_stress=pre_stress)
    A = system.dynamical_matrix.toarray()
    top = np.linalg.eigvalsh((A + A.T) / 2)[-1]
    assert np.linalg.eigvals(A).real.max() <= top * (1 + 1e-12) < system.spectral_bound < 1.15 * top


@pytest.mark.parametrize(
    ("square", "orders"),
    [
        # T_1 of what lies at 1.1 times the interval is 1.2: seen in the last product, too.
        (np.full(4, 1.1), 2),
        *((np.full(4, 1 + 1e-13), orders) for orders in (10, 100, 3000)),
        (np.repeat([-2.0, 0.0, 1.0], [1, 24, 25]), 100),
    ],
)
def test_growth_is_told_from_round_off_at_every_order(square, orders):
    """Find growth if a mode lies outside of the interval, at every order.

    cosh(2 k sqrt(d)) is 1 + 2 k^2 d for a mode a share d outside. Round-off of the recurrence grows
    as k^2, too, so that the same shares are noticed at every order, above and below the interval.
    Starts are tiny: growth is relative to them.
    """
    start = np.full(len(square), 1e-9)

    def read(operator):
        states = enumerate(chebyshev(operator, start.copy(), 2.0, -1.0))
        rows = sp.identity(len(square))
        return readings(operator, states, rows, np.linalg.norm(start), orders)

    grows = Known(square)
    with pytest.raises(GrowthError):
        read(grows)
    assert grows.products == min(orders, PRODUCTS_BETWEEN_CHECKS) - 1
    read(Known(np.clip(square, 0, 1 + 1e-15)))


CRYSTAL = gallery.fcc(cells=(2, 2, 100))
AGAIN = [gallery.fcc(cells=(2, 2, 100)) for _ in range(3)]
"""The same crystal, of which nothing is known."""
TASKS = {
    "wave, many times": (wave, partial(propagate, AGAIN[0], 5e-4, interval=1e-7)),
    "wave, many spheres": (wave, partial(propagate, AGAIN[1], 1e-3, interval=1e-4, particles=True)),
    "density, exact": (
        density,
        partial(density_of_states, gallery.fcc(cells=(2, 2, 40)), resolution=100.0, tolerance=1e-4),
    ),
    "density, random": (
        density,
        partial(density_of_states, AGAIN[2], resolution=200.0, tolerance=1e-2),
    ),
}


@pytest.mark.parametrize("task", TASKS)
def test_work_and_memory_are_as_large_as_said(task, monkeypatch):
    """Compare estimates with products, within a tenth, and with memory, within a factor of two.

    All products are counted.
    """
    if loops.numba is None:
        pytest.skip("numba is not installed: the matrix in its place is more than all arrays")
    module, compute = TASKS[task]
    estimate = {}
    monkeypatch.setattr(module, "refuse_endless", lambda *_, **what: estimate.update(what))
    # What compiling takes is no part of a task, nor the count of zero modes, which is made once.
    every_floppy(LinearSystem.of(compute.args[0]))
    for motion, sums in (np.zeros((2400, 1)), None), (np.zeros((2400, 8)), np.zeros((2, 6, 8))):
        ContactOperator(CRYSTAL, mass_scaled=True).combine(motion, motion.copy(), 1.0, sums=sums)
    calls = []
    combine = ContactOperator.combine

    def counted(operator, u, *given, **named):
        calls.append(u.size // len(u))
        return combine(operator, u, *given, **named)

    monkeypatch.setattr(ContactOperator, "combine", counted)
    tracemalloc.start()
    products = compute().products
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 0.5 < peak / estimate["bytes_needed"] < 2
    assert 1 / 1.1 < products / estimate["products"] < 1.1
    assert products == sum(calls)


@pytest.mark.parametrize("steps", [5, 300])
def test_value_vector_and_products(steps, monkeypatch):
    """Compare the highest mode with a dense solver.

    The angle to the dense vector is below the residual divided by the gap to the next value. 300
    steps where 80 would do are no harm, although round-off brings copies of the mode back.
    """
    monkeypatch.setattr("modal.solvers.spectrum.STEPS_BETWEEN_CHECKS", steps)
    system = LinearSystem.of(disordered())
    matrix = system.dynamical_matrix.toarray()
    square, vector = eigh(matrix, subset_by_index=[system.size - 2, system.size - 1])
    top = top_mode(system.operator, 330)
    assert top.converged.all()
    assert 2 * steps <= top.products <= 2 * max(90, steps)
    assert top.square == pytest.approx(square[-1:], rel=1e-12)
    v = top.vector[:, 0]
    residual = np.linalg.norm(matrix @ v - top.square[0] * v)
    assert residual < 2 * TOLERANCE * square[-1]
    angle = np.linalg.norm(v - vector[:, 1] * (vector[:, 1] @ v))
    assert angle <= 1.1 * residual / (square[1] - square[0])


def test_highest_mode_of_two_values_has_no_part_in_the_lower_one():
    highest = top_mode(Known(SPECTRA["two values"]), 330)
    assert abs(highest.vector[:25]).max() < 1e-12
    assert highest.square == pytest.approx(9.0)


def test_what_does_not_converge_has_no_vector():
    """Ask for the highest mode of a column of FCC, whose highest modes are dense."""
    operator = ContactOperator(gallery.fcc(cells=(1, 1, 200)), mass_scaled=True)
    top = top_mode(operator, 22)
    assert not top.converged.any()
    assert not top.vector.any()
    assert top.products == 22
