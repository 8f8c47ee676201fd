"""Propagate a wave through a packing: combine source, system, integrator and receivers."""

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypedDict, Unpack, overload

import numpy as np

from modal.packing.network import Network
from modal.packing.sample import Sample
from modal.system.contacts import PreStress, Sliding
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked
from modal.tools.errors import InputError
from modal.waves.defaults import default_interval, default_pulse
from modal.waves.discs import Disc
from modal.waves.forced_system import ForcedSystem
from modal.waves.integrators import Integration, by_polynomials
from modal.waves.motions import Motion
from modal.waves.nonlinear import NONLINEAR_TOLERANCE, NonlinearRuns, NonlinearWave, sample_at_rest
from modal.waves.receivers import Receivers
from modal.waves.signals import Direction, Wave
from modal.waves.sources import Source, default_source, direction_of, hold_own_bodies
from modal.waves.taylor_series import by_series

LINEAR_TOLERANCE = 1e-9
"""Default error of a linear wave, relative to the largest record. The number of products with K
grows only with its logarithm, so that a larger one would save little."""


@dataclass(frozen=True, repr=False)
class LinearWave(Wave):
    """Result of `modal.propagate` with linear springs.

    Attributes
    ----------
    signals : Signals
        The recorded signals.
    products : int
        Number of products with K.
    truncation : float
        Bound of the error, relative to the largest recorded displacement, and to the largest stress
        on either wall.
    repeats : int, default 1
        Number of equal parts, side by side, of which the packing consists; only one was computed.

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


class WaveOptions(TypedDict, total=False):
    """Options of a wave of either kind; `propagate` documents them."""

    source: Source | None
    motion: Motion | None
    interval: float | None
    tolerance: float | None
    particles: bool
    direction: Direction | None
    receivers: Sequence[Disc]
    time_step: float | None


class LinearOptions(WaveOptions, total=False):
    """Options of a linear wave."""

    pre_stress: PreStress
    sliding: Sliding
    damping: ContactDamping | None
    whole: bool


class NonlinearOptions(WaveOptions, total=False):
    """Options of a non-linear wave."""

    friction: float | None
    rolling: float | None
    twisting: float | None


@overload
def propagate(
    network: Network | Sample,
    duration: float,
    *,
    nonlinear: Literal[True],
    **options: Unpack[NonlinearOptions],
) -> NonlinearWave: ...


@overload
def propagate(
    network: Network | Sample,
    duration: float,
    *,
    nonlinear: Literal[False] = False,
    **options: Unpack[LinearOptions],
) -> LinearWave: ...


@checked
def propagate(
    network: Network | Sample,
    duration: float,
    *,
    nonlinear: bool = False,
    source: Source | None = None,
    motion: Motion | None = None,
    interval: float | None = None,
    tolerance: float | None = None,
    pre_stress: PreStress = "none",
    sliding: Sliding = "elastic",
    particles: bool = False,
    direction: Direction | None = None,
    receivers: Sequence[Disc] = (),
    damping: ContactDamping | None = None,
    whole: bool = False,
    time_step: float | None = None,
    friction: float | None = None,
    rolling: float | None = None,
    twisting: float | None = None,
) -> LinearWave | NonlinearWave:
    """Propagate the wave that a motion of a source sends through a packing.

    By default contacts are linear springs, and there is no time-step error. If a packing consists
    of equal parts side by side, as a crystal does, one of them is computed if this is exact within
    `tolerance` (`modal.waves.forced_system`). With `nonlinear=True` contacts follow their law: they
    harden, slide, open and close, and the wave may have any size (`modal.waves.nonlinear`).

    Parameters
    ----------
    network : Network or Sample
        The packing, n spheres.
    duration : float
        Length of the record, s.
    nonlinear : bool, default False
        Whether contacts follow their law.
    source : Source, optional
        One of `modal.sources`: the source wall (default), flat or of held spheres, a plane inside
        the packing that opens, a force on one sphere, or a disc of spheres.
    motion : Motion, optional
        Motion of the source, m, or N for a force. The default is one pulse of frequency 0.33 V / D,
        Hz, and of amplitude 1e-6 D or a hundredth of the mean overlap, whichever is smaller.
    interval : float, optional
        Time between records, s; by default 0.3 D / V, with the affine velocity V of P-waves.
    tolerance : float, optional
        Error of displacements, relative to the largest recorded one, and of stresses, relative to
        the largest on either wall; by default 1e-9. For a non-linear wave, the error of
        displacements due to the time step; by default 1e-3.
    pre_stress : str, default "none"
        As in `modal.eigenmodes`.
    sliding : str, default "elastic"
        As in `modal.eigenmodes`.
    particles : bool, default False
        Whether to record every particle.
    direction : str, optional
        Direction of the motion and of all records: "z" sends P-waves, "x" and "y" S-waves,
        "torsion" turns about z. The default is that of a disc, else "z".
    receivers : sequence of Disc, optional
        Discs whose mean motion is recorded.
    damping : ContactDamping, optional
        Dashpots of the contacts (`modal.system.damping`); the wave then takes some ten times as
        many products K u.
    whole : bool, default False
        Whether to compute all equal parts of a packing, not only one.
    time_step : float, optional
        Step, s, of the leapfrog scheme of DEM codes; the result has the time-integration error of
        this scheme.
    friction : float, optional
        Coefficient of friction for a non-linear wave: required for a network; by default that of a
        sample.
    rolling, twisting : float, optional
        Coefficients of rolling and twisting friction for a non-linear wave, as in
        `modal.random_packing`; by default those of the sample.

    Returns
    -------
    LinearWave or NonlinearWave
        `signals`: `time` (nt,) s, `chain_displacement` (nt, nc) m of particles from wall to wall,
        `layer_displacement` (nt, nl) m, `disc_displacement` (nt, nd) m of receivers,
        `receiver_stress` (nt,) Pa ...; `truncation` bounds the error, and exceeds `tolerance` only
        if round-off does.

    Raises
    ------
    InputError
        If an argument is impossible, if the source moves nothing, or if the run would take more
        than a day or more than the free memory.
    GrowthError
        If K has negative directions.

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
    if nonlinear:
        _refuse_options(
            "linear",
            pre_stress=pre_stress != "none",
            sliding=sliding != "elastic",
            damping=damping is not None,
            whole=whole,
        )
    else:
        _refuse_options(
            "non-linear",
            friction=friction is not None,
            rolling=rolling is not None,
            twisting=twisting is not None,
        )
    error = tolerance or (NONLINEAR_TOLERANCE if nonlinear else LINEAR_TOLERANCE)
    sample = None
    if nonlinear:
        sample = sample_at_rest(network, friction, rolling, twisting)
    if isinstance(network, Sample):
        network = network.network()
    source = source or default_source(network)
    direction = direction_of(source, direction)
    if motion is None:
        motion = default_pulse(network, source, direction)
    if interval is None:
        interval = default_interval(network, duration, time_step)
    if not (0 < interval <= duration < np.inf and 0 < error < 1 and tolerance != 0):
        raise InputError(
            "interval_or_tolerance",
            "duration and interval must be positive, the interval no longer than the duration, "
            "the tolerance between 0 and 1",
        )
    if sample is not None:
        runs = NonlinearRuns(
            sample, duration, interval, source, motion, direction, particles, receivers
        )
        return runs.compute_wave(error, time_step)
    system = LinearSystem.of(
        hold_own_bodies(network, source), pre_stress=pre_stress, sliding=sliding, damping=damping
    )
    readings = Receivers(network, direction, particles=particles, discs=receivers)
    integration = Integration(duration, interval, error, time_step)
    (wave,) = _linear_waves(system, source, [motion], readings, integration, whole=whole)
    return wave


