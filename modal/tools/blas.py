"""Threads of BLAS: small products are made by one, for whom others would only have to wait."""

from collections.abc import Iterator
from contextlib import contextmanager

try:
    from threadpoolctl import threadpool_limits
except ImportError:
    threadpool_limits = None


@contextmanager
def blas_threads(*, shared: bool) -> Iterator[None]:
    """Within it BLAS makes each product with one thread, unless they are large enough to be shared.

    Where other programs use the cores, threads that share small products wait for each other many
    times as long as they work. Without threadpoolctl BLAS decides.
    """
    if shared or threadpool_limits is None:
        yield
    else:
        with threadpool_limits(1, "blas"):
            yield
