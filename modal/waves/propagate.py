"""The linear wave through a packing: source, system, integrator and receivers put together."""

import time as clock
from dataclasses import dataclass
from typing import Any, Literal, overload

import numpy as np

from modal.packing.network import Network
from modal.packing.sample import Sample
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked
from modal.tools.errors import InputError
from modal.waves.defaults import default_interval, default_pulse
from modal.waves.forced_system import ForcedSystem
from modal.waves.integrators import by_polynomials, by_series
from modal.waves.motions import Motion
from modal.waves.nonlinear import ACCURACY, NonlinearRuns, NonlinearWave, at_rest
from modal.waves.receivers import Receivers
from modal.waves.signals import Wave
from modal.waves.sources import Source, Wall

TOLERANCE = 1e-9
"""Of a linear wave where no other is asked for."""


@dataclass(frozen=True, repr=False)
class LinearWave(Wave):
    """Result of `modal.propagate` on springs.

    Attributes
    ----------
    signals : Signals
        What was recorded.
    products : int
        Products with K.
    truncation : float
        Bound of the error, relative to the largest recorded displacement, and to the largest stress
        on either wall.
    repeats : int, default 1
        Of how many equal parts the packing consists sideways, one of which was computed.

    Examples
    --------
    >>> import modal
    >>> wave = modal.propagate(modal.fcc(cells=(2, 2, 4)), 1e-5)
    >>> wave.repeats, wave.truncation < 1e-9
    (4, True)
    """

    products: int
    truncation: float
    repeats: int = 1


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
    source: Source | None = None,
    motion: Motion | None = None,
    interval: float | None = None,
    tolerance: float | None = None,
    pre_stress: str = "none",
    sliding: str = "elastic",
    particles: bool = False,
    direction: str = "z",
    damping: ContactDamping | None = None,
    whole: bool = False,
    time_step: float | None = None,
    friction: float | None = None,
) -> LinearWave | NonlinearWave:
    """The wave that a small motion of a source sends through a packing.

    The contacts' springs stay what they are (linear), and there is no time-step error. A packing of
    equal parts side by side, as a crystal, is computed in one of them where that is exact to the
    `tolerance` too (`modal.waves.forced_system`). With `nonlinear` contacts follow their law
    instead: they harden, slide, open and close, and the wave is of any size
    (`modal.waves.nonlinear`).

    Parameters
    ----------
    network : Network or Sample
        The packing, n spheres.
    duration : float
        s.
    nonlinear : bool, default False
        Contacts by their law.
    source : Source, optional
        One of `modal.waves.sources`: the source wall (default), a plane inside the packing that
        opens, or one sphere that is pushed.
    motion : Motion, optional
        Of the source, m (N of a force); by default one pulse with a frequency, Hz, of 0.33 V / D,
        and 1e-6 D high, or a hundredth of the mean overlap where that is less.
    interval : float, optional
        Between recorded times, s; by default 0.3 D / V, with the affine velocity V of P-waves.
    tolerance : float, optional
        Error of displacements, in parts of the largest recorded one, and of stresses, in parts of
        the largest on either wall: 1e-9. Of a non-linear wave that of displacements by the time
        step: 1e-3.
    pre_stress : str, default "none"
        As of `modal.eigenmodes`.
    sliding : str, default "elastic"
        As of `modal.eigenmodes`.
    particles : bool, default False
        Record every particle.
    direction : str, default "z"
        Of the motion, and of all records: "z" sends P-waves, "x" and "y" S-waves, "torsion" turns
        about z.
    damping : ContactDamping, optional
        Dashpots of the contacts (`modal.system.damping`); takes some ten times as many products K
        u.
    whole : bool, default False
        Compute all parts of a packing of equal ones.
    time_step : float, optional
        s; goes by leapfrog, with the error of DEM programs.
    friction : float, optional
        Of the non-linear wave alone: a network has none, a sample its own.

    Returns
    -------
    LinearWave or NonlinearWave
        `signals`: `time` (nt,) s, `chain_displacement` (nt, nc) m of particles from wall to wall,
        `layer_displacement` (nt, nl) m, `receiver_stress` (nt,) Pa ...; `truncation` bounds the
        error, and is above `tolerance` only where round-off leaves more.

    Raises
    ------
    InputError
        For impossible arguments, for a network without stiffness, and where the run would take more
        than a day or the memory.
    GrowthError
        Where K has negative directions.

    Examples
    --------
    >>> import modal
    >>> wave = propagate(modal.fcc(cells=(1, 1, 30)), duration=5e-5)
    >>> wave.signals.chain_displacement.shape
    (51, 30)
    >>> from modal.waves.sources import Plane
    >>> endless = modal.fcc(cells=(1, 1, 40), periodic_z=True)
    >>> shear = propagate(endless, 2e-5, source=Plane(endless.length / 2), direction="x")
    >>> shear.signals.layer_displacement.shape
    (21, 28)
    """
    of_springs = {"pre_stress": pre_stress != "none", "sliding": sliding != "elastic"}
    of_springs |= {"damping": damping is not None, "whole": whole}
    other, foreign = "non-linear", {"friction": friction is not None}
    if nonlinear:
        other, foreign = "linear", of_springs
    for name in (name for name, given in foreign.items() if given):
        raise InputError(
            "input", f"{name} is of the {other} wave", remedy="leave it out, or take that"
        )
    error = tolerance or (ACCURACY if nonlinear else TOLERANCE)
    sample = at_rest(network, friction) if nonlinear else None
    if isinstance(network, Sample):
        network = network.network()
    source = source or Wall()
    if motion is None:
        motion = default_pulse(network, source, direction)
    if interval is None:
        interval = default_interval(network, duration, time_step)
    if not (0 < interval <= duration < np.inf and 0 < error < 1 and tolerance != 0):
        raise InputError(
            "input",
            "duration and interval must be positive, the interval no longer than the duration, "
            "the tolerance between 0 and 1",
        )
    if sample is not None:
        runs = NonlinearRuns(sample, duration, interval, source, motion, direction, particles)
        return runs.wave(error, time_step)
    started = clock.perf_counter()
    system = LinearSystem.of(network, pre_stress=pre_stress, sliding=sliding, damping=damping)
    receivers = Receivers(system.network, direction, particles=particles)
    forced = ForcedSystem.of(system, source, receivers, duration, error, whole=whole)
    if forced.dashpots and time_step is None:
        wave = by_series(forced, motion, duration, interval, error)
    else:
        wave = by_polynomials(forced, motion, duration, interval, error, time_step)
    signals = receivers.signals(
        wave.time,
        wave.record,
        motion,
        source,
        forced.stresses,
        producer="linear",
        time_step=time_step or interval,
        run_time=clock.perf_counter() - started,
    )
    part = forced.part
    return LinearWave(signals, wave.products, wave.error + part.difference, part.count)
