"""The estimators on trial: signals of known answer in, bias and scatter of every rule out.

The signals are exact: the planar wave of the FCC crystal at 100 kPa (`layer_lattice`), where V_P
and the band edge are those of Eqs. 6 and 10 and the group velocity is V_P cos(kappa l / 2); the
same with white noise; and, for rules that read times of arrival, two pulses of different speeds in
a medium without dispersion. Noise is 5 % of the largest displacement, at every sample of every
layer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from analysis.estimators.coherent import coherent_wave, longest_waves
from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.layer_lattice import LayerLattice, lattice_signals
from analysis.estimators.low_pass import (
    REACH,
    STRETCH,
    THRESHOLDS,
    at_stretch,
    spectra,
    threshold_curves,
)
from analysis.estimators.transfer import at_frequency, wall_velocity
from analysis.estimators.travel_time import MIDDLE, arrival_velocity, first_peak_velocity
from analysis.table import Table
from modal.solvers.lanczos import SEED
from modal.theory.fcc import FccLattice
from modal.waves.signals import Signals, source_pulse

INTERVAL, NOISE, DRAWS = 4e-7, 0.05, 10
LATTICE = LayerLattice.of_crystal(FccLattice(1e5))
LENGTH = (LATTICE.layers - 1) * LATTICE.distance + 2 * LATTICE.wall_gap
PASSAGE = LENGTH / LATTICE.velocity
DIAMETER = np.sqrt(2) * LATTICE.distance
HIGHEST = REACH[True] * LATTICE.velocity / DIAMETER
"""Spectra end here, Hz."""


@dataclass(frozen=True)
class Condition:
    """Length of the record in passages from wall to wall, input frequency (Hz), noise."""

    passages: float = 1.0
    frequency: float = 1e5
    noise: float = 0.0

    @property
    def head(self) -> str:
        """Heading of a column."""
        text = f"{self.passages:g} passages, {self.frequency / 1e3:g} kHz"
        return f"{text}, {100 * self.noise:g} % noise" if self.noise else text

    def records(self) -> list[Signals]:
        """The exact record, or so many draws of it with noise."""
        time = np.arange(0, self.passages * PASSAGE, INTERVAL)
        clean = lattice_signals(LATTICE, time, frequency=self.frequency)
        if not self.noise:
            return [clean]
        rng = np.random.default_rng(SEED)
        return [_noisy(clean, self.noise, rng) for _ in range(DRAWS)]


CONDITIONS = (
    Condition(0.8),
    Condition(),
    Condition(1.3),
    Condition(2.0),
    Condition(frequency=5e4),
    Condition(frequency=2e5),
    Condition(noise=NOISE),
    Condition(1.3, noise=NOISE),
)


def _noisy(record: Signals, share: float, rng: np.random.Generator) -> Signals:
    u = record.chain_displacement
    noisy = u + share * abs(u).max() * rng.standard_normal(u.shape)
    walls = {
        name: getattr(record, name)
        + share * abs(getattr(record, name)).max() * rng.standard_normal(len(record.time))
        for name in ("source_stress", "receiver_stress")
    }
    return replace(record, chain_displacement=noisy, **walls)


def _peaks(part: tuple[float, float]) -> Callable[[Signals], float]:
    return lambda r: first_peak_velocity(r, 0.0, LENGTH, part)[0]


def _arrival(level: float) -> Callable[[Signals], float]:
    return lambda r: arrival_velocity(r, 0.0, LENGTH, level)[0]


def _walls(record: Signals) -> float:
    """Phase velocity between the walls at the wavelength L / 5, over Eq. 9's, as V_P."""
    found = wall_velocity(record, LENGTH)
    if found is None:
        return np.nan
    kappa = 10 * np.pi / LENGTH
    frequency = LATTICE.low_pass_frequency * np.sin(kappa * LATTICE.distance / 2)
    exact = 2 * np.pi * frequency / kappa
    return at_frequency(found[0], found[1], frequency) / exact * LATTICE.velocity


VELOCITIES: dict[str, Callable[[Signals], float]] = {
    "first peaks, 5-30 % of the length": _peaks((0.05, 0.3)),
    "first peaks, middle half": _peaks(MIDDLE),
    "first peaks, 50-95 % of the length": _peaks((0.5, 0.95)),
    "1 % of the maximum, middle half": _arrival(0.01),
    "5 % of the maximum, middle half": _arrival(0.05),
    "phase between the walls, lambda = L/5": _walls,
    "coherent wave, to long waves": lambda r: longest_waves(coherent_wave(r, LENGTH))[0],
    "damped transform": lambda r: chain_dispersion(r).velocity,
}


def _threshold(threshold: float, layer: int | None) -> Callable[[Signals], float]:
    """Relative to the maximum of the whole map, at one layer; with None on the stated stretch."""

    def measure(record: Signals) -> float:
        z, u = record.chain_position, record.chain_displacement
        curve = threshold_curves(*spectra(record.time, u, HIGHEST))[THRESHOLDS.index(threshold)]
        if layer is not None:
            return float(curve[layer])
        return at_stretch(z, curve, LENGTH, STRETCH[True]).value

    return measure


