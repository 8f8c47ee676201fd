"""Costly spectra of a packing, kept in files: gain, density of states, structure factor.

Each is made from the contact network alone; `measure --keep` makes it, and what has it, reads it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.case import Case
from analysis.estimators.structure_factor import structure_factor, write_structure
from analysis.estimators.transfer import gain_settings
from modal.formats.provenance import Provenance, is_current
from modal.modes.density import density_of_states, write_density
from modal.packing.network import Network
from modal.solvers.spectrum import bound_of_spectrum
from modal.system.operator import ContactOperator
from modal.waves.response import frequency_response, write_response

KINDS = "response", "density", "structure"
LINE = 0.005
"""Width of a line of the structure factor and of the density of states, in parts of the highest
frequency: 1 kHz in the study's packings under 100 kPa."""
DENSITY_TOLERANCE = 1e-3
"""Standard error of a count in parts of all modes."""


def prepare(case: Case, kinds: Sequence[str] = KINDS) -> list[Path]:
    """Make what is missing or stale: the gain, and for a random case density and structure factor.

    Of `kinds` alone. Says of what is stale which setting or source has changed; returns what was
    made.
    """
    network, digest, made = case.network, case.packing[0].sha256, []

    def wanted(kind: str, **settings: Any) -> Provenance | None:
        """What the file is to be made from, if it has to be made."""
        if kind not in kinds:
            return None
        command = f"python -m analysis measure {case.packing_path.name} --keep DIR"
        provenance = Provenance(command, settings, case.packing)
        if is_current(case.path(kind), provenance):
            return None
        made.append(case.path(kind))
        return provenance

    if "response" in kinds:
        gain: dict[str, Any] = gain_settings(network, case.passage)
        if of_gain := wanted("response", **gain, pre_stress="none"):
            write_response(made[-1], frequency_response(network, **gain), digest, of_gain)
    if case.is_crystal or not {"density", "structure"} & set(kinds):
        return made
    line = line_width(network)
    settings: dict[str, Any] = {"resolution": line, "tolerance": DENSITY_TOLERANCE}
    if of_density := wanted("density", **settings):
        states = density_of_states(network, **settings)
        write_density(made[-1], states, digest, of_density)
    if "structure" not in kinds:
        return made
    layers = int(network.length / case.diameter)
    ridge: dict[str, Any] = {"resolution": line, "highest": 1.5 * layers / (2 * case.passage)}
    orders = standing_orders(layers)
    if of_structure := wanted("structure", **ridge, orders=orders):
        found = structure_factor(network, orders, **ridge)
        write_structure(made[-1], found, digest, of_structure)
    return made


def line_width(network: Network) -> float:
    """`LINE` of the highest frequency, Hz, to three digits: an iteration bounds it."""
    top, _ = bound_of_spectrum(ContactOperator(network, mass_scaled=True))
    return float(f"{LINE * np.sqrt(top) / (2 * np.pi):.3g}")


def standing_orders(layers: int) -> np.ndarray:
    """Every order at long waves, then steps of a tenth of kappa, to one order a layer."""
    orders = np.round(1.1 ** np.arange(0, np.log(layers) / np.log(1.1)))
    orders = np.union1d(np.arange(1, 31), orders)
    return orders[orders <= layers].astype(int)
