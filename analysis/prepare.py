"""Costly spectra of a packing, kept in files: gain, density of states, structure factor.

Each is made from the contact network alone; `measure --keep` makes it, and what has it, reads it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.case import Case
from analysis.estimators.effective_medium import of_contacts
from analysis.estimators.layer_lattice import is_fcc
from analysis.estimators.structure_factor import structure_factor, write_structure
from analysis.estimators.transfer import gain_settings
from modal.formats.provenance import Provenance, is_current
from modal.modes.density import density_of_states, write_density
from modal.packing.network import Network
from modal.solvers.spectrum import bound_of_spectrum
from modal.system.operator import ContactOperator
from modal.waves.response import frequency_response, write_response

LINE = 0.005
"""Width of a line of the structure factor and of the density of states, in parts of the highest
frequency: 1 kHz in the study's packings under 100 kPa."""
DENSITY_TOLERANCE = 1e-3
"""Standard error of a count in parts of all modes."""


def prepare(case: Case, network: Network, kind: str) -> None:
    """Make a file of a case, response, density or structure, where it is missing or stale.

    A crystal has the first alone. Says of what is stale which setting or source has changed.
    """
    settings: dict[str, Any]
    if kind == "response":
        passage = network.length / of_contacts(network).velocity
        settings = gain_settings(network, passage)
    elif is_fcc(network):
        return
    elif kind == "density":
        settings = {"resolution": line_width(network), "tolerance": DENSITY_TOLERANCE}
    else:
        layers = int(network.length / (2 * float(network.radius.mean())))
        highest = 1.5 * layers / (2 * network.length / of_contacts(network).velocity)
        settings = {"resolution": line_width(network), "highest": highest}
        settings["orders"] = standing_orders(layers)
    noted = settings | ({"pre_stress": "none"} if kind == "response" else {})
    command = f"python -m analysis measure {case.packing_path.name} --keep DIR"
    made, path = Provenance(command, noted, case.packing), case.path(kind)
    if is_current(path, made):
        return
    digest = case.packing[0].sha256
    if kind == "response":
        write_response(path, frequency_response(network, **settings), digest, made)
    elif kind == "density":
        write_density(path, density_of_states(network, **settings), digest, made)
    else:
        write_structure(path, structure_factor(network, **settings), digest, made)


def line_width(network: Network) -> float:
    """`LINE` of the highest frequency, Hz, to three digits: an iteration bounds it."""
    top, _ = bound_of_spectrum(ContactOperator(network, mass_scaled=True))
    return float(f"{LINE * np.sqrt(top) / (2 * np.pi):.3g}")


def standing_orders(layers: int) -> np.ndarray:
    """Every order at long waves, then steps of a tenth of kappa, to one order a layer."""
    orders = np.round(1.1 ** np.arange(0, np.log(layers) / np.log(1.1)))
    orders = np.union1d(np.arange(1, 31), orders)
    return orders[orders <= layers].astype(int)
