"""Products of matrices whose bits do not depend on the number of threads.

BLAS cuts a large product among its threads, and rounds at each cut otherwise. OpenBLAS, which the
wheels of numpy bring, gives a product of up to 2^18 multiplications to one thread; from such blocks
a product of any size is put together, always in the same order.
"""

from math import isqrt

import numpy as np

from modal.tools.arrays import Array, Floats

ALONE, DEEP = 2**18, 256
"""Multiplications of a block, and terms of its sums, at most. Of 512 terms a block would be 22
wide, which fits the kernels of BLAS badly: a third slower."""


def same_bits_product(a: Array, b: Floats, out: Array | None = None) -> Array:
    """Shape (t, r): a @ b for a (t, k) and b (k, r), to the same bits with any number of threads.

    It is added to `out` where that is given. `a` may be complex: two real products, since those of
    complex numbers are shared out earlier.

    >>> import numpy as np
    >>> same_bits_product(np.eye(2), np.array([[1.0, 2.0], [3.0, 4.0]]))
    array([[1., 2.],
           [3., 4.]])
    """
    if out is None:
        out = np.zeros((len(a), b.shape[1]), a.dtype)
    if np.iscomplexobj(a):
        for part, sums in ((a.real, out.real), (a.imag, out.imag)):
            same_bits_product(np.ascontiguousarray(part), b, sums)
        return out
    across = isqrt(ALONE // min(max(len(b), 1), DEEP))
    for k in range(0, len(b), DEEP):
        terms = slice(k, k + DEEP)
        # Copies lie together in memory; rows of `b` are pages apart, and each is met many times.
        lefts = [a[t : t + across, terms].copy() for t in range(0, len(a), across)]
        for r in range(0, b.shape[1], across):
            columns = slice(r, r + across)
            right = b[terms, columns].copy()
            for n, left in enumerate(lefts):
                out[n * across : (n + 1) * across, columns] += left @ right
    return out
