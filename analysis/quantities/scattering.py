"""How waves fade: attenuation and quality factor over frequency, and where waves end."""

from dataclasses import replace
from functools import partial

import numpy as np

from analysis.caveats import Caveat
from analysis.estimators.coherent import STRETCH
from analysis.estimators.low_pass import spectra
from analysis.estimators.structure_factor import Scattering, structure_factor
from analysis.packing_data import PackingData, cached_on_packing
from analysis.prepare import kept_file
from analysis.quantities.passband import low_pass_2, scale
from analysis.quantities.registry import on_request, quantity
from analysis.quantities.velocity import LOST, coherents, longest, of_frequency, v_p
from analysis.value import Value, estimate, hertz, unknown
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError

MOST = 8.0
"""Nepers over the part of the length that is read: beyond them what is left of the wave is less
than what the window leaves of the record's cut."""
SHORTEST = 4.0
"""Wavelength, mean diameters, of the shortest plane waves whose lines are read."""
FAINT = 0.02
"""Of the source's largest amplitude: less is not sent."""
COARSE = 2.0
"""Width of the lines in which the Ioffe-Regel limit is sought, in those of the whole ridge: waves
are a third as wide there as their frequency, hence a tenth of the highest one."""


@cached_on_packing
def attenuation_of(m: PackingData) -> tuple[Value, np.ndarray]:
    """Decay of the coherent amplitude, 1/m, at independent frequencies, and their group velocity.

    A window of another damping cuts the record elsewhere and passes on other noise: what it changes
    is the error, at a frequency or at its neighbours. A bias that grows as the square of the
    damping is as large.
    """
    wave, *others = coherents(m)
    every = max(1, round(wave.resolution / (wave.frequency[1] - wave.frequency[0])))
    some = np.arange(every - 1, len(wave.frequency), every)
    told = np.isfinite([one.attenuation[some] for one in coherents(m)]).all(axis=0)
    span = (STRETCH[1] - STRETCH[0]) * m.network.length
    sent_to = _sent_to(m, wave.frequency[-1])
    some = some[told & (wave.attenuation[some] * span < MOST) & (wave.frequency[some] <= sent_to)]
    if not len(some):
        raise UnavailableError("no coherent wave is left to be read", code="no_coherent_wave")
    error = abs(others[0].attenuation - others[1].attenuation)[some]
    error = np.maximum.reduce([error, np.roll(error, 1), np.roll(error, -1)])
    f = wave.frequency[some]
    caveats = of_frequency(m, f[0])
    if sent_to < wave.frequency[-1]:
        caveats += (Caveat("faint_source", {"frequency": hertz(sent_to), "share": FAINT}),)
    value = Value(wave.attenuation[some], "1/m", {"resolution": error}, caveats, f)
    return value, wave.group_velocity[some]


def _sent_to(m: PackingData, highest: float) -> float:
    """The frequency, Hz, up to which the source sends something, or `highest`."""
    record = m.wave
    frequency, sent = spectra(record.time, record.source_displacement[:, None], 1.01 * highest)
    lost = np.flatnonzero(sent[:, 0] < FAINT * sent.max())
    lost = lost[frequency[lost] > frequency[np.argmax(sent)]]
    return float(frequency[lost[0]]) if len(lost) else highest


@quantity("1/m", definition="decay of the coherent wave's amplitude along z, over frequency")
def attenuation(m: PackingData) -> Value:
    """Decay of the coherent wave's amplitude along z, over frequency.

    Of means over layers, from a pulse of the wall.
    """
    return attenuation_of(m)[0]


@quantity("1", definition="quality factor omega / (2 alpha v) of the coherent wave, over frequency")
def quality(m: PackingData) -> Value:
    """Quality factor omega / (2 alpha v) of the coherent wave, over frequency.

    alpha the attenuation, v the group velocity; unknown where alpha is not told from zero.

    The frequency over the width of the line that the decay makes, with the error of that.
    """
    alpha, line = attenuation_of(m)[0], scattering_of_pulse(m)
    told = alpha.value > 2 * alpha.error
    if not told.any():
        return unknown("1", Caveat("no_attenuation"), *alpha.caveats)
    width = np.where(told, line.value, np.nan)
    value = alpha.at / width
    parts = {name: value * part / width for name, part in line.parts.items()}
    return Value(value, "1", parts, alpha.caveats, alpha.at)


@quantity("Hz", definition="frequency at which the mean free path falls to half a wavelength")
def ioffe_regel(m: PackingData) -> Value:
    """Frequency at which the mean free path falls to half a wavelength.

    Between two standing waves; half of their distance is the error.
    """
    if m.crystal:
        return unknown("Hz", Caveat("crystal"))
    found = scattering(m)
    if not np.isfinite(found.limit):
        return unknown("Hz", Caveat("no_short_free_path"))
    near = np.sort(abs(found.frequency - found.limit))[:2].sum()
    wide = found.velocity / found.limit > m.width * m.diameter
    caveats = of_frequency(m, found.limit) if wide else m.of_one_sample
    return Value(found.limit, "Hz", {"resolution": near / 2}, caveats)


