"""The highest mode by Lanczos twice, against dense spectra."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from modal.packing import crystal as gallery
from modal.packing.network import Network
from modal.solvers.lanczos import TOLERANCE
from modal.solvers.spectrum import top_mode
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator

pytestmark = pytest.mark.two_ways

MOST = 330


def disordered() -> Network:
    """A crystal whose highest mode stands apart."""
    crystal = gallery.fcc(cells=(3, 3, 14))
    factor = 1 + 0.3 * np.random.default_rng(4).random(crystal.n_contacts)
    return replace(crystal, stiffness_normal=crystal.stiffness_normal * factor)


@pytest.mark.parametrize("steps", [5, 300])
def test_value_vector_and_products(steps, monkeypatch):
    """The angle to the dense vector is below the residual over the gap to the next value.

    Also after 300 steps where 80 would do: the copies that round-off brings back do no harm.
    """
    monkeypatch.setattr("modal.solvers.spectrum.LOOK", steps)
    system = LinearSystem.of(disordered())
    matrix = system.scaled.toarray()
    square, vector = eigh(matrix, subset_by_index=[system.size - 2, system.size - 1])
    found = top_mode(system.operator, MOST)
    assert found.converged.all() and 2 * steps <= found.products <= 2 * max(90, steps)
    assert found.square == pytest.approx(square[-1:], rel=1e-12)
    v = found.vector[:, 0]
    residual = np.linalg.norm(matrix @ v - found.square[0] * v)
    assert residual < 2 * TOLERANCE * square[-1]
    angle = np.linalg.norm(v - vector[:, 1] * (vector[:, 1] @ v))
    assert angle <= 1.1 * residual / (square[1] - square[0])


def test_what_does_not_converge_has_no_vector():
    """A column of FCC has a dense bunch at the top."""
    operator = ContactOperator(gallery.fcc(cells=(1, 1, 200)), mass_scaled=True)
    found = top_mode(operator, 20)
    assert not found.converged.any() and not found.vector.any() and found.products == 20
