"""Products of matrices whose bits do not depend on the number of threads.

BLAS cuts a large product among its threads, and rounds at each cut otherwise. OpenBLAS, which the
wheels of numpy bring, gives a product of up to 2^18 multiplications to one thread; from such blocks
a product of any size is put together, always in the same order.
"""

from __future__ import annotations

from itertools import product
from math import isqrt

import numpy as np

from modal.formats.arrays import Array, Floats

ALONE, DEEP = 2**18, 512
"""Multiplications of a block, and terms of its sums, at most."""


def same_bits_product(a: Array, b: Floats) -> Array:
    """Shape (t, r): a @ b for a (t, k) and b (k, r), to the same bits with any number of threads.

    `a` may be complex: two real products, since those of complex numbers are shared out earlier.

    >>> import numpy as np
    >>> same_bits_product(np.eye(2), np.array([[1.0, 2.0], [3.0, 4.0]]))
    array([[1., 2.],
           [3., 4.]])
    """
    if np.iscomplexobj(a):
        real, imaginary = (np.ascontiguousarray(part) for part in (a.real, a.imag))
        return same_bits_product(real, b) + 1j * same_bits_product(imaginary, b)
    out = np.zeros((len(a), b.shape[1]))
    across = isqrt(ALONE // min(max(len(b), 1), DEEP))
    starts = (range(0, n, step) for n, step in ((len(b), DEEP), (len(a), across)))
    for k, t in product(*starts):
        terms, rows = slice(k, k + DEEP), slice(t, t + across)
        left = a[rows, terms]
        for r in range(0, b.shape[1], across):
            columns = slice(r, r + across)
            out[rows, columns] += left @ b[terms, columns]
    return out
