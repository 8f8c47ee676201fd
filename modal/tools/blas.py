"""Limit the threads of BLAS: for small products more than one thread costs time."""

from collections.abc import Iterator
from contextlib import contextmanager

try:
    from threadpoolctl import threadpool_limits
except ImportError:
    threadpool_limits = None


@contextmanager
def blas_threads(*, shared: bool) -> Iterator[None]:
    """Let BLAS compute each product with one thread within this context, unless they are `shared`.

    If other programs use the cores, threads that share small products wait for each other much
    longer than they compute. Without threadpoolctl BLAS chooses the number of threads.
    """
    if shared or threadpool_limits is None:
        yield
    else:
        with threadpool_limits(1, "blas"):
            yield
