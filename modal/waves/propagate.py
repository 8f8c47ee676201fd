"""The linear wave without time stepping: one Chebyshev recurrence on the source pattern.

With v = M^1/2 u and A = M^-1/2 K M^-1/2 the source wall's motion d(t) drives v'' + A v = c d(t), c
the scaled force on the particles for a unit displacement of the wall. Hence v(t) = y(A, t) c, where
y(omega^2, t) answers y'' + omega^2 y = d(t) from rest (`modal.waves.source`). As a function of x =
2 omega^2 / omega_max^2 - 1 it is expanded in Chebyshev polynomials, whose coefficients fall faster
than any power beyond order omega_max t / 2. One pass of T_k(X) c serves all times, and of every
T_k(X) c only the recorded rows are kept. The expansion holds in the complex plane too, so a tangent
that is not quite symmetric needs nothing else.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from modal.packing.network import Network
from modal.packing.sample import Sample
from modal.system.contacts import with_sliding
from modal.system.damping import ContactDamping
from modal.system.operator import ContactOperator
from modal.tools.arguments import checked
from modal.tools.arrays import Floats
from modal.tools.display import quantity
from modal.tools.errors import InputError
from modal.tools.workload import refuse_endless
from modal.waves.chebyshev import Observer, summed
from modal.waves.damped import propagate_damped
from modal.waves.driven import Driven
from modal.waves.nonlinear import NonlinearWave, propagate_nonlinear
from modal.waves.signals import Signals, record_times
from modal.waves.source import Motion, Pulse
from modal.waves.weights import Expansion, orders_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EXPANSION_COPIES = 4
"""Arrays of orders times times that `Expansion` holds at once."""


@dataclass(frozen=True, repr=False)
class LinearWave:
    """Result of `propagate`: signals, number of products with K, and the bound of the error.

    `truncation` is relative to the largest recorded displacement, and to the largest stress on
    either wall. It was computed in one of so many `repeats` of which the packing consists sideways.
    """

    signals: Signals
    products: int
    truncation: float
    repeats: int = 1

    def __repr__(self) -> str:
        peak = quantity(float(abs(self.signals.receiver_stress).max()), "Pa")
        return (
            f"<LinearWave: {self.signals!r}, {peak} at most on the receiver wall, {self.products} "
            f"products with K>"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the displacement over time and distance, as `Signals.plot`; returns the Axes."""
        return self.signals.plot(ax)


@overload
def propagate(
    network: Network | Sample, duration: float, *, nonlinear: Literal[True], **options: Any
) -> NonlinearWave: ...


@overload
def propagate(network: Network | Sample, duration: float, **options: Any) -> LinearWave: ...


