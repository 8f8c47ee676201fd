"""The comparison of a crystal: each quantity by theory, eigenmodes, linear wave and YADE.

Theory, modes and the linear wave are those of the springs, without the pre-stress of the contacts;
what that changes of V_P has a row of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from analysis.case import Case
from analysis.estimators import damped_transform as disp
from analysis.estimators.layer_lattice import LayerLattice, exact_twin, lattice_signals
from analysis.estimators.low_pass import (
    REACH,
    STRETCH,
    at_stretch,
    spectra,
    threshold_curves,
    wavelength,
)
from analysis.estimators.resonances import mode_velocities
from analysis.estimators.ridge import ridge
from analysis.estimators.transfer import (
    TRAVELS,
    at_frequency,
    gain_factor,
    network_gain,
    wall_velocity,
)
from analysis.estimators.travel_time import arrival_velocity, first_peak_velocity
from modal.packing.state import void_ratio
from modal.waves.signals import Signals

COLUMNS = ("theory", "modal", "linear", "yade")


@dataclass
class Row:
    """One quantity; values by column name, None where there is none."""

    id: str
    quantity: str
    unit: str
    values: dict[str, float | None] = field(default_factory=dict)
    note: str = ""

    def cells(self) -> list[str]:
        """Its id, quantity, unit, the values in the order of `COLUMNS` and the note, as text."""
        numbers = [self.values.get(name) for name in COLUMNS]
        shown = [f"{v:.6g}" if v is not None and np.isfinite(v) else "" for v in numbers]
        return [self.id, self.quantity, self.unit, *shown, self.note]


def compare(case: Case) -> list[Row]:
    """All rows for one crystal; columns of absent products stay empty."""
    lattice, network = case.lattice, case.network
    rows: dict[str, Row] = {}

    def put(key: str, text: str, unit: str, note: str = "", **values: float | None) -> None:
        row = rows.setdefault(key, Row(key, text, unit))
        row.values.update(values)
        row.note = row.note or note

    omega, _ = lattice.eigenmodes()
    put("f_min_khz", "lowest natural frequency", "kHz")
    put("f_max_khz", "highest natural frequency", "kHz")
    put("f_1_khz", "first P resonance", "kHz", theory=omega[0] / 2e3 / np.pi)
    put("f_200_khz", "last P resonance", "kHz", theory=omega[-1] / 2e3 / np.pi)
    put("resonances", "number of P resonances", "1", theory=float(lattice.layers))
    f_theory = lattice.low_pass_frequency
    note = "theory Eq. 10; others: band edge, unbiased"
    put("band_edge_theory_khz", "f_low-pass", "kHz", note, theory=f_theory / 1e3)
    note = "theory Eq. 6; others: slope at long waves, unbiased"
    put("velocity", "V_P, long waves", "m/s", note, theory=lattice.velocity)
    lam = wavelength(lattice.velocity, f_theory) / case.diameter
    note = "theory Eq. 7; modal: last resonance; others: where the waves turn round"
    put("lambda_edge_yade_over_d", "lambda_low-pass / D, band edge", "1", note, theory=lam)
    text = "void ratio, wall to wall"
    put("void_ratio", text, "1", "of the contact network", modal=void_ratio(network))
    _modal_rows(case, put)
    _signal_rows(case, case.linear(), "linear", put)
    if case.signals is not None:
        _signal_rows(case, case.signals, "yade", put)
    full = disp.chain_dispersion(case.linear("full")).velocity
    note = "exact tangent of the contact law, not the springs alone"
    put("velocity_full", "V_P, long waves, with pre-stress", "m/s", note, linear=full)
    _gain_rows(case, put)
    return list(rows.values())


def _modal_rows(case: Case, put) -> None:
    modes, lattice = case.modes, case.lattice
    if modes is None:
        return
    full = len(modes.frequency) == 6 * case.network.n_particles
    note = "" if full else "of the modes in the file"
    put("f_min_khz", "", "", note, modal=modes.frequency[0] / 1e3)
    put("f_max_khz", "", "", note, modal=modes.frequency[-1] / 1e3)
    if modes.resonance_frequency is not None and len(modes.resonance_frequency) > 3:
        f, shape = modes.resonance_frequency, modes.resonance_shape
        put("f_1_khz", "", "", modal=f[0] / 1e3)
        put("f_200_khz", "", "", modal=f[-1] / 1e3)
        put("resonances", "", "", modal=float(len(f)))
        if shape is not None and shape.shape[1] > 3:
            measured = disp.mode_dispersion(f, shape, lattice.distance)
            edge, speed = measured.low_pass_frequency, measured.velocity
            put("band_edge_theory_khz", "", "", modal=edge / 1e3)
            put("velocity", "", "", modal=speed)
            kappa = float(np.arccos(disp.mode_cosine(shape)[-1])) / lattice.distance
            put("lambda_edge_yade_over_d", "", "", modal=2 * np.pi / kappa / case.diameter)
            rms = disp.rms_deviation(measured, lattice.velocity, lattice.low_pass_frequency)
            text = "dispersion, RMS deviation from Eq. 9"
            put("rms", text, "%", "up to kappa l = 0.9 pi", modal=100 * rms)
        if modes.resonance_wavenumber is not None:
            phase, group = mode_velocities(f, modes.resonance_wavenumber)
            inside = _inside(lattice)
            for name, values in (("phase", phase), ("group", group)):
                value = at_frequency(f, values, inside)
                note = "modal: lambda = 2 L / r (Eq. 4)"
                exact = _exact_velocity(lattice, name, inside)
                text = f"{name} velocity at {inside / 1e3:g} kHz"
                put(name, text, "m/s", note, modal=value, theory=exact)
    if case.translations is not None:
        ratio = case.translations.frequency[-1] / lattice.low_pass_frequency
        put("translations_only_over_edge", "f_max without rotations / f_low-pass", "1", modal=ratio)


def _inside(lattice: LayerLattice) -> float:
    """A frequency, Hz, of one digit, about a third of the way to the end of the band."""
    return float(f"{0.36 * lattice.low_pass_frequency:.0e}")


def _exact_velocity(lattice, name: str, frequency: float) -> float:
    half = np.arcsin(min(1.0, frequency / lattice.low_pass_frequency))
    return lattice.velocity * (np.sin(half) / half if name == "phase" else np.cos(half))


def _signal_rows(case: Case, signals: Signals, producer: str, put) -> None:
    lattice = case.lattice
    measured = disp.chain_dispersion(signals)
    edge, speed = measured.low_pass_frequency, measured.velocity
    put("band_edge_theory_khz", "", "", **{producer: edge / 1e3})
    put("velocity", "", "", **{producer: speed})
    put(
        "lambda_edge_yade_over_d",
        "",
        "",
        **{producer: ridge(signals).edge_wavelength / case.diameter},
    )
    rms = disp.rms_deviation(measured, lattice.velocity, lattice.low_pass_frequency)
    text = "dispersion, RMS deviation from Eq. 9"
    put("rms", text, "%", "up to kappa l = 0.9 pi", **{producer: 100 * rms})
    inside = _inside(lattice)
    omega = 2 * np.pi * inside
    for name, step in (("phase", None), ("group", 1e-3)):
        kappa = np.arccos(measured.cosine(omega)) / measured.distance
        if step is None:
            value = omega / kappa
        else:
            near = np.arccos(measured.cosine(omega * (1 + step))) / measured.distance
            value = omega * step / (near - kappa)
        exact = _exact_velocity(lattice, name, inside)
        text = f"{name} velocity at {inside / 1e3:g} kHz"
        put(name, text, "m/s", theory=exact, **{producer: value})
    twin = exact_twin(signals, lattice)
    biased = "paper's rule; theory: the rule on exact signals"
    length, wall = case.network.length, float(case.network.wall_position[0])
    for column, record, origin in (("theory", twin, 0.0), (producer, signals, wall)):
        peak, _ = first_peak_velocity(record, origin, length)
        put("first_peak", "V_P, first peaks, middle half", "m/s", biased, **{column: peak})
        arrival, _ = arrival_velocity(record, origin, length)
        put("arrival", "V_P, 5 % arrival, middle half", "m/s", biased, **{column: arrival})
        time, u = record.time, record.chain_displacement
        highest = REACH[True] * lattice.velocity / case.diameter
        distance = record.chain_position - origin
        curves = threshold_curves(*spectra(time, u, highest))
        for percent, values in zip((2, 1), curves, strict=False):
            key, text = f"f_low_pass_{percent}_khz", f"f_low-pass, {percent} % rule"
            found = at_stretch(distance, values, length, STRETCH[True]).value
            at = "at {:g}-{:g} % of the length".format(*(100 * part for part in STRETCH[True]))
            put(key, f"{text}, {at}", "kHz", biased, **{column: found / 1e3})
            for layer in (100, 150):
                if layer < len(values):
                    at, here = f"{text}, layer {layer}", {column: values[layer] / 1e3}
                    put(f"{key}_{layer}", at, "kHz", biased, **here)
        walls = wall_velocity(record, length)
        if walls is not None:
            speed = at_frequency(walls[0], walls[1], inside)
            text = f"phase velocity at {inside / 1e3:g} kHz, walls"
            put("walls", text, "m/s", **{column: speed})


def _gain_rows(case: Case, put) -> None:
    passage = case.network.length / case.lattice.velocity
    duration = TRAVELS * passage
    time = np.arange(0, duration * (1 + 1e-3), 1e-6)  # ten samples of the pulse of 100 kHz
    records = {"theory": lattice_signals(case.lattice, time), "yade": case.signals}
    gains = {name: gain_factor(r, duration) if r else None for name, r in records.items()}
    for column, found in ({"linear": network_gain(case.network, passage)} | gains).items():
        if found is not None:
            same = found.undamped(passage)
            note = f"resolution {found.resolution:.0f} Hz: an undamped column has {same:.3g}"
            frequency, height = found.first_maximum()
            put("gain_f", "gain factor, first maximum", "kHz", note, **{column: frequency / 1e3})
            put("gain", "gain factor at its first maximum", "1", note, **{column: height})
