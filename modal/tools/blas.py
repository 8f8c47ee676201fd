"""Threads of BLAS: small products are computed by one thread, as others would only wait."""

from collections.abc import Iterator
from contextlib import contextmanager

try:
    from threadpoolctl import threadpool_limits
except ImportError:
    threadpool_limits = None


@contextmanager
def blas_threads(*, shared: bool) -> Iterator[None]:
    """Let BLAS compute each product with one thread within this context, unless they are `shared`.

    Where other programs use the cores, threads that share small products wait for each other many
    times as long as they work. Without threadpoolctl BLAS decides.
    """
    if shared or threadpool_limits is None:
        yield
    else:
        with threadpool_limits(1, "blas"):
            yield
