"""Products by any number of threads and in any numbering: the same bits, and those of K."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from packings import PRE_STRESS
from places import ROOT, TESTS

from modal.packing import crystal as gallery
from modal.packing.network import Network
from modal.system import packed as packed_contacts
from modal.system.assembly import stiffness_matrix
from modal.system.operator import ContactOperator
from modal.system.packed import PackedContacts
from modal.tools import slabs as slabs_along_z


def crystal() -> Network:
    """720 spheres with shear forces, which the full tangent needs."""
    network = gallery.fcc(cells=(3, 3, 80))
    rng = np.random.default_rng(1)
    across = np.cross(network.normal, rng.standard_normal((network.n_contacts, 3)))
    return replace(network, force_tangential=0.1 * network.force_normal[:, None] * across)


def renumbered(network: Network, number: np.ndarray) -> Network:
    """The same packing, sphere k being number[k], its contacts in another order."""
    back = np.argsort(number)
    mixed = network.with_contacts(np.random.default_rng(2).permutation(network.n_contacts))
    return replace(
        mixed,
        **{k: getattr(network, k)[back] for k in ("position", "radius", "mass", "inertia")},
        particle_i=number[mixed.particle_i],
        particle_j=np.where(mixed.with_wall, mixed.particle_j, number[mixed.partner]),
    )


BY_THREADS = """
import sys
import numba
import numpy as np
sys.path.insert(0, "tests/system")
from modal.tools import loops, slabs
from modal.system.operator import ContactOperator
from test_cores import crystal, renumbered
slabs.ENOUGH = 1
network = crystal()
network = renumbered(network, np.random.default_rng(5).permutation(network.n_particles))
rng, done = np.random.default_rng(6), []
for threads in (1, 2, 3, 4):
    numba.set_num_threads(threads)
    assert loops.threads_for(network.n_particles) == threads
    for pre_stress in ("none", "full"):
        operator = ContactOperator(network, mass_scaled=True, pre_stress=pre_stress)
        assert len(operator._contacts.slabs) > 8
        for width in (1, 3):
            x = np.random.default_rng(7).standard_normal((operator.shape[0], width))
            done.append(operator.combine(x, 2 * x, 1e-9, -2.0, 0.5).tobytes())