@checked
def propagate_motions(
    network: Network,
    duration: float,
    motions: Sequence[Motion],
    *,
    interval: float,
    source: Source | None = None,
    receivers: Sequence[Disc] = (),
    direction: Direction | None = None,
    tolerance: float = LINEAR_TOLERANCE,
) -> list[LinearWave]:
    """Propagate the linear waves of several motions of one source, at the cost of about one wave.

    The system is linear and its contacts are elastic, so that all waves use the same products with
    K. Each is the wave that `propagate` gives for its motion.

    Parameters
    ----------
    network : Network
        The packing.
    duration, interval : float
        Length of the records, and time between two of them, s.
    motions : sequence of Motion
        Motions of the source, one for each wave.
    source, receivers, direction, tolerance
        As in `propagate`.

    Returns
    -------
    list of LinearWave
        One for each motion.

    Raises
    ------
    InputError
        As `propagate`.

    Examples
    --------
    >>> import modal
    >>> from modal.motions import SineBurst
    >>> bursts = [SineBurst(1e-9, frequency) for frequency in (2e4, 4e4)]
    >>> waves = propagate_motions(modal.fcc(cells=(1, 1, 20)), 5e-5, bursts, interval=1e-6)
    >>> [wave.signals.input_frequency for wave in waves]
    [20000.0, 40000.0]
    """
    source = source or default_source(network)
    direction = direction_of(source, direction)
    if not (0 < interval <= duration < np.inf and 0 < tolerance < 1 and len(motions)):
        raise InputError(
            "interval_or_tolerance",
            "duration and interval must be positive, the interval no longer than the duration, "
            "the tolerance between 0 and 1, and there must be a motion",
        )
    system = LinearSystem.of(hold_own_bodies(network, source))
    readings = Receivers(network, direction, discs=receivers)
    integration = Integration(duration, interval, tolerance)
    return _linear_waves(system, source, motions, readings, integration)


def _linear_waves(
    system: LinearSystem,
    source: Source,
    motions: Sequence[Motion],
    readings: Receivers,
    integration: Integration,
    *,
    whole: bool = False,
) -> list[LinearWave]:
    """Compute the waves of some motions of a source; `whole` is that of `propagate`."""
    started = clock.perf_counter()
    duration = integration.duration
    tolerance = integration.tolerance
    forced = ForcedSystem.of(system, source, readings, duration, tolerance, whole=whole)
    if forced.dashpots and integration.time_step is None:
        records = []
        for motion in motions:
            records.append(by_series(forced, motion, integration))
    else:
        records = by_polynomials(forced, motions, integration)
    waves = []
    part = forced.part
    for motion, record in zip(motions, records, strict=True):
        signals = readings.signals(
            record.time,
            record.record,
            motion,
            source,
            forced.stresses,
            producer="linear",
            time_step=integration.time_step or integration.interval,
            run_time=clock.perf_counter() - started,
        )
        error = record.error + part.difference
        waves.append(LinearWave(signals, record.products, error, part.count))
    return waves


def _refuse_options(kind: str, **is_set: bool) -> None:
    """Raise InputError for the first set option that belongs to the other kind of wave, `kind`."""
    for name, foreign in is_set.items():
        if foreign:
            raise InputError(
                "option_of_other_wave",
                f"{name} is of the {kind} wave",
                remedy="leave it out, or take that",
            )
