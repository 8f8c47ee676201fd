"""The end of the spectrum, what a recurrence beyond it shows, and what is said to be needed."""

import tracemalloc
from functools import partial

import numpy as np
import pytest
import scipy.sparse as sp
from operators import Known

from modal.modes import density
from modal.modes.collective import every_floppy
from modal.modes.density import density_of_states
from modal.packing import crystal as gallery
from modal.solvers.spectrum import (
    LANCZOS_STEPS,
    GrowthError,
    bound_of_spectrum,
    top_of_spectrum,
    wider_top,
)
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.tools import loops
from modal.waves import chebyshev
from modal.waves import integrators as wave
from modal.waves.chebyshev import Recurrence, summed
from modal.waves.driven import Driven, Link
from modal.waves.propagate import propagate

pytestmark = pytest.mark.two_ways


class Moments:
    """A record of the first moments themselves, one a row."""

    apart = False

    def __init__(self, orders: int) -> None:
        self.wanted, self.moved = orders, np.zeros(orders)

    def left(self, orders: int) -> float:
        """Nothing after the last one."""
        return float(self.wanted - orders)

    def orders(self, _: float) -> int:
        """All of them."""
        return self.wanted

    def add(self, record: np.ndarray, rows: np.ndarray, first: int) -> None:
        """The rows as they are."""
        record[first : first + len(rows)] = rows


def everything(operator: Known) -> Driven:
    """A push on all, and receivers of all motions."""
    size = operator.shape[0]
    link = Link(
        operator, sp.csr_matrix(np.ones(size)), sp.identity(size, format="csr"), np.empty(0)
    )
    return Driven(link, None, (), None, LinearSystem(gallery.column(2)))


SPECTRA = {
    "one value": np.full(50, 7.0),
    "two values": np.repeat([1.0, 9.0], 25),
    "even": np.linspace(0, 1, 500),
    "an edge like a packing's": 1 - np.linspace(0, 1, 3000) ** 2,
    "huge": 1e30 * np.linspace(0, 1, 500),
    "tiny": 1e-30 * np.linspace(0, 1, 500),
}


@pytest.mark.parametrize("name", SPECTRA)
@pytest.mark.parametrize("end", [top_of_spectrum, bound_of_spectrum])
def test_end_of_known_spectra(end, name):
    """Above the top by margin and residual, 2 % each at most; products told."""
    operator = Known(SPECTRA[name])
    top, products = end(operator)
    assert SPECTRA[name].max() < top < 1.041 * SPECTRA[name].max()
    assert products == operator.products


def test_few_values_take_as_many_products():
    """A Krylov space of two eigenvalues is exhausted after two products."""
    for end in (top_of_spectrum, bound_of_spectrum):
        assert end(Known(SPECTRA["two values"])) == (pytest.approx(9 / 0.98, rel=1e-12), 2)
        assert end(Known(np.zeros(20))) == (0.0, 1)
    # Two values of either sign, whose mean is near zero.
    assert bound_of_spectrum(Known([-1.0, 1.0] * 25)) == (pytest.approx(1 / 0.98), 2)


def test_an_estimate_ends_at_its_most_products():
    """After 40 steps the residual is 0.8 % of half the width, 2.4 % of the top."""
    top, products = top_of_spectrum(Known(np.linspace(-5, 1, 3000)))
    assert products == LANCZOS_STEPS
    assert 1 < top < 1.05


@pytest.mark.parametrize("size", [500, 1000, 2000, 3000, 5000])
def test_bound_takes_the_products_of_its_theorem(size):
    """Within 2 % but for 1e-6: 1.648 sqrt(n) exp(-(2k - 1) sqrt(0.02)) <= 1e-6, and no fewer."""
    _, steps = bound_of_spectrum(Known(1 - np.linspace(0, 1, size) ** 2))

    def failure(k: int) -> float:
        return 1.648 * np.sqrt(size) * np.exp(-(2 * k - 1) * np.sqrt(0.02))

    assert failure(steps) <= 1e-6 < failure(steps - 1)


def grown(square, share: float, orders: int) -> tuple[Known, GrowthError, float]:
    """A recurrence that left the interval from zero to a share of the top."""
    operator, size = Known(square), len(square)
    # Tiny: growth is relative to the start.
    start, top = np.full(size, 1e-9), share * max(square)
    with pytest.raises(GrowthError) as caught:
        Recurrence(operator, start, top, sp.identity(size)).rows(orders)
    return operator, caught.value, top


def test_growth_is_seen_in_the_last_product_too():
    """T_1 of what lies at 1.1 times the interval is 1.2: there are no more products than that."""
    grown(np.full(4, 1.1), 1 / 1.1, 2)


