"""Moduli in units of the contacts' stiffness, beside coordination number and indeterminacy.

Hertz's law makes all contacts stiffer under pressure; what is left of a modulus after division by
their mean stiffness k over the diameter D is the network's. I. Agnolin and J.-N. Roux (Phys. Rev. E
76, 061304, 2007) find that the shear modulus so normalised tends, in poorly coordinated packings,
to vary in proportion to the degree of force indeterminacy per unit volume: forces, three a contact,
less equations of balance, six a sphere that bears force; h = n (3 Z / 2 - 6), n spheres a volume.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from analysis.table import Table
from modal.elasticity.moduli import elastic_moduli
from modal.elasticity.waves import isotropic_mean
from modal.exchange.registry import read_packing
from modal.packing.rattlers import force_bearing
from modal.packing.state import coordination_without_rattlers, void_ratio

HEADER = (
    "packing",
    "mu_comp",
    "stress, kPa",
    "solid fraction",
    "Z of force-bearing",
    "mean k, kN/m",
    "K D / k",
    "G D / k",
    "K over affine",
    "G over affine",
    "indeterminacy h D^3",
    "(G D / k) / (h D^3)",
)


def row(path: str | Path) -> list[str]:
    """One packing as text, in the order of `HEADER`."""
    network = read_packing(path)
    moduli = elastic_moduli(network)
    bearing = force_bearing(network)
    diameter = 2 * float(network.radius[bearing].mean())
    inner = ~network.with_wall & bearing[network.particle_i] & bearing[network.partner]
    k = float(network.stiffness_normal[inner].mean())
    z = coordination_without_rattlers(network)[0]
    spheres = moduli.density / float(network.mass[bearing].mean())
    loose = spheres * (1.5 * z - 6) * diameter**3
    K, G = np.array(isotropic_mean(moduli.stiffness)) * diameter / k
    voigt = np.array(isotropic_mean(moduli.affine)) * diameter / k
    study = network.study
    numbers = (
        1 / (1 + void_ratio(network)),
        z,
        k / 1e3,
        K,
        G,
        K / voigt[0],
        G / voigt[1],
        loose,
        G / loose,
    )
    return [
        Path(path).name.split(".")[0],
        f"{float(study.get('mu_comp', np.nan)):g}",
        f"{float(study.get('stress', np.nan)) / 1e3:g}",
        *(f"{value:.4g}" for value in numbers),
    ]


def table(paths: list[str]) -> Table:
    """One row a packing."""
    return Table("Moduli and coordination number", HEADER, [row(path) for path in paths])
