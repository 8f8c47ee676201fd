"""V_P and V_S of packings by three ways, beside their moduli: one row a packing.

Moduli: the springs' static response (`modal.elasticity`), along z. Modes: the lines of standing
waves among all modes (`analysis.estimators.structure_factor`), with the wave number pi r / L of Eq.
4, extrapolated to long waves; L is as much longer than it is as the walls give way in the static
response. Waves: the linear wave of a wall that pushes or slides, its coherent part extrapolated to
zero frequency.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from analysis.estimators.coherent import coherent_wave, longest_waves
from analysis.estimators.structure_factor import structure_factor
from analysis.table import Table
from modal.elasticity.moduli import SOFT, elastic_moduli
from modal.exchange.registry import read_packing
from modal.packing.network import Network
from modal.packing.state import coordination_without_rattlers
from modal.tools.errors import InputError
from modal.waves.propagate import propagate

HEADER = (
    "packing",
    "mu_comp",
    "stress, kPa",
    "Z of force-bearing",
    "K, MPa",
    "G, MPa",
    "G / K",
    "Poisson's ratio",
    "anisotropy",
    "asymmetry",
    "V_P moduli, m/s",
    "V_P modes",
    "V_P wave",
    "V_S moduli, m/s",
    "V_S modes",
    "V_S wave",
    "V_P / V_S moduli",
)
ORDERS = np.arange(4, 9)
"""Standing waves whose lines are looked for: long, and yet apart by more than the resolution."""
LONGEST = 8.0
"""Wavelength, mean diameters, from which on a wave counts as long."""
PASSAGES = 1.3
"""Length of a record; what is after the reflection is cut."""


def row(path: str | Path) -> list[str]:
    """One packing as text, in the order of `HEADER`."""
    network = read_packing(path)
    moduli = elastic_moduli(network)
    v = moduli.velocities((0, 0, 1))
    static = {"z": float(v[0]), "x": float(v[1:].mean())}
    if not min(static.values()) ** 2 > SOFT * moduli.affine.max() / moduli.density:
        raise InputError(
            f"{path}: P- and S-waves of {static['z']:g} and {static['x']:g} m/s by its moduli; a "
            "packing without stiffness carries no wave, leave it out"
        )
    found = {"z": [static["z"]], "x": [static["x"]]}
    # By how much a push or a slide of the walls strains the whole more than the bulk.
    giving = {"z": (2, 2), "x": (4, 4)}
    for direction, speed in static.items():
        at = giving[direction]
        length = network.length * float(moduli.stiffness[at] / moduli.whole[at])
        found[direction] += [
            standing_velocity(network, direction, speed, length),
            travelling_velocity(network, direction, speed),
        ]
    study = network.study
    numbers = [
        coordination_without_rattlers(network)[0],
        moduli.bulk_modulus / 1e6,
        moduli.shear_modulus / 1e6,
        moduli.shear_modulus / moduli.bulk_modulus,
        moduli.poisson,
        moduli.anisotropy,
        moduli.asymmetry,
    ]
    return [
        Path(path).name.split(".")[0],
        f"{float(study.get('mu_comp', np.nan)):g}",
        f"{float(study.get('stress', np.nan)) / 1e3:g}",
        *(f"{value:.4g}" for value in numbers),
        *(f"{value:.1f}" for value in (*found["z"], *found["x"])),
        f"{static['z'] / static['x']:.3f}",
    ]


def standing_velocity(network: Network, direction: str, expected: float, length: float) -> float:
    """Velocity, m/s, of long standing waves between the walls, from their lines; about `expected`.

    2 L f_r / r over r^2, a straight line through the orders, at zero; L, m, is the `length` in
    which a wave fits. NaN where a line is not found within the band, as in short or soft packings.
    """
    spacing = expected / (2 * network.length)
    highest = 1.5 * spacing * float(ORDERS[-1])
    lines = structure_factor(network, ORDERS, spacing / 1.2, highest, direction)
    peak, _ = lines.ridge()
    speed = 2 * length * peak / ORDERS
    if not np.isfinite(speed).all():  # least squares need not take NaN
        return np.nan
    return float(np.polyfit(ORDERS**2, speed, 1)[1])


def travelling_velocity(network: Network, direction: str, expected: float) -> float:
    """Velocity, m/s, of long waves that a wall sends; about `expected`."""
    signals = propagate(network, PASSAGES * network.length / expected, direction=direction).signals
    highest = expected / (LONGEST * 2 * float(network.radius.mean()))
    wave = coherent_wave(signals, network.length, highest=highest)
    return longest_waves(wave)[0]


def table(paths: list[str]) -> Table:
    """One row a packing."""
    return Table("Elastic moduli and wave velocities", HEADER, [row(path) for path in paths])
