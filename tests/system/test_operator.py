"""K u without a matrix against the assembled matrix and the slow oracle."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from oracles import PRE_STRESS, contact_matrices
from packings import random_springs

from modal.system import contact_order
from modal.system.assembly import diagonal_blocks, mass_diagonal, stiffness_matrix
from modal.system.operator import ContactOperator
from modal.tools import loops

pytestmark = pytest.mark.two_ways

EPS = np.finfo(float).eps


def round_off(network, pre_stress, x) -> np.ndarray:
    """Return a bound of the error of K x, contact by contact, for x (6n, k) or (3n, k).

    A contact's twelve forces are sums of some 20 products, none above its largest stiffness times
    its largest motion (levers are about 1 here). The entries of the assembled K are no bound: a
    short branch makes the pre-stress so large that its terms cancel in them.
    """
    size = len(x) // network.n_particles
    largest = abs(contact_matrices(network, pre_stress)).max(axis=(1, 2))
    largest_motion = abs(x).reshape(network.n_particles, size, -1).max(axis=1)
    i = network.particle_i
    j = network.particle_j
    pair = j >= 0
    reach = largest_motion[i] + np.where(pair[:, None], largest_motion[j], 0.0)
    bound = np.zeros_like(largest_motion)
    np.add.at(bound, i, largest[:, None] * reach)
    np.add.at(bound, j[pair], (largest[:, None] * reach)[pair])
    return 20 * EPS * np.repeat(bound, size, axis=0)


@pytest.mark.parametrize("pre_stress", PRE_STRESS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_blocks_of_the_bodies_without_the_matrix(pre_stress, seed):
    network = random_springs(seed)
    n = network.n_particles
    K_blocks = stiffness_matrix(network, pre_stress=pre_stress).toarray().reshape(n, 6, n, 6)
    expected = np.einsum("nanb->nab", K_blocks)
    blocks = diagonal_blocks(network, pre_stress)
    # Sums of a few dozen terms, each at most of the size of the largest entry.
    assert abs(blocks - expected).max() <= 100 * EPS * abs(expected).max()


@pytest.mark.parametrize("dof", [6, 3])
@pytest.mark.parametrize("mass_scaled", [False, True])
@pytest.mark.parametrize("pre_stress", PRE_STRESS)
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), width=st.sampled_from([None, 1, 3, 8]))
@example(seed=351, width=3)
def test_equal_to_the_matrix(dof, mass_scaled, pre_stress, seed, width):
    network = random_springs(seed)
    K = stiffness_matrix(network, dof, pre_stress)
    mass = mass_diagonal(network, dof)
    scale = (1 / np.sqrt(mass) if mass_scaled else np.ones(len(mass)))[:, None]
    applied = ContactOperator(network, dof, mass_scaled=mass_scaled, pre_stress=pre_stress)
    shape = (K.shape[0],) if width is None else (K.shape[0], width)
    x = np.random.default_rng(seed).standard_normal(shape)
    columns = x.reshape(K.shape[0], -1)
    expected = (scale * (K @ (scale * columns))).reshape(shape)
    bound = (scale * round_off(network, pre_stress, scale * columns)).reshape(shape)
    assert (abs(applied @ x - expected) <= bound).all()


@pytest.fixture(scope="module")
def operator():
    return ContactOperator(random_springs(1))


@pytest.fixture(scope="module")
def motion(operator):
    return np.random.default_rng(2).standard_normal(operator.shape[0])


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda x: x[:-1], id="one number short"),
        pytest.param(lambda x: x[:, None], id="a column for a vector"),
        pytest.param(lambda x: x.astype(complex), id="complex"),
    ],
)
def test_motion_of_another_shape_or_type_is_a_mistake(operator, motion, change):
    out = np.zeros_like(motion)
    with pytest.raises(ValueError):
        operator.combine(change(motion), out, 1.0)


def test_complex_motion_has_no_product(operator, motion):
    with pytest.raises(ValueError):
        operator @ motion.astype(complex)


def test_product_is_added_to_an_array_in_no_order_of_the_loop(operator, motion):
    strided = np.zeros((len(motion), 2))[:, 0]
    total = operator.combine(motion, strided, 1.0, gamma=1.0)
    assert np.array_equal(total, operator.apply(motion))


def test_former_content_of_the_output_does_not_matter(operator, motion):
    nan = np.full(len(motion), np.nan)
    assert np.array_equal(operator.combine(motion, nan, 1.0), operator.apply(motion))


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("width", [1, 8])
@pytest.mark.parametrize(("own", "kept"), [(-2.0, -1.0), (0.0, 1.0), (3.0, 0.0), (0.0, 0.0)])
def test_sums_by_component_are_those_as_they_came(own, kept, width, compiled, monkeypatch):
    """Compare sums that are computed beside the product with sums of the arrays.

    Some spheres have no contacts; contacts are worked through in pieces of seven.
    """
    monkeypatch.setattr(contact_order, "CONTACTS_PER_PIECE", 7)
    if not compiled:
        monkeypatch.setattr(loops, "numba", None)
    network = random_springs(7, particles=40, contacts=30)
    assert len(np.unique(network.particle_i)) < 40
    applied = ContactOperator(network)
    rng = np.random.default_rng(8)
    u, out = rng.standard_normal((2, applied.shape[0], width))
    a = out.reshape(-1, 6, width).copy()
    b = u.reshape(-1, 6, width)
    plain = applied.combine(u, out.copy(), 2.0, own, kept)
    sums = np.full((2, 6, width), np.nan)
    combined = applied.combine(u, out, 2.0, own, kept, sums=sums)
    K = stiffness_matrix(network)
    bound = 2 * round_off(network, "none", u) + EPS * (3 * abs(u) + abs(plain))
    expected = 2 * (K @ u) + own * u + kept * a.reshape(u.shape)
    for product in (plain, combined):
        assert (abs(product - expected) <= 3 * bound).all()
    assert sums == pytest.approx(np.stack([(a * a).sum(axis=0), (a * b).sum(axis=0)]), rel=1e-13)