@on_request("Hz", definition="width of the line that a pulse's decay makes, alpha v / pi")
def scattering_of_pulse(m: PackingData) -> Value:
    """Width of the line that a pulse's decay makes, alpha v / pi.

    Over frequency; v is the measured group velocity, at which the energy moves on.

    What fades as exp(-alpha x) in space fades as exp(-alpha v t) in time: a line so wide. Under the
    window exp(-eta t) the wave number is less by eta d alpha / d omega, by whose derivative the
    slowness is off: that is in the error, and not taken off, as two derivatives are noise.
    """
    alpha, velocity = attenuation_of(m)
    wave = coherents(m)[0]
    omega = 2 * np.pi * wave.frequency
    bend = np.gradient(np.gradient(wave.attenuation, omega), omega)
    off = velocity * wave.resolution * np.interp(alpha.at, wave.frequency, bend)
    value = velocity / np.pi * alpha.value
    parts = {"fit": value * off, "resolution": velocity / np.pi * alpha.error}
    return Value(value, "Hz", parts, alpha.caveats, alpha.at)


def _width_of_lines(packing: PackingData, polarisation: str) -> Value:
    """Full width of the line of plane waves along the three axes of a periodic cell, Hz.

    The waves of one number of periods along x, y and z are one line. The error is how its widths
    along the axes scatter, and how far its places along them are apart, which widens it.
    """
    network = packing.network
    if not network.cell_periodic.all():
        return unknown("Hz", Caveat("walls"))
    most = int(network.cell_size.min() / (SHORTEST * packing.diameter))
    if most < 1:
        return unknown("Hz", Caveat("narrow_for_waves"))
    orders = np.concatenate([n * np.eye(3, dtype=int) for n in range(1, most + 1)])
    highest = 1.5 * v_p(packing).value / (SHORTEST * packing.diameter)
    found = structure_factor(network, orders, packing.line, highest, polarisation)
    places, widths = (each.reshape(most, 3) for each in found.ridge())
    power = found.power.reshape(most, 3, -1).mean(axis=1)
    peak, width = replace(found, order=orders[::3], power=power).ridge()
    told = np.isfinite(peak) & np.isfinite(width)
    if not told.any():
        return unknown("Hz", Caveat("no_line"))
    scatter, apart = np.nanstd(widths, axis=1) / np.sqrt(3), np.nanstd(places, axis=1)
    error = np.hypot(np.hypot(scatter, apart), packing.line / 10)[told]
    return Value(width[told], "Hz", {"fit": error}, packing.of_one_sample, peak[told])


# 2 pi times it is the rate at which disorder takes the energy of a plane wave.
for _wave, _polarisation in (("p", "L"), ("s", "T")):
    _text = f"full width of the line of plane {_wave.upper()}-waves, over its frequency"
    on_request("Hz", name=f"scattering_of_{_wave}", definition=_text)(
        partial(_width_of_lines, polarisation=_polarisation)
    )


@cached_on_packing
def scattering(m: PackingData) -> Scattering:
    """Width of the ridge of standing waves over frequency, as far as their limit needs it.

    Of some waves first, then of those on both sides of where the width reaches the frequency.
    """
    velocity, kept = v_p(m).value, kept_file(m, "structure")
    if not velocity > 0:
        raise UnavailableError(LOST, code="no_coherent_wave")
    if kept is not None:
        return kept.scattering(velocity, m.diameter)
    line, highest = COARSE * m.line, 0.75 * velocity / m.diameter
    # Waves in a length: halves of standing waves between walls, whole ones in a cell without.
    fit = 2 if m.walls else 1

    def ridge(orders: Floats) -> Scattering:
        whole = np.unique(orders.round()).astype(int)
        along = whole if m.walls else whole[:, None] * np.array([0, 0, 1])
        return structure_factor(m.network, along, line, highest).scattering(velocity, m.diameter)

    most = max(1.0, 0.5 * fit * m.network.length / m.diameter)
    first = ridge(np.geomspace(max(1.0, most / 20), most, 8))
    if not np.isfinite(first.limit):
        return first
    near = fit * m.network.length * first.limit / velocity
    return ridge(np.linspace(0.7 * near, 1.2 * near, 8))


@cached_on_packing
def whole_ridge(m: PackingData) -> Scattering:
    """The same of all waves of a file's structure factor."""
    return m.case.needed("structure").scattering(longest(m, "linear").value, m.diameter)


def free_path(m: PackingData) -> float:
    """Mean free path of the coherent wave at f_low-pass, 2 %, in diameters."""
    return whole_ridge(m).free_path(low_pass_2(m))


def width_power(m: PackingData) -> Value:
    """Power of the frequency that the ridge's width follows about f_low-pass of the linear wave."""
    law = whole_ridge(m).power(scale(m))
    return estimate(law.exponent, law.error)