EDGES: dict[str, Callable[[Signals], float]] = {
    f"{100 * threshold:g} %, {'5-15 % of the length' if layer is None else f'layer {layer}'}": (
        _threshold(threshold, layer)
    )
    for threshold in (0.01, 0.02, 0.05)
    for layer in (20, 50, 100, 150, None)
} | {"damped transform": lambda r: chain_dispersion(r).low_pass_frequency}


def _coherent_group(record: Signals, reach: float) -> tuple[float, float]:
    """RMS and largest relative error of the group velocity up to `reach` of the band edge."""
    found = coherent_wave(record, LENGTH)
    f = found.frequency
    inside = (f > 0.05 * LATTICE.low_pass_frequency) & (f < reach * LATTICE.low_pass_frequency)
    exact = LATTICE.velocity * np.sqrt(1 - (f[inside] / LATTICE.low_pass_frequency) ** 2)
    return _errors(found.group_velocity[inside] / exact - 1)


def _damped_group(record: Signals, reach: float) -> tuple[float, float]:
    found = chain_dispersion(record)
    kappa = np.linspace(0.02, 2 / np.pi * np.arcsin(reach), 400) * np.pi / LATTICE.distance
    group = np.gradient(found.omega(kappa), kappa)[1:-1]
    exact = LATTICE.velocity * np.cos(kappa * LATTICE.distance / 2)[1:-1]
    return _errors(group / exact - 1)


def _errors(off: np.ndarray) -> tuple[float, float]:
    return float(np.sqrt(np.mean(off**2))), float(abs(off).max())


def two_arrivals(share: float, noise: float, draws: int) -> list[Signals]:
    """Pulses of speeds V_P and 0.6 V_P, the slower `share` as high, without dispersion."""
    record = lattice_signals(LATTICE, np.arange(0, PASSAGE, INTERVAL))
    delay = record.chain_position / LATTICE.velocity
    u = source_pulse(record.time[:, None] - delay, 2.5e-9, 1e5)
    u = u + share * source_pulse(record.time[:, None] - delay / 0.6, 2.5e-9, 1e5)
    record = replace(record, chain_displacement=u)
    rng = np.random.default_rng(SEED)
    return [_noisy(record, noise, rng) for _ in range(draws)]


def _cell(values: list[float], exact: float) -> str:
    """Bias in per cent, and the scatter of a single record where there are several."""
    off = 100 * (np.array(values) / exact - 1)
    if not np.isfinite(off).any():
        return "none"
    if np.nanmax(abs(off)) > 100:
        return "fails"
    mean = np.nanmean(off)
    text = f"{mean:+.2f}" if abs(mean) >= 5e-3 else f"{mean:+.0e}"
    if len(off) > 1:
        text += f" ± {np.nanstd(off, ddof=1):.2f}"
        if not np.isfinite(off).all():
            text += f", {np.isfinite(off).sum()} of {len(off)}"
    return text


def _bias(title: str, rules: dict[str, Callable[[Signals], float]], exact: float) -> Table:
    columns = []
    for condition in CONDITIONS:
        records = condition.records()
        columns.append([_cell([rule(r) for r in records], exact) for rule in rules.values()])
    rows = [[name, *cells] for name, *cells in zip(rules, *columns, strict=True)]
    return Table(title, ["rule", *(c.head for c in CONDITIONS)], rows)


def _groups() -> Table:
    rows = []
    for condition in (*CONDITIONS[:3], *CONDITIONS[5:]):
        row = [condition.head]
        for measure in (_coherent_group, _damped_group):
            for reach in (0.5, 0.8, 0.95):
                found = np.array([measure(r, reach) for r in condition.records()])
                rms, top = 100 * np.mean(found, axis=0)
                row.append(f"{rms:.2g} ({top:.2g})" if np.isfinite(rms) else "none")
        rows.append(row)
    header = ["record"] + [
        f"{name}, to {reach:g} of the edge"
        for name in ("coherent wave", "damped transform")
        for reach in (0.5, 0.8, 0.95)
    ]
    title = "Group velocity: error in %, root mean square (largest) over the band"
    return Table(title, header, rows)


def _arrivals() -> Table:
    rows = []
    for share in (0.25, 0.5, 1.0, 2.0, 4.0):
        row = [f"{share:g}"]
        for noise, draws in ((0.0, 1), (NOISE, DRAWS)):
            records = two_arrivals(share, noise, draws)
            for rule in ("first peaks, middle half", "5 % of the maximum, middle half"):
                row.append(_cell([VELOCITIES[rule](r) for r in records], LATTICE.velocity))
        rows.append(row)
    header = ["height of the slower pulse", "first peaks", "5 % of the maximum"]
    header += [f"{name}, {100 * NOISE:g} % noise" for name in header[1:]]
    return Table("Two arrivals, V_P and 0.6 V_P: error of V_P in %, middle half", header, rows)


def trial() -> list[Table]:
    """All tables."""
    noise = f"± scatter of a record, {DRAWS} draws"
    return [
        _bias(f"V_P: bias in % ({noise})", VELOCITIES, LATTICE.velocity),
        _bias(f"f_low-pass: bias in % ({noise})", EDGES, LATTICE.low_pass_frequency),
        _groups(),
        _arrivals(),
    ]