@checked  # type: ignore[misc]  # the overloads leave the options to the function itself
def propagate(
    network: Network | Sample,
    duration: float,
    *,
    nonlinear: bool = False,
    motion: Motion | None = None,
    interval: float = 1e-6,
    tolerance: float = 1e-9,
    pre_stress: str = "none",
    sliding: str = "elastic",
    particles: bool = False,
    direction: str = "z",
    damping: ContactDamping | None = None,
    whole: bool = False,
    network_sha256: str = "",
    accuracy: float | None = None,
    time_step: float | None = None,
    friction: float | None = None,
) -> LinearWave | NonlinearWave:
    """The wave that a small motion of the source wall sends through a packing.

    The contacts' springs stay what they are (linear). There is no time-step error: at all recorded
    times displacements are off by `tolerance` of the largest recorded one at most, stresses by that
    of the largest on either wall; the result's `truncation` bounds both, and is above `tolerance`
    only where round-off leaves more. Its `signals` have displacements, m, of a chain of
    particles from wall to wall and of layers, and stresses on both walls, Pa: `time` (nt,),
    `chain_displacement` (nt, nc), `receiver_stress` (nt,). The wall moves along `direction`, and
    all is recorded along it: "z" sends P-waves, "x" and "y" send S-waves.

    `duration` and recording `interval` in s; `motion` of the source wall, by default the pulse of
    the study. `pre_stress` as in `modal.system.contacts`, `sliding` as of `modal.eigenmodes`;
    `particles` records every particle; `network_sha256` is noted in the signals. `damping` gives
    the contacts dashpots (`modal.system.damping`), which takes some ten times as many products.
    A packing of equal parts side by side, as a crystal, is computed in one of them where that is
    exact to the `tolerance` too (`modal.waves.driven`), unless `whole` asks for all of it.
    With `nonlinear` contacts follow their law instead: they harden, slide, open and close, and the
    wave is of any size (`modal.waves.nonlinear`, which alone has `accuracy`, `time_step` and, of a
    network, `friction`).
    InputError for impossible arguments, for a network without stiffness, and where the run would
    take more than a day or the memory; GrowthError where K has negative directions.

    >>> import modal
    >>> wave = propagate(modal.fcc(cells=(1, 1, 30)), duration=5e-5)
    >>> wave.signals.chain_displacement.shape
    (51, 30)
    """
    own: dict[str, Any] = {"accuracy": accuracy, "time_step": time_step, "friction": friction}
    own = {name: value for name, value in own.items() if value is not None}
    linear = {"tolerance": tolerance != 1e-9, "pre_stress": pre_stress != "none", "whole": whole}
    linear |= {"sliding": sliding != "elastic", "damping": damping is not None}
    for name in (name for name, given in linear.items() if given) if nonlinear else own:
        kind = "linear" if nonlinear else "non-linear"
        raise InputError(f"{name} is of the {kind} wave: leave it out, or take that")
    if nonlinear:
        return propagate_nonlinear(
            network,
            duration,
            motion=motion,
            interval=interval,
            particles=particles,
            direction=direction,
            network_sha256=network_sha256,
            **own,
        )
    if isinstance(network, Sample):
        network = network.network()
    if not (0 < interval <= duration < np.inf and 0 < tolerance < 1):
        raise InputError(
            "duration and interval must be positive, the interval no longer than the duration, "
            "the tolerance between 0 and 1"
        )
    started = clock.perf_counter()
    network = with_sliding(network, sliding)
    motion = motion or Pulse()
    if damping is not None and not damping.none:
        if pre_stress != "none":
            raise InputError(f"pre-stress {pre_stress!r} with damping: take none")
        damped, products = propagate_damped(
            network,
            duration,
            damping,
            motion,
            interval=interval,
            tolerance=tolerance,
            particles=particles,
            direction=direction,
            network_sha256=network_sha256,
        )
        return LinearWave(damped, products, tolerance)
    driven = Driven(
        network,
        duration,
        tolerance,
        pre_stress=pre_stress,
        particles=particles,
        direction=direction,
        whole=whole,
    )
    receivers = driven.receivers
    time, recorded, products, truncation = carried(
        driven.operator, driven.start, receivers, motion, duration, interval, tolerance
    )
    signals = receivers.signals(
        time,
        recorded,
        motion,
        time_step=interval,
        run_time=clock.perf_counter() - started,
        network_sha256=network_sha256,
    )
    return LinearWave(signals, products, truncation + driven.difference, driven.repeats)


def carried(
    operator: ContactOperator,
    start: Callable[[], Floats],
    receivers: Observer,
    motion: Motion,
    duration: float,
    interval: float,
    tolerance: float,
) -> tuple[Floats, Floats, int, float]:
    """Times (nt,), what is recorded at them (nt, count), products with K, and the truncation.

    `start` makes the mass-scaled force (6n,) on the particles for a unit displacement of the
    source, which goes by `motion`; the other arguments are those of `propagate`.
    """

    def series_for(top: float) -> Expansion:
        orders, times = orders_of(top, duration), duration / interval + 1
        numbers = EXPANSION_COPIES * orders * times + (orders + times) * receivers.count
        refuse_endless(
            f"a wave of {duration:g} s, recorded every {interval:g} s,",
            operator,
            products=orders / 1.1,
            bytes_needed=8 * numbers,
            remedy="take a shorter duration or a longer interval",
        )
        return Expansion(motion, record_times(duration, interval), top)

    def largest(series: Expansion, record: Floats) -> Floats:
        found = receivers.largest(record, motion.displacement(series.time))
        # A wave that has not come to the receiver wall yet: its stress counts beside the source's.
        found[:-1] = found[:-1].max(initial=0.0)
        return found

    series, record, products, error = summed(
        operator, start, receivers, series_for, largest, tolerance
    )
    return series.time, record, products, error
