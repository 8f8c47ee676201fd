"""Scattering, fitted wave numbers and the gain's maxima against fields of known answer."""

import numpy as np
import pytest

from analysis.estimators.resonances import fitted_wavenumbers, long_wave_velocity
from analysis.estimators.scattering import Scattering
from analysis.estimators.structure_factor import StructureFactor
from analysis.packing_data import PackingData
from analysis.quantities import gain
from modal.packing.crystal import fcc
from modal.waves.response import maxima


@pytest.mark.parametrize("power", [2.0, 4.0])
def test_width_of_a_known_power(power):
    """Compare the exponent, the free path and the limit of a width c f^p.

    The free path is V / (2 pi width); at the limit pi c f^p = f.
    """
    f = np.geomspace(1e3, 4e4, 60)
    c = 1e3 / 2e4**power
    scattering = Scattering(f, c * f**power, 500.0, 2.5e-3)
    assert scattering.power(1e4).exponent == pytest.approx(power, rel=1e-9)
    path = 500 / (2 * np.pi * c * 7.7e3**power) / 2.5e-3
    assert scattering.free_path(7.7e3) == pytest.approx(path, rel=1e-6)
    limit = (1 / (np.pi * c)) ** (1 / (power - 1))
    if limit > f[-1]:
        limit = np.nan
    assert scattering.limit == pytest.approx(limit, rel=1e-6, nan_ok=True)
    assert np.isnan(scattering.free_path(5e4))
    assert np.isnan(scattering.free_path(np.nan))


def test_lines_of_known_width_give_it_back():
    """Measure Gaussian lines of known full width at half height; the resolution is subtracted.

    The squares of the widths of two folded Gaussians add; on a grid of a tenth of the width the sum
    is found within a per cent.
    """
    f = np.arange(100, 3e4, 50.0)
    resolution = 1e3
    centre = np.array([5e3, 1e4, 1.5e4])
    width = np.array([800.0, 2e3, 5e3])
    sigma = np.hypot(width, resolution) / np.sqrt(8 * np.log(2))
    power = np.exp(-0.5 * ((f - centre[:, None]) / sigma[:, None]) ** 2) / sigma[:, None]
    order = np.array([7, 14, 21])
    structure = StructureFactor(f, order, order * 10.0, power, resolution)
    scattering = structure.scattering(500.0, 2.5e-3)
    assert scattering.frequency == pytest.approx(centre, rel=1e-3)
    assert scattering.width == pytest.approx(width, rel=1e-2)
    narrow = StructureFactor(f, order, order * 10.0, power, 1.2 * resolution)
    assert len(narrow.scattering(500.0, 2.5e-3).width) == 2


def test_fitted_wave_numbers_of_walls_that_give_way():
    """Fit sines of a column that is 1 % longer, at uneven heights: kappa to 1e-4, not Eq. 4's."""
    rng = np.random.default_rng(3)
    length = 0.36
    depth = np.sort(rng.uniform(0, length, 800))
    exact = np.pi * np.arange(1, 11) / (1.01 * length)
    shape = np.sin(exact[:, None] * (depth + 0.005 * length))
    assert fitted_wavenumbers(shape, depth, length) == pytest.approx(exact, rel=1e-4)


def test_long_wave_velocity_takes_the_bend_off():
    """Correct omega = 2 V / l sin(kappa l / 2) for its bend.

    The result is V up to the fourth order of kappa l, which is 0.16 at r = 10.
    """
    length = 0.36
    spacing = 1.8e-3
    speed = 540.0
    kappa = np.pi * np.arange(1, 21) / length
    f = 2 * speed / spacing * np.sin(kappa * spacing / 2) / (2 * np.pi)
    assert long_wave_velocity(f, kappa)[0] == pytest.approx(speed, rel=1e-5)
    assert np.isnan(long_wave_velocity(f[:9], kappa[:9])[0])


def test_maxima_of_a_rod_lie_half_way():
    """Find the maxima of 1 / |cos q L| with a complex q.

    This is the stress at the receiver of a rod between rigid walls, divided by that at the source.
    The maxima are the modes of a column whose source end is free: (r - 1/2) f_1.
    """
    first = 750.0
    f = np.arange(20, 1e4, 20.0)
    q = np.pi * (f / first) + 0.3j
    frequency = maxima(f, abs(1 / np.cos(q)))[0]
    assert frequency[:12] == pytest.approx(first * (np.arange(12) + 0.5), rel=1e-3)
    assert len(maxima(f, np.ones(len(f)))[0]) == 0


def test_maxima_of_the_crystals_gain_are_modes_of_a_free_source():
    """Compare with a column whose source end is free: its modes have no stress at the source.

    The window of 0.38 f_1 moves the maxima by its square times the curvature over the orders, a
    thousandth of f_1; the grid of the gain is 0.1 f_1.
    """
    crystal = PackingData(fcc(cells=(1, 1, 100)))
    # In symmetric modes of a crystal twice as long the bond in the middle bears nothing.
    free = PackingData(fcc(cells=(1, 1, 200))).lattice.eigenmodes()[0][::2] / (2 * np.pi)
    frequency = gain.gain_of(crystal).gain_maxima()
    first = gain.first_resonance(crystal)
    assert len(frequency) > 11
    assert abs(frequency[:12] - free[:12]).max() < 2e-3 * first
    assert gain.orders(crystal)[:12] == pytest.approx(free[:12] / first, abs=2e-3)
