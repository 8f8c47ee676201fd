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
    """Above the top by the margin, 4 %, at most; products told."""
    operator = Known(SPECTRA[name])
    top, products = bound_of_spectrum(operator)
    assert SPECTRA[name].max() < top < 1.04001 * SPECTRA[name].max()
    assert products == operator.products


@pytest.mark.parametrize("beyond", [0.05, 0.3, 3.0])
@pytest.mark.parametrize("name", ["even", "an edge like a packing's"])
def test_bound_holds_for_a_mode_that_the_start_hardly_contains(name, beyond, monkeypatch):
    """A part of 1e-6 / (2 size / pi)^1/2 of it, less than which has a chance below 1e-6.

    Of a mode that the start does not contain at all the bound knows nothing.
    """
    square = np.append(SPECTRA[name], 1 + beyond)
    part = 1e-6 / np.sqrt(2 * len(square) / np.pi)
    found = []
    for share in (1.0, 0.0):
        start = np.random.default_rng(1).standard_normal((len(square), 1))
        start /= np.linalg.norm(start)
        start[-1] = share * part
        monkeypatch.setattr(spectrum, "start_block", lambda *_, start=start: start)
        found.append(bound_of_spectrum(Known(square))[0])
    assert found[1] < 1 + beyond < found[0]


@pytest.mark.parametrize("pre_stress", PRE_STRESS)
@pytest.mark.parametrize("make", [sheared, lambda: random_springs(3)])
def test_bound_of_a_packing_is_above_the_real_parts(make, pre_stress):
    """And above the symmetric part, by the margin, a tenth here."""
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
    """cosh(2 k sqrt(d)) is 1 + 2 k^2 d for a mode that lies a share d beyond the interval.

    The recurrence's round-off grows as k^2, too: the same shares are seen, or not, at every order,
    above the interval and below, and at once. Tiny starts: growth is relative to them.
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
    """Within a tenth of the products made, a factor of two of the largest sum of all arrays.

    Of the products every one is told.
    """
    if loops.numba is None:
        pytest.skip("numba is not installed: the matrix in its place is more than all arrays")
    module, compute = TASKS[task]
    said = {}
    monkeypatch.setattr(module, "refuse_endless", lambda *_, **what: said.update(what))
    # What compiling takes is no part of a task, nor the count of zero modes, which is made once.
    every_floppy(LinearSystem.of(compute.args[0]))
    for motion, sums in (np.zeros((2400, 1)), None), (np.zeros((2400, 8)), np.zeros((2, 6, 8))):
        ContactOperator(CRYSTAL, mass_scaled=True).combine(motion, motion.copy(), 1.0, sums=sums)
    calls, combine = [], ContactOperator.combine

    def counted(operator, u, *given, **named):
        calls.append(u.size // len(u))
        return combine(operator, u, *given, **named)

    monkeypatch.setattr(ContactOperator, "combine", counted)
    tracemalloc.start()
    made = compute().products
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 0.5 < peak / said["bytes_needed"] < 2
    assert 1 / 1.1 < made / said["products"] < 1.1 and made == sum(calls)


@pytest.mark.parametrize("steps", [5, 300])
def test_value_vector_and_products(steps, monkeypatch):
    """The angle to the dense vector is below the residual over the gap to the next value.

    Also after 300 steps where 80 would do: the copies that round-off brings back do no harm.
    """
    monkeypatch.setattr("modal.solvers.spectrum.STEPS_BETWEEN_CHECKS", steps)
    system = LinearSystem.of(disordered())
    matrix = system.dynamical_matrix.toarray()
    square, vector = eigh(matrix, subset_by_index=[system.size - 2, system.size - 1])
    found = top_mode(system.operator, 330)
    assert found.converged.all() and 2 * steps <= found.products <= 2 * max(90, steps)
    assert found.square == pytest.approx(square[-1:], rel=1e-12)
    v = found.vector[:, 0]
    residual = np.linalg.norm(matrix @ v - found.square[0] * v)
    assert residual < 2 * TOLERANCE * square[-1]
    angle = np.linalg.norm(v - vector[:, 1] * (vector[:, 1] @ v))
    assert angle <= 1.1 * residual / (square[1] - square[0])
    # Of two values it is made of as many vectors, the last one included.
    two = top_mode(Known(SPECTRA["two values"]), 330)
    assert abs(two.vector[:25]).max() < 1e-12 and two.square == pytest.approx(9.0)


def test_what_does_not_converge_has_no_vector():
    """A column of FCC has a dense bunch at the top."""
    operator = ContactOperator(gallery.fcc(cells=(1, 1, 200)), mass_scaled=True)
    found = top_mode(operator, 22)
    assert not found.converged.any() and not found.vector.any() and found.products == 22
