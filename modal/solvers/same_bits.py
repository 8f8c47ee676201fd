"""Multiply matrices so that the bits of the product do not depend on the number of threads.

BLAS divides a large product among its threads, and each division changes the rounding of sums.
OpenBLAS, a part of the wheels of numpy, computes a product of up to 2^18 multiplications in one
thread. Here a product of any size is composed of such blocks, always in the same order.
"""

from math import isqrt

import numpy as np

from modal.tools.arrays import Array, Floats

MAX_BLOCK_MULTIPLICATIONS = 2**18
"""Multiplications up to which OpenBLAS gives a product to one thread."""
MAX_BLOCK_TERMS = 256
"""Largest number of terms in the sums of a block. With 512 terms a block would be 22 wide, which
fits the kernels of BLAS badly and takes a third more time."""


def same_bits_product(a: Array, b: Floats, out: Array | None = None) -> Array:
    """Return a @ b of shape (t, r), for a (t, k) and b (k, r), with bits that threads don't change.

    The product is added to `out` if that is given. `a` may be complex: two real products are then
    computed, since BLAS divides complex products among threads at a smaller size.

    >>> import numpy as np
    >>> same_bits_product(np.eye(2), np.array([[1.0, 2.0], [3.0, 4.0]]))
    array([[1., 2.],
           [3., 4.]])
    """
    if out is None:
        out = np.zeros((len(a), b.shape[1]), a.dtype)
    if np.iscomplexobj(a):
        same_bits_product(np.ascontiguousarray(a.real), b, out.real)
        same_bits_product(np.ascontiguousarray(a.imag), b, out.imag)
        return out
    terms = min(max(len(b), 1), MAX_BLOCK_TERMS)
    side = isqrt(MAX_BLOCK_MULTIPLICATIONS // terms)
    for k in range(0, len(b), MAX_BLOCK_TERMS):
        inner = slice(k, k + MAX_BLOCK_TERMS)
        # Copies lie together in memory; rows of `b` are pages apart, and each is read many times.
        lefts = [a[t : t + side, inner].copy() for t in range(0, len(a), side)]
        for r in range(0, b.shape[1], side):
            columns = slice(r, r + side)
            right = b[inner, columns].copy()
            for n, left in enumerate(lefts):
                out[n * side : (n + 1) * side, columns] += left @ right
    return out
