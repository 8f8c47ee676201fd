"""Costly spectra of a packing, kept in files: gain, density of states, structure factor.

Each is made from the contact network alone; `measure --keep` makes it, and what has it, reads it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from analysis.case import Case
from analysis.estimators.effective_medium import of_contacts
from analysis.estimators.layer_lattice import is_fcc
from analysis.estimators.spectral_line import line_width
from analysis.estimators.structure_factor import structure_factor, write_structure
from analysis.estimators.transfer import gain_settings
from analysis.measuring import Measuring
from modal.formats.provenance import Provenance, is_current
from modal.modes.density import density_of_states, write_density
from modal.packing.network import Network, write_network
from modal.waves.response import frequency_response, write_response

DENSITY_TOLERANCE = 1e-3
"""Standard error of a count in parts of all modes."""
MADE: dict[str, tuple[Callable[..., Any], Callable[..., None]]] = {
    "response": (frequency_response, write_response),
    "density": (density_of_states, write_density),
    "structure": (structure_factor, write_structure),
}
"""Kind of file: what makes its spectrum, and what writes it."""


def kept_file(m: Measuring, kind: str) -> Any:
    """What a file of this kind holds, given, or kept in a folder; None without one.

    One that lies in that folder and is stale is made again.
    """
    case, folder = m.case, None if m.keep is None else Path(m.keep)
    elsewhere = folder is None or case.path(kind).parent.resolve() != folder.resolve()
    if case.has(kind) and elsewhere:
        return case.read(kind)
    if folder is None:
        return None
    folder.mkdir(parents=True, exist_ok=True)
    if case.files == {}:
        name = m.network.fingerprint[:16]
        packing = folder / f"{name}.network.h5"
        if not packing.is_file():
            write_network(packing, m.network)
    else:
        name, packing = case.name, case.packing_path
    of = "sample" if case.has("sample") else "network"
    own = Case(name, folder, {of: packing})
    prepare(own, m.network, kind)
    own.files = {of: packing, kind: own.path(kind)}
    return own.read(kind) if own.path(kind).is_file() else None


def prepare(case: Case, network: Network, kind: str) -> None:
    """Make a file of a case, response, density or structure, where it is missing or stale.

    A crystal has the first alone. Says of what is stale which setting or source has changed.
    """
    if kind != "response" and is_fcc(network):
        return
    settings = _settings(network, kind)
    noted = settings | ({"pre_stress": "none"} if kind == "response" else {})
    command = f"python -m analysis measure {case.packing_path.name} --keep DIR"
    made, path = Provenance(command, noted, case.packing), case.path(kind)
    if not is_current(path, made):
        make, write = MADE[kind]
        write(path, make(network, **settings), case.packing[0].sha256, made)


def _settings(network: Network, kind: str) -> dict[str, Any]:
    passage = network.length / of_contacts(network).velocity
    if kind == "response":
        return gain_settings(network, passage)
    if kind == "density":
        return {"resolution": line_width(network), "tolerance": DENSITY_TOLERANCE}
    layers = int(network.length / (2 * float(network.radius.mean())))
    highest = 1.5 * layers / (2 * passage)
    settings = {"resolution": line_width(network), "highest": highest}
    return settings | {"orders": standing_orders(layers)}


def standing_orders(layers: int) -> np.ndarray:
    """Every order at long waves, then steps of a tenth of kappa, to one order a layer."""
    orders = np.round(1.1 ** np.arange(0, np.log(layers) / np.log(1.1)))
    orders = np.union1d(np.arange(1, 31), orders)
    return orders[orders <= layers].astype(int)