assert all(bits == done[k % 4] for k, bits in enumerate(done)) and len(done) == 16
"""


def test_threads_change_no_bit():
    pytest.importorskip("numba")
    environment = os.environ | {"NUMBA_NUM_THREADS": "4", "PYTHONPATH": f"{ROOT}:{TESTS}"}
    environment["OMP_NUM_THREADS"] = "4"
    command = [sys.executable, "-c", BY_THREADS]
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr


WHOLE = """
import hashlib
from dataclasses import replace
import numpy as np
import modal
network = modal.fcc(cells=(5, 5, 210))
stiffness = network.stiffness_normal.copy()
stiffness[0] *= 1.1  # else one column of 210 would carry the wave
network = replace(network, stiffness_normal=stiffness)
wave = modal.propagate(network, 2e-4).signals
gain = modal.frequency_response(network, highest=5e4, resolution=2e3)
found = (wave.chain_displacement, wave.layer_displacement, wave.receiver_stress)
found += (gain.source_stress, gain.chain_displacement)
print(hashlib.sha256(b"".join(np.ascontiguousarray(x).tobytes() for x in found)).hexdigest())
"""


def test_a_wave_and_a_response_have_the_same_bits_with_one_thread_and_with_three():
    """5,250 spheres, enough for threads; the products of matrices at the end are BLAS's."""
    pytest.importorskip("numba")
    told = set()
    for threads in ("1", "3"):
        names = ("OMP", "OPENBLAS", "NUMBA", "MKL")
        environment = os.environ | {f"{name}_NUM_THREADS": threads for name in names}
        environment["PYTHONPATH"] = str(ROOT)
        done = subprocess.run(
            [sys.executable, "-c", WHOLE], cwd=ROOT, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        told.add(done.stdout)
    assert len(told) == 1 and len(told.pop()) > 32


@pytest.mark.parametrize("pre_stress", PRE_STRESS)
@pytest.mark.parametrize("slabs", [1, 16])
def test_any_numbering_gives_the_product_of_its_own_matrix(pre_stress, slabs, monkeypatch):
    """A row of K has some 80 entries; each error is below that many roundings of its terms."""
    pytest.importorskip("numba")
    network = crystal()
    number = np.random.default_rng(3).permutation(network.n_particles)
    foreign = renumbered(network, number)
    if slabs > 1:
        # Cut into slabs, but still without threads, whose loop takes seconds to compile.
        cut = PackedContacts.of
        monkeypatch.setattr(packed_contacts, "slabs_of", in_slabs)
        assert len(cut(foreign, pre_stress).slabs) > 8
    x = np.random.default_rng(4).standard_normal(6 * network.n_particles)
    found = ContactOperator(foreign, pre_stress=pre_stress) @ x
    K = stiffness_matrix(foreign, pre_stress=pre_stress)
    assert (abs(found - K @ x) <= 80 * np.finfo(float).eps * (abs(K) @ abs(x))).all()
    rows = (6 * number[:, None] + np.arange(6)).ravel()
    same = ContactOperator(network, pre_stress=pre_stress) @ x[rows]
    assert (abs(found[rows] - same) <= 160 * np.finfo(float).eps * (abs(K) @ abs(x))[rows]).all()


@pytest.mark.parametrize("order", [lambda operator: operator, ContactOperator.renumbered])
def test_slabs_at_rest_leave_out_no_force(order, monkeypatch):
    """A single moving sphere, anywhere; terms that cancel leave the round-off of the largest."""
    monkeypatch.setattr(packed_contacts, "slabs_of", in_slabs)
    network = crystal()
    network = renumbered(network, np.random.default_rng(3).permutation(network.n_particles))
    operator, K = order(ContactOperator(network)), stiffness_matrix(network)
    for sphere in range(0, network.n_particles, 7):
        x = np.zeros((network.n_particles, 6))
        x[sphere] = np.random.default_rng(sphere).standard_normal(6)
        found = operator.outward(operator @ operator.inward(x.ravel()))
        # Forces and torques differ in their unit, by a radius.
        error = (found - K @ x.ravel()).reshape(-1, 6)
        largest = (abs(K) @ abs(x.ravel())).reshape(-1, 6)
        for part in (slice(0, 3), slice(3, 6)):
            assert abs(error[:, part]).max() <= 80 * np.finfo(float).eps * largest[:, part].max()
        x[sphere, sphere % 6] = np.nan
        found = operator.outward(operator @ operator.inward(x.ravel()))
        assert np.isnan(found).any()


@pytest.mark.parametrize("pre_stress", PRE_STRESS)
def test_spheres_in_the_order_of_the_loops_change_no_bit(pre_stress, monkeypatch):
    """Every sum is made of the same terms in the same order; only their places in memory differ."""
    monkeypatch.setattr(packed_contacts, "slabs_of", in_slabs)
    network = crystal()
    foreign = renumbered(network, np.random.default_rng(3).permutation(network.n_particles))
    operator = ContactOperator(foreign, mass_scaled=True, pre_stress=pre_stress)
    inside = operator.renumbered()
    assert inside.order is None or (np.sort(inside.order) == np.arange(network.n_particles)).all()
    x, y = np.random.default_rng(4).standard_normal((2, 6 * network.n_particles))
    assert np.array_equal(inside.outward(inside.inward(x)), x)
    found = inside.outward(inside.combine(inside.inward(x), inside.inward(y), 1e-9, -2.0, 0.5))
    assert np.array_equal(found, operator.combine(x, y, 1e-9, -2.0, 0.5))
    both = np.column_stack([x, y])
    for block in (both, np.asfortranarray(both)):
        assert np.array_equal(inside.inward(block)[:, 1], inside.inward(both[:, 1]))
        assert np.array_equal(inside.outward(inside.inward(block)), both)


def in_slabs(ends: np.ndarray, n: int) -> np.ndarray:
    """`slabs_of` as for a packing of many spheres."""
    enough, slabs_along_z.ENOUGH = slabs_along_z.ENOUGH, 1
    try:
        return slabs_along_z.slabs_of(ends, n)
    finally:
        slabs_along_z.ENOUGH = enough


def test_order_of_contacts_does_not_depend_on_the_numbering():
    """The loop goes through the same spheres one after the other, whatever their numbers."""
    network = crystal()
    # No two spheres at the same height, so that the order along z is one.
    rng = np.random.default_rng(8)
    lift = rng.permutation(network.n_particles)[:, None] * [0, 0, 1e-9]
    network = replace(network, position=network.position + lift * network.radius[0])
    number = rng.permutation(network.n_particles)
    own, foreign = (
        PackedContacts.of(packing, "none") for packing in (network, renumbered(network, number))
    )
    # First ends are alike; of one sphere's contacts the order is that of the file.
    assert np.array_equal(own.slabs, foreign.slabs)

    def lower(contacts: PackedContacts, packing: Network) -> np.ndarray:
        z = packing.position[:, 2][np.maximum(contacts.ends, 0)]
        return np.where(contacts.ends[:, 1] < 0, z[:, 0], z.min(axis=1))

    assert np.array_equal(lower(own, network), lower(foreign, renumbered(network, number)))


def test_wide_packings_are_worked_through_in_columns(monkeypatch):
    """The order changes within the slabs only, and each contact is there once."""
    network = gallery.fcc(cells=(8, 8, 6))
    whole = PackedContacts.of(network, "none")
    monkeypatch.setattr(packed_contacts, "ACROSS", 2)
    cut = PackedContacts.of(network, "none")
    assert not np.array_equal(cut.ends, whole.ends)
    assert np.array_equal(cut.slabs, whole.slabs)
    bounds = whole.pieces[whole.slabs, 0]
    for first, last in zip(bounds[:-1], bounds[1:], strict=True):
        rows = (np.column_stack([of.ends, of.rows])[first:last] for of in (whole, cut))
        ordered = [part[np.lexsort(part.T)] for part in rows]
        assert np.array_equal(*ordered)
