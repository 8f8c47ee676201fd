"""Products by any number of threads and in any numbering: the same bits, and those of K."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from changes import renumbered
from oracles import PRE_STRESS
from packings import sheared, sheared_crystal

from modal.packing import crystal as gallery
from modal.system import contact_order
from modal.system.assembly import stiffness_matrix
from modal.system.contact_order import OrderedContacts
from modal.system.operator import ContactOperator
from modal.tools import loops
from modal.tools import slabs as slabs_along_z

NETWORK = sheared_crystal()
NUMBER = np.random.default_rng(3).permutation(NETWORK.n_particles)
FOREIGN = renumbered(NETWORK, NUMBER)
SIZE = 6 * NETWORK.n_particles
"""The same packing, numbered and listed in two ways."""


@pytest.mark.parametrize("pre_stress", PRE_STRESS)
@pytest.mark.parametrize("slabs", [1, 16])
def test_any_numbering_gives_the_product_of_its_own_matrix(pre_stress, slabs, monkeypatch):
    """Compare products in two numberings with the matrix.

    A row of K has some 80 entries: each error is below as many roundings of its terms.
    """
    pytest.importorskip("numba")
    if slabs > 1:
        # Cut into slabs that threads share, but one after the other: their loop takes seconds to
        # compile.
        monkeypatch.setattr(contact_order, "slabs_of", in_slabs)
        monkeypatch.setattr(loops, "threads_for", lambda spheres: 3)
        assert len(OrderedContacts.from_network(FOREIGN, pre_stress).slabs) > 8
    x = np.random.default_rng(4).standard_normal(SIZE)
    product = ContactOperator(FOREIGN, pre_stress=pre_stress) @ x
    K = stiffness_matrix(FOREIGN, pre_stress=pre_stress)
    assert (abs(product - K @ x) <= 80 * np.finfo(float).eps * (abs(K) @ abs(x))).all()
    rows = (6 * NUMBER[:, None] + np.arange(6)).ravel()
    same = ContactOperator(NETWORK, pre_stress=pre_stress) @ x[rows]
    assert (abs(product[rows] - same) <= 160 * np.finfo(float).eps * (abs(K) @ abs(x))[rows]).all()


@pytest.mark.parametrize("order", [lambda operator: operator, ContactOperator.renumbered])
def test_slabs_at_rest_leave_out_no_force(order, monkeypatch):
    """Compare with the matrix if a single sphere moves, anywhere.

    Terms that cancel leave the round-off of the largest.
    """
    monkeypatch.setattr(contact_order, "slabs_of", in_slabs)
    operator = order(ContactOperator(FOREIGN))
    K = stiffness_matrix(FOREIGN)
    for sphere in range(0, FOREIGN.n_particles, 7):
        x = np.zeros((FOREIGN.n_particles, 6))
        x[sphere] = np.random.default_rng(sphere).standard_normal(6)
        product = operator.outward(operator @ operator.inward(x.ravel()))
        # Forces and torques differ in their unit, by a radius.
        error = (product - K @ x.ravel()).reshape(-1, 6)
        largest = (abs(K) @ abs(x.ravel())).reshape(-1, 6)
        for components in (slice(0, 3), slice(3, 6)):
            assert (
                abs(error[:, components]).max()
                <= 80 * np.finfo(float).eps * largest[:, components].max()
            )
        x[sphere, sphere % 6] = np.nan
        product = operator.outward(operator @ operator.inward(x.ravel()))
        assert np.isnan(product).any()


@pytest.mark.parametrize("pre_stress", PRE_STRESS)
def test_spheres_in_the_order_of_the_loops_change_no_bit(pre_stress, monkeypatch):
    """Compare products in two orders of spheres, bit by bit.

    Every sum has the same terms in the same order; only their places in memory differ.
    """
    monkeypatch.setattr(contact_order, "slabs_of", in_slabs)
    operator = ContactOperator(FOREIGN, mass_scaled=True, pre_stress=pre_stress)
    inside = operator.renumbered()
    assert inside.order is None or (np.sort(inside.order) == np.arange(SIZE // 6)).all()
    x, y = np.random.default_rng(4).standard_normal((2, SIZE))
    assert np.array_equal(inside.outward(inside.inward(x)), x)
    combined = inside.outward(inside.combine(inside.inward(x), inside.inward(y), 1e-9, -2.0, 0.5))
    assert np.array_equal(combined, operator.combine(x, y, 1e-9, -2.0, 0.5))
    both = np.column_stack([x, y])
    for block in (both, np.asfortranarray(both)):
        assert np.array_equal(inside.inward(block)[:, 1], inside.inward(both[:, 1]))
        assert np.array_equal(inside.outward(inside.inward(block)), both)


def test_wide_packings_are_worked_through_in_columns(monkeypatch):
    """Check the order of contacts in columns of a wide packing, and the product."""
    network = gallery.fcc(cells=(8, 5, 6))
    uncut = OrderedContacts.from_network(network, "none")
    monkeypatch.setattr(contact_order, "COLUMN_WIDTH_IN_DIAMETERS", 2)
    cut = OrderedContacts.from_network(network, "none")
    assert not np.array_equal(cut.ends, uncut.ends)
    assert np.array_equal(cut.slabs, uncut.slabs)
    # One column after the other: from 0 to 7.5 and to 4.5 diameters there are four and two.
    position = network.position[:, :2] - network.position[:, :2].min(axis=0)
    column = np.minimum(position / position.max(axis=0) * [4, 2], [3, 1]).astype(int) @ [2, 1]
    assert (np.diff(column[cut.ends[:, 0]]) >= 0).all()
    # What springs between spheres do not need takes neither memory nor time: levers are along the
    # normals but for round-off.
    plain = OrderedContacts.from_network(sheared(), "none")
    assert [plain.lateral, plain.aside, plain.rolling] == 3 * [None]
    x = np.random.default_rng(4).standard_normal(6 * network.n_particles)
    K = stiffness_matrix(network)
    assert ContactOperator(network) @ x == pytest.approx(K @ x, abs=1e-12 * abs(K @ x).max())


def in_slabs(ends: np.ndarray, n: int, crossing: int = 0) -> np.ndarray:
    """Return `slabs_of` as for a packing of many spheres."""
    enough = slabs_along_z.ENOUGH
    slabs_along_z.ENOUGH = 1
    try:
        return slabs_along_z.slabs_of(ends, n, crossing)
    finally:
        slabs_along_z.ENOUGH = enough


def test_programs_that_keep_a_loop_at_once_keep_each_its_own(tmp_path, monkeypatch):
    """Save two loops at once, each with a pause between reading and writing the index."""
    monkeypatch.setattr(pytest.importorskip("numba").config, "CACHE_DIR", str(tmp_path))
    files = [loops.compile_cached(sheared_crystal)._cache._cache_file for _ in range(2)]
    kind = type(files[0])
    write = type(files[0])._save_index
    monkeypatch.setattr(kind, "_save_index", lambda *given: time.sleep(0.1) or write(*given))
    with ThreadPoolExecutor() as pool:
        list(pool.map(lambda file, of: file.save(of, of), files, "ab"))
    assert files[0].load("a") + files[1].load("b") == "ab"
