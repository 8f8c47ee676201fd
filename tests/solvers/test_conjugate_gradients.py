"""Conjugate gradients for several loads at once, against direct solutions and their theory."""

import numpy as np
import pytest
from refusals import refusal

from modal.solvers.conjugate_gradients import conjugate_gradients

SIZE = 60


def stiff(softest=1e-3, n_free=0, seed=1):
    """Return a symmetric matrix with eigenvalues from `softest` to 1, and `n_free` of zero."""
    random = np.random.default_rng(seed)
    basis = np.linalg.qr(random.standard_normal((SIZE, SIZE)))[0]
    values = np.geomspace(softest, 1, SIZE)
    values[:n_free] = 0
    return (basis * values) @ basis.T


def loads(count, matrix, seed=2):
    """Return loads in the range of a matrix."""
    return matrix @ np.random.default_rng(seed).standard_normal((SIZE, count))


def solve(matrix, load, error=1e-20, **options):
    """Solve to a relative error of the energy, without a preconditioner."""
    steps = {"look_back": 1, "most_products": 500} | options
    noise = 1e-13 * np.linalg.norm(load, axis=0)
    return conjugate_gradients(
        lambda x: matrix @ x, np.copy, load, lambda energy: error * energy, noise, **steps
    )


@pytest.mark.parametrize("n_free", [0, 5])
def test_solutions_equal_those_of_the_pseudoinverse(n_free):
    """Solve for loads of which some are equal, combinations of others, zero, or very small.

    The error of the energy is 1e-20 of it, and that of a motion larger by the root of 1e3.
    """
    matrix = stiff(n_free=n_free)
    load = loads(5, matrix)
    load[:, 2] = load[:, 0]
    load[:, 3] = load[:, 0] - load[:, 1]
    load[:, 4] *= 1e-12
    load = np.column_stack([load, np.zeros(SIZE)])
    solution = solve(matrix, load)
    exact = np.linalg.pinv(matrix, rcond=1e-9, hermitian=True) @ load
    size = np.linalg.norm(exact, axis=0)
    assert (np.linalg.norm(solution.motion - exact, axis=0) <= 1e-8 * size).all()
    assert solution.residual == pytest.approx(load - matrix @ solution.motion, abs=1e-14)


@pytest.mark.parametrize("count", [1, 3, 6])
def test_loads_share_their_directions(count):
    """Solve in as many steps as there are directions for each load.

    Each step takes `count` of the 60 directions, so that none is left after 60 / count steps.
    Round-off may take one more, and one more product gives the residual.
    """
    matrix = stiff(softest=0.1)
    solution = solve(matrix, loads(count, matrix), error=1e-24)
    assert solution.products <= SIZE / count + 2


def test_the_error_is_that_of_the_energy():
    """Compare the error that the steps show with the true one, of which it is a lower bound."""
    matrix = stiff(softest=1e-4)
    load = loads(2, matrix)
    exact = np.linalg.solve(matrix, load)
    for error in (1e-4, 1e-8):
        solution = solve(matrix, load, error=error, look_back=4)
        left = exact - solution.motion
        before = solution.energy_error
        after = np.einsum("ik,ik->k", left, matrix @ left)
        energy = np.einsum("ik,ik->k", load, exact)
        assert (before <= error * energy).all()
        assert (after <= before).all()


def test_motions_without_energy_from_the_preconditioner_do_not_count():
    """Let the preconditioner turn the round-off of the residual into a motion without energy."""
    matrix = stiff(n_free=3)
    free = np.linalg.eigh(matrix)[1][:, :3]
    load = loads(2, matrix)
    solution = conjugate_gradients(
        lambda x: matrix @ x,
        lambda x: x + 1e14 * free @ (free.T @ x),
        load,
        lambda energy: 1e-16 * energy,
        1e-13 * np.linalg.norm(load, axis=0),
        look_back=1,
        most_products=500,
    )
    exact = np.linalg.pinv(matrix, rcond=1e-9, hermitian=True) @ load
    elastic = solution.motion - free @ (free.T @ solution.motion)
    assert (np.linalg.norm(elastic - exact, axis=0) <= 1e-6 * np.linalg.norm(exact, axis=0)).all()


@pytest.mark.parametrize("look_back", [1, 8, 40])
def test_the_error_is_measured_over_enough_steps(look_back):
    """Stop no earlier than after these steps, and one more product."""
    matrix = stiff()
    solution = solve(matrix, loads(1, matrix), error=0.9, look_back=look_back)
    assert solution.products >= look_back + 1


def test_too_few_products_are_refused():
    matrix = stiff()
    with refusal("not_converged"):
        solve(matrix, loads(1, matrix), most_products=5)
