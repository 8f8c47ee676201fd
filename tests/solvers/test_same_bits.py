"""Products of matrices in blocks, against the product at once; how many threads make them."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from places import ROOT, TESTS

from modal.solvers.same_bits import same_bits_product
from modal.tools.blas import blas_threads

EPS = np.finfo(float).eps


@pytest.mark.parametrize("shape", [(1, 1, 1), (7, 9, 5), (20, 12, 40), (41, 1030, 23), (0, 3, 4)])
@pytest.mark.parametrize("kind", [float, complex])
def test_blocks_make_the_whole_product(shape, kind, monkeypatch):
    """Compare products in blocks with the product at once.

    Some blocks are cut short. Sums of k terms err by k roundings at most.
    """
    t, k, r = shape
    rng = np.random.default_rng(t)
    a = rng.standard_normal((k, t)).T.astype(kind)
    b = rng.standard_normal((k, r))
    if kind is complex:
        a = a + 1j * rng.standard_normal((t, k))
    product = same_bits_product(a, b)
    assert product.dtype == kind
    assert (abs(product - a @ b) <= 2 * k * EPS * (abs(a) @ abs(b))).all()


def digests_with(threads: int) -> dict:
    """Return what `threads.py` prints with so many threads of every library."""
    names = ("OMP", "OPENBLAS", "NUMBA", "MKL")
    environment = os.environ | {f"{name}_NUM_THREADS": str(threads) for name in names}
    environment["PYTHONPATH"] = os.pathsep.join([str(ROOT), str(TESTS)])
    # Threads that wait leave the processor: the loops are short, and another program may have one
    # of the cores.
    environment["OMP_WAIT_POLICY"] = "passive"
    program = [sys.executable, str(TESTS / "threads.py")]
    done = subprocess.run(program, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_threads_change_no_bit():
    """Compare each loop, solver and wave that `threads.py` runs, with one thread and with two."""
    pytest.importorskip("numba")
    single = digests_with(1)
    shared = digests_with(2)
    assert single["threads"] == 1
    assert shared["threads"] == 2
    assert single["digests"] == shared["digests"]


@pytest.mark.parametrize("shared", [True, False])
def test_small_products_take_one_thread_of_blas(shared):
    """Check the number of BLAS threads within the context, and that it is restored."""
    pool = pytest.importorskip("threadpoolctl")

    def threads() -> set[int]:
        return {
            library["num_threads"]
            for library in pool.ThreadpoolController().select(user_api="blas").info()
        }

    with pool.threadpool_limits(2, "blas"):
        with blas_threads(shared=shared):
            assert threads() == {2 if shared else 1}
        assert threads() == {2}
