"""Costly spectra of a packing, kept in files: gain, density of states, structure factor.

Each is made from the contact network alone; `measure --keep` makes it, and what has it, reads it.

The gain is the spectrum of the stress at the receiver wall over that at the source wall (Fig. 19),
with a stated resolution: gamma / pi, the full width of a resonance at half its power under a window
exp(-gamma t). The height of a maximum is that window's. Between rigid walls L apart the gain is
1 / |cos(q L)|, and under the window Im q = gamma / V even without any damping: 1 / sinh(gamma L /
V) on a maximum. So no height stands alone; beside it stand the resolution and what an undamped
column has under it.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from analysis.case import Case
from analysis.caveats import Caveat
from analysis.estimators.structure_factor import structure_factor, write_structure
from analysis.packing_data import PackingData, cached_on_packing
from modal.formats.provenance import Provenance, is_current
from modal.modes.density import density_of_states, write_density
from modal.packing.network import write_network
from modal.tools.errors import InputError
from modal.waves.response import frequency_response, write_response

RESOLUTION = 0.376
"""In f_1 = V / 2 L: maxima lie f_1 apart."""
REACH = 0.5
"""Highest frequency of the gain of a network, V / D; what a crystal passes ends at 0.45."""
DENSITY_TOLERANCE = 1e-3
"""Standard error of a count in parts of all modes."""
MADE: dict[str, tuple[Callable[..., Any], Callable[..., None]]] = {
    "response": (frequency_response, write_response),
    "density": (density_of_states, write_density),
    "structure": (structure_factor, write_structure),
}
"""Kind of file: what makes its spectrum, and what writes it."""


def kept_file(m: PackingData, kind: str) -> Any:
    """What a file of this kind holds, given, or kept in a folder; None without one.

    One that lies in that folder and is stale is made again; a crystal has the response alone. Where
    the folder takes no file, `m.not_kept` says why, and the spectrum counts all the same.
    """
    case, folder = m.case, None if m.keep is None else Path(m.keep)
    elsewhere = folder is None or case.path(kind).parent.resolve() != folder.resolve()
    if case.has(kind) and elsewhere:
        return case.read(kind)
    if folder is None or (kind != "response" and m.crystal):
        return None
    if case.files == {}:
        name = m.network.fingerprint[:16]
        packing = folder / f"{name}.network.h5"
        if not packing.is_file():
            try:
                write_network(packing, m.network)
            except InputError as error:
                m.not_kept.append(Caveat("not_kept", {"reason": str(error)}))
                return None
    else:
        name, packing = case.name, case.packing_path
    of = "sample" if case.has("sample") else "network"
    own = Case(name, folder, {of: packing})
    settings, path = _settings(m, kind), own.path(kind)
    noted = settings | ({"pre_stress": "none"} if kind == "response" else {})
    command = f"python -m analysis measure {packing.name} --keep DIR"
    how = Provenance(command, noted, own.packing)
    if not is_current(path, how):
        spectrum = made(m, kind)
        try:
            MADE[kind][1](path, spectrum, how)
        except InputError as error:
            m.not_kept.append(Caveat("not_kept", {"reason": str(error)}))
            return as_read(kind, spectrum)
    own.files = {of: packing, kind: path}
    return own.read(kind)


def as_read(kind: str, spectrum: Any) -> Any:
    """Return a spectrum as its file would give it."""
    if kind != "density":
        return spectrum
    grid = spectrum.grid()
    return grid, spectrum.density(grid)[0][:, 6], spectrum.count_below(grid)[0][:, 6]


@cached_on_packing
def made(m: PackingData, kind: str) -> Any:
    """Make the spectrum itself."""
    return MADE[kind][0](m.network, **_settings(m, kind))


def _settings(m: PackingData, kind: str) -> dict[str, Any]:
    """Resolution and highest frequency, Hz, and what else a spectrum needs."""
    if kind == "response":
        highest = REACH * (m.network.length / m.diameter) / m.affine_passage
        return {"resolution": RESOLUTION * 0.5 / m.affine_passage, "highest": highest}
    if kind == "density":
        return {"resolution": m.line, "tolerance": DENSITY_TOLERANCE}
    layers = int(m.network.length / m.diameter)
    # Every order at long waves, then steps of a tenth of kappa, to one order a layer.
    orders = np.round(1.1 ** np.arange(0, np.log(layers) / np.log(1.1)))
    orders = np.union1d(np.arange(1, 31), orders)
    orders, highest = orders[orders <= layers].astype(int), 0.75 * layers / m.affine_passage
    return {"resolution": m.line, "highest": highest, "orders": orders}