@pytest.mark.parametrize("orders", [10, 100, 3000])
def test_growth_is_told_from_round_off_at_every_order(orders):
    """cosh(2 k sqrt(d)) is 1 + 2 k^2 d for a mode that lies a share d beyond the interval.

    The recurrence's round-off grows as k^2, too: the same shares are seen, or not, at every order.
    """
    grown(np.full(4, 1 + 1e-13), 1 / (1 + 1e-13), orders)
    operator, start = Known(np.full(4, 1 + 1e-15)), np.ones(4)
    Recurrence(operator, start, 1.0, sp.identity(4)).rows(orders)


@pytest.mark.parametrize("share", [1.1, 0.9, 0.3])
def test_products_with_an_estimate_that_is_too_small(share, monkeypatch):
    """Those of an attempt that grew are told as well, and only as many as were made."""
    square = np.linspace(0, 3, 400)
    operator = Known(square)
    monkeypatch.setattr(chebyshev, "top_of_spectrum", lambda _: (share * 3.0, 0))
    tops = []

    def series_for(top):
        tops.append(top)
        return Moments(300)

    _, rows, products, error = summed(everything(operator), series_for, 1e-9)
    assert products == operator.products and error == 0
    top = tops[-1]
    assert top >= 3
    expected = np.cos(np.arange(300)[:, None] * np.arccos(2 * square / top - 1))
    assert rows == pytest.approx(expected, abs=300**2 * 1e-15)


@pytest.mark.parametrize("share", [0.999, 0.5, 0.1])
def test_wider_interval_holds_the_spectrum(share):
    operator, error, top = grown(np.linspace(0, 3, 400), share, 300)
    before = operator.products
    wider, products = wider_top(operator, error, top)
    assert 3 < wider < 3 * 1.026
    assert products == operator.products - before


def test_a_negative_direction_is_no_reason_to_widen():
    """Below zero by more than beyond the top; equal distances; or not even numbers any more."""
    for square, share in ((np.linspace(-2, 1, 50), 0.9), (np.linspace(-1e-3, 1, 50), 1.0)):
        operator, error, top = grown(square, share, 300)
        with pytest.raises(GrowthError) as caught:
            wider_top(operator, error, top)
        assert caught.value is error
    # A single negative direction, and two orders, after which the others are still there.
    operator, error, top = grown(np.repeat([-2.0, 0.0, 1.0], [1, 24, 25]), 0.9, 2)
    with pytest.raises(GrowthError):
        wider_top(operator, error, top)
    operator, error, top = grown(np.linspace(0, 3, 50), 0.5, 100)
    error.vector[7] = np.nan
    with pytest.raises(GrowthError):
        wider_top(operator, error, top)


def test_a_record_of_its_end_alone_is_as_exact():
    """Two times instead of three hundred: the orders follow the duration, not the record."""
    long, short = (
        propagate(gallery.fcc(cells=(2, 2, 30)), 3e-4, interval=dt) for dt in (1e-6, 3e-4)
    )
    end = long.signals.chain_displacement[-1]
    # The tolerance times some hundred coefficients.
    found = short.signals.chain_displacement[-1]
    assert abs(found - end).max() < 1e-7 * abs(end).max()
    # Every particle's motion is large: it is recorded where it is asked for alone.
    assert long.signals.particle_displacement is None


CRYSTAL = gallery.fcc(cells=(2, 2, 100))
TASKS = {
    "wave, many times": (wave, partial(propagate, CRYSTAL, 5e-4, interval=1e-7)),
    "wave, many spheres": (wave, partial(propagate, CRYSTAL, 1e-3, interval=1e-4, particles=True)),
    "density, exact": (
        density,
        partial(density_of_states, gallery.fcc(cells=(2, 2, 40)), resolution=100.0, tolerance=1e-4),
    ),
    "density, random": (
        density,
        partial(density_of_states, CRYSTAL, resolution=200.0, tolerance=1e-2),
    ),
}


@pytest.mark.parametrize("task", TASKS)
def test_work_and_memory_are_as_large_as_said(task, monkeypatch):
    """Within a factor of two of the products made and of the largest sum of all arrays."""
    if loops.numba is None:
        pytest.skip("numba is not installed: the matrix in its place is more than all arrays")
    module, compute = TASKS[task]
    said = {}
    monkeypatch.setattr(module, "refuse_endless", lambda *_, **what: said.update(what))
    # What compiling takes is no part of a task, nor the count of zero modes, which is made once.
    every_floppy(LinearSystem.of(compute.args[0]))
    motion = np.zeros(6 * CRYSTAL.n_particles)
    for sums in (None, np.zeros((2, 6))):
        ContactOperator(CRYSTAL, mass_scaled=True).combine(motion, motion.copy(), 1.0, sums=sums)
    tracemalloc.start()
    made = compute().products
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 0.5 < peak / said["bytes_needed"] < 2
    assert 0.5 < made / said["products"] < 2
