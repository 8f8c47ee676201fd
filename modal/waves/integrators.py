"""What carries a wave through a `Driven` system, and the one that is exact in time.

The source's motion d(t) drives v'' + A v = c d(t). Hence v(t) = y(A, t) c, where y(omega^2, t)
answers y'' + omega^2 y = d(t) from rest (`modal.waves.source`). As a function of x = 2 omega^2 /
omega_max^2 - 1 it is expanded in Chebyshev polynomials, whose coefficients fall faster than any
power beyond order omega_max t / 2. One pass of T_k(X) c serves all times, and of every T_k(X) c
only the recorded rows are kept. The expansion holds in the complex plane too, so a tangent that is
not quite symmetric needs nothing else. Others are in `modal.waves.taylor` and
`modal.waves.leapfrog`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.workload import refuse_endless
from modal.waves.chebyshev import summed
from modal.waves.driven import Driven
from modal.waves.signals import record_times
from modal.waves.source import Motion
from modal.waves.weights import Expansion, orders_of

EXPANSION_COPIES = 4
"""Arrays of orders times times that `Expansion` holds at once."""


@dataclass(frozen=True)
class Seen:
    """Record (nt, count) at times (nt,), s, of what a `Driven` system's rows read, forces complete.

    `products` with K; `error`: a bound, relative to the largest force and the largest motion.
    """

    time: Floats
    record: Floats
    products: int
    error: float


@runtime_checkable
class Integrator(Protocol):
    """Carries a wave through a driven system."""

    @property
    def time_step(self) -> float | None:
        """Of its own, s; None of one that has none."""

    def carry(self, driven: Driven, motion: Motion, duration: float, interval: float) -> Seen:
        """What is recorded from 0 on at every `interval`, s, of the `duration`, s.

        InputError where it cannot: for dashpots, for an unstable packing, for an endless run.
        """


@dataclass(frozen=True)
class Chebyshev:
    """Without time step: exact to the `tolerance`, relative. It knows no dashpots."""

    tolerance: float = 1e-9
    time_step = None

    def carry(self, driven: Driven, motion: Motion, duration: float, interval: float) -> Seen:
        """The record, by one recurrence; GrowthError where K has negative directions."""
        refuse_dashpots(driven, "Chebyshev polynomials of K")

        def series_for(top: float) -> Expansion:
            orders, times = orders_of(top, duration), duration / interval + 1
            numbers = EXPANSION_COPIES * orders * times + (orders + times) * driven.count
            refuse_endless(
                f"a wave of {duration:g} s, recorded every {interval:g} s,",
                driven.springs,
                products=orders / 1.1,
                bytes_needed=8 * numbers,
                remedy="take a shorter duration or a longer interval",
            )
            return Expansion(motion, record_times(duration, interval), top)

        def largest(series: Expansion, record: Floats) -> Floats:
            found = driven.largest(record, motion.displacement(series.time))
            # A wave that has not come to the receiver wall yet: its stress counts beside the
            # source's.
            found[:-1] = found[:-1].max(initial=0.0)
            return found

        series, record, products, error = summed(
            driven.springs, driven.push.copy, driven, series_for, largest, self.tolerance
        )
        whole = driven.recorded(record, motion.displacement(series.time))
        return Seen(series.time, whole, products, error)


def refuse_dashpots(driven: Driven, what: str) -> None:
    """InputError of an integrator that does not know them."""
    if driven.dashpots is not None:
        raise InputError(f"{what} know no damping of contacts; leave it out, or give no time step")
