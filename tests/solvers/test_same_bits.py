"""Products of matrices in blocks, against the product at once."""

import os
import subprocess
import sys

import numpy as np
import pytest

from modal.solvers.same_bits import same_bits_product

pytestmark = pytest.mark.two_ways

EPS = np.finfo(float).eps


@pytest.mark.parametrize("shape", [(1, 1, 1), (7, 9, 5), (20, 12, 40), (41, 1030, 23), (0, 3, 4)])
@pytest.mark.parametrize("kind", [float, complex])
def test_blocks_make_the_whole_product(shape, kind, monkeypatch):
    """Some blocks are cut short; sums of k terms err by k roundings at most."""
    t, k, r = shape
    rng = np.random.default_rng(t)
    a, b = rng.standard_normal((k, t)).T.astype(kind), rng.standard_normal((k, r))
    if kind is complex:
        a = a + 1j * rng.standard_normal((t, k))
    found = same_bits_product(a, b)
    assert found.dtype == kind
    assert (abs(found - a @ b) <= 2 * k * EPS * (abs(a) @ abs(b))).all()


@pytest.mark.parametrize("depth", [1, 100, 511, 512, 2000])
def test_blocks_are_small_enough_for_one_thread(depth):
    """OpenBLAS shares out what has more than 2^18 multiplications; the blocks fill most of that."""
    sizes = []

    class Noting(np.ndarray):
        """Blocks that note their products."""

        def __matmul__(self, other):
            sizes.append(len(self) * other.size)
            return np.asarray(self) @ other

    a = np.ones((700, depth)).view(Noting)
    found = same_bits_product(a, np.ones((depth, 700)))
    assert (found == depth).all()
    assert max(sizes) <= 2**18 and max(sizes) > 0.8 * min(2**18, 700**2 * depth)


def test_bits_do_not_depend_on_the_threads_of_blas():
    """One and four, each in its own process: of blocks four times as large the bits differ."""
    program = (
        "import hashlib, numpy as np; from modal.solvers.same_bits import same_bits_product\n"
        "r = np.random.default_rng(1); done = hashlib.sha256()\n"
        "for t, k, n in ((700, 100, 700), (41, 1030, 23), (300, 2000, 300), (3000, 7, 40)):\n"
        "    a, b = r.standard_normal((t, k)), r.standard_normal((k, n))\n"
        "    done.update(same_bits_product(a, b))\n"
        "print(done.hexdigest())"
    )
    found = set()
    for threads in "1", "4":
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        environment = os.environ | dict.fromkeys(names, threads)
        run = subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, check=True
        )
        found.add(run.stdout)
    assert len(found) == 1
