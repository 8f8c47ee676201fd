"""Lines of plane waves in periodic cells: none is wide in a crystal, and where they are narrow."""

import numpy as np
import pytest

import analysis
import modal
from analysis.measuring import Measuring

NAMES = ["scattering_of_p", "scattering_of_s"]


def test_a_crystal_does_not_scatter_and_its_lines_lie_on_the_branches():
    """Frequencies of a cubic lattice, along all axes, by its velocities: 1 % at ten layers."""
    net = modal.fcc(cells=(10, 10, 14), periodic_z=True)
    found = analysis.measure(net, quantities=[*NAMES, "v_p_moduli"])
    line = Measuring(net).line
    for name in NAMES:
        narrow = np.hypot(0.3 * line, 3 * found[name].error)
        assert (found[name].value < narrow).all() and (found[name].error < 0.5 * line).all()
    # Along z, and across at 45 degrees to the cubic axes, where P-waves are 0.7 % faster.
    slowest = found["v_p_moduli"].value / net.cell_size.max()
    assert found["scattering_of_p"].at[0] == pytest.approx(slowest, rel=0.05)


def test_the_width_of_a_random_packing_is_that_of_its_modes():
    """Line and width of the longest waves from all modes, each as wide as the resolution."""
    net = modal.random_packing(spheres=500, friction=0.3, seed=1, aspect=1, periodic=True)
    found = analysis.measure(net, quantities=["scattering_of_p"])["scattering_of_p"]
    line = Measuring(net).line
    modes = modal.eigenmodes(net, all=True)
    f = np.arange(0, 4 * found.at[0], line / 20)
    total = np.zeros(len(f))
    for axis in range(3):
        wave = np.exp(2j * np.pi * net.position[:, axis] / net.cell_size[axis])
        moving = np.unique(np.concatenate([net.particle_i, net.particle_j]))
        pattern = np.zeros(len(wave), complex)
        pattern[moving] = wave[moving]
        overlap = abs((modes.mode_shape[:, :, axis] * net.mass) @ pattern) ** 2
        spread = line / 2.3548
        shape = np.exp(-0.5 * ((f[:, None] - modes.frequency) / spread) ** 2)
        total += shape @ overlap
    above = f[total > total.max() / 2]
    assert f[total.argmax()] == pytest.approx(found.at[0], abs=0.2 * line)
    width = np.sqrt(np.ptp(above) ** 2 - line**2)
    assert width == pytest.approx(found.value[0], abs=0.2 * line)


def test_walls_are_refused():
    """In one line."""
    found = analysis.measure(modal.fcc(cells=(2, 2, 10)), quantities=NAMES)
    assert not found[NAMES[0]].known and "periodic" in found[NAMES[0]].caveats[0]
