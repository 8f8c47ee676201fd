"""Velocities of the longest waves along z, P and S, and what other ways of reading them give.

The one to quote is that of the coherent wave extrapolated to zero frequency: it does not depend on
a threshold, a chain or the pulse. `v_p_static` comes from no wave at all and should agree.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.estimators.coherent import coherent_wave, longest_waves
from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.layer_lattice import LayerLattice
from analysis.estimators.travel_time import arrival_velocity, first_peak_velocity
from analysis.measuring import Measuring
from analysis.quantities.registry import quantity, without_signal
from analysis.value import Value, unknown
from modal.elasticity.static_velocity import static_velocity
from modal.waves.signals import Signals

ORDERS = {"z": (2, 3), "x": (5, 6), "y": (5, 6)}
"""Orders of a crystal's neighbour ratio, of the value and of what its error is told by. Layers turn
as they slide, so that S-waves need a higher one."""
LONGEST = 8.0
"""Wavelength, mean diameters, from which on an S-wave of a random packing counts as long."""


def _exact(lattice: LayerLattice) -> float:
    return lattice.velocity


def _longest(packing: Measuring, record: Signals) -> Value:
    """Velocity, m/s, of the longest waves of a record, with the standard error of its fit."""
    if packing.crystal:
        value, other = (
            chain_dispersion(record, order=order).velocity for order in ORDERS[record.direction]
        )
        return Value(value, "m/s", {"fit": abs(value - other)})
    if record.direction == "z":
        wave = packing.coherent
    else:
        wall = float(packing.network.wall_position[0])
        first, _ = first_peak_velocity(record, wall, packing.network.length)
        highest = first / (LONGEST * packing.diameter) if first > 0 else None
        wave = coherent_wave(record, packing.network.length, highest=highest)
    value, error = longest_waves(wave)
    if not np.isfinite(value):
        return unknown("m/s", "no coherent wave goes through enough of the packing to be read")
    return Value(value, "m/s", {"fit": error})


def _by_moduli(packing: Measuring, places: slice) -> Value:
    """Of a cell without walls, that no wall can push."""
    moduli = packing.moduli
    value = float(moduli.velocities((0, 0, 1))[places].mean())
    why = "by the elastic moduli: there are no walls"
    return Value(value, "m/s", {"fit": 0.5 * value * moduli.error}, (why, *packing.of_waves))


@quantity("v_p", "m/s", "velocity of the longest P-waves along z; the one to quote", exact=_exact)
def v_p(packing: Measuring) -> Value:
    """Of the coherent wave from the wall; of a cell without walls by its moduli."""
    if not packing.walls:
        return _by_moduli(packing, slice(0, 1))
    return _longest(packing, packing.wave).with_caveats(*packing.of_waves)


@quantity(
    "v_s",
    "m/s",
    "velocity of the longest S-waves along z; the one to quote",
    exact="the exact lattice is that of P-waves; S-waves of the crystal against Bloch's in tests",
)
def v_s(packing: Measuring) -> Value:
    """The same of a wall that slides along x."""
    if not packing.walls:
        return _by_moduli(packing, slice(1, 3))
    return _longest(packing, packing.shear_wave).with_caveats(*packing.of_waves)


@without_signal("v_p_static", "m/s", "velocity of P-waves by the springs' answer to a steady push")
def v_p_static(packing: Measuring) -> Value:
    """Independent of every rule that reads waves."""
    packing.require_walls()
    return Value(static_velocity(packing.network)[0], "m/s", {}, packing.of_one_sample)


@quantity(
    "v_p_first_peaks",
    "m/s",
    "velocity of first peaks along the chain, as of the paper",
    exact=_exact,
    bias=0.013,
)
def v_p_first_peaks(packing: Measuring) -> Value:
    """Depends on pulse and chain: of disorder the first peak broadens on its way."""
    chain = packing.first_peaks_of_columns[1]
    value = _travelled(packing, *first_peak_velocity(*_chain(packing)), "first peaks")
    return replace(value, parts=dict(value.parts) | {"chain": np.nan_to_num(chain)})


@quantity(
    "v_p_first_peaks_columns",
    "m/s",
    "the same, mean over all columns of spheres",
    exact="exact signals are those of one chain",
    asked=True,
)
def v_p_first_peaks_columns(packing: Measuring) -> Value:
    """Each column is a chain of its own; its error is how they scatter."""
    value, scatter = packing.first_peaks_of_columns
    if not np.isfinite(value):
        return unknown("m/s", "single spheres are not recorded, or no column is long enough")
    return Value(value, "m/s", {"chain": scatter}, packing.of_waves)


@quantity(
    "v_p_arrival",
    "m/s",
    "velocity at which 5 % of each particle's largest motion goes along the chain",
    exact=_exact,
    bias=0.02,
    asked=True,
)
def v_p_arrival(packing: Measuring) -> Value:
    """Too fast where the wave broadens on its way."""
    return _travelled(packing, *arrival_velocity(*_chain(packing)), "arrivals")


def _chain(packing: Measuring) -> tuple[Signals, float, float]:
    network = packing.network
    return packing.short_wave, float(network.wall_position[0]), network.length


def _travelled(packing: Measuring, value: float, error: float, what: str) -> Value:
    if not np.isfinite(value):
        return unknown("m/s", f"{what} do not move on along the chain")
    return Value(value, "m/s", {"fit": error}, packing.of_waves)
