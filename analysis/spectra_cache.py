"""Store costly spectra of a packing in files: gain, density of states, structure factor.

Each spectrum is computed from the contact network alone. `measure --keep` writes it, and a later
call reads it.

The gain is the spectrum of the stress at the receiver wall divided by that at the source wall
(Fig. 19). Its resolution, gamma / pi, is the full width of a resonance at half its power under a
window exp(-gamma t). The height of a maximum depends on this window: between rigid walls L apart
the gain is 1 / |cos(q L)|, and under the window Im q = gamma / V even without any damping, so that
a maximum has the height 1 / sinh(gamma L / V). A height is therefore shown with the resolution and
with the height that an undamped column has.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

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

SpectrumKind = Literal["response", "density", "structure"]
"""Kind of a spectrum, which is that of its file: gain, density of states, structure factor."""

RESOLUTION = 0.376
"""Resolution of the gain divided by f_1 = V / 2 L, the distance between two maxima."""
MAX_GAIN_FREQUENCY_IN_V_PER_D = 0.5
"""Highest frequency of the gain, in V / D; the band of a crystal ends at 0.45."""
DENSITY_TOLERANCE = 1e-3
"""Standard error of a count of modes, as a share of all modes."""
ORDERS_WITHOUT_GAP = 30
"""Orders of the structure factor up to this one are all computed; above, each is a tenth higher
than the one before."""
ORDER_RATIO = 1.1
MAX_FREQUENCY_IN_LAYER_PASSAGES = 0.75
"""Highest frequency of the structure factor, times the time from wall to wall, divided by the
number of layers."""


class Maker(NamedTuple):
    """A function that computes a spectrum of a network, and one that writes it."""

    compute: Callable[..., Any]
    write: Callable[..., None]


MAKERS: dict[SpectrumKind, Maker] = {
    "response": Maker(frequency_response, write_response),
    "density": Maker(density_of_states, write_density),
    "structure": Maker(structure_factor, write_structure),
}


def kept_file(packing: PackingData, kind: SpectrumKind) -> Any:
    """Return the spectrum in a file: a file of the case, or one in the folder `packing.keep`.

    A file that is missing in the folder or out of date is computed and written first. If it cannot
    be written, the spectrum is returned nevertheless, and `packing.not_kept` says why. The result
    is None if there is no file and no folder. For a crystal only the response is stored in the
    folder.
    """
    case = packing.case
    if packing.keep is None:
        return case.read(kind)
    folder = Path(packing.keep)
    if case.has(kind) and case.path(kind).parent.resolve() != folder.resolve():
        return case.read(kind)
    if packing.crystal and kind != "response":
        return None
    try:
        kept = _kept_case(packing, folder)
    except InputError as error:
        packing.not_kept[kind] = Caveat("not_kept", {"reason": str(error)})
        return None
    path = kept.path(kind)
    settings = _settings(packing, kind)
    provenance = _provenance(kept, kind, settings)
    if not is_current(path, provenance):
        spectrum = compute_spectrum(packing, kind)
        try:
            MAKERS[kind].write(path, spectrum, provenance)
        except InputError as error:
            packing.not_kept[kind] = Caveat("not_kept", {"reason": str(error)})
            return as_read(kind, spectrum)
    return Case(kept.name, folder, {**(kept.files or {}), kind: path}).read(kind)


def _kept_case(packing: PackingData, folder: Path) -> Case:
    """Return the packing with its files in the folder; write a network that has no file.

    Raises InputError if the network cannot be written.
    """
    case = packing.case
    if case.files == {}:
        name = packing.network.fingerprint[:16]
        path = folder / f"{name}.network.h5"
        if not path.is_file():
            write_network(path, packing.network)
    else:
        name = case.name
        path = case.packing_path
    kind = "network"
    if case.has("sample"):
        kind = "sample"
    return Case(name, folder, {kind: path})


def _provenance(case: Case, kind: SpectrumKind, settings: dict[str, Any]) -> Provenance:
    """Return the provenance of a spectrum in the folder."""
    command = f"python -m analysis measure {case.packing_path.name} --keep DIR"
    if kind == "response":
        settings = {**settings, "pre_stress": "none"}
    return Provenance(command, settings, case.packing)


def as_read(kind: SpectrumKind, spectrum: Any) -> Any:
    """Return a spectrum with the digits that it would have after writing and reading it."""
    if kind != "density":
        return spectrum
    grid = spectrum.grid()
    return grid, spectrum.density(grid)[0][:, 6], spectrum.count_below(grid)[0][:, 6]


@cached_on_packing
def compute_spectrum(packing: PackingData, kind: SpectrumKind) -> Any:
    """Compute a spectrum of the contact network."""
    return MAKERS[kind].compute(packing.network, **_settings(packing, kind))


def _settings(packing: PackingData, kind: SpectrumKind) -> dict[str, Any]:
    """Return the arguments with which a spectrum is computed; frequencies in Hz."""
    if kind == "density":
        return {"resolution": packing.line, "tolerance": DENSITY_TOLERANCE}
    length = packing.network.length / packing.diameter
    if kind == "response":
        return {
            "resolution": RESOLUTION * 0.5 / packing.affine_passage,
            "highest": MAX_GAIN_FREQUENCY_IN_V_PER_D * length / packing.affine_passage,
        }
    layers = int(length)
    spaced = np.round(ORDER_RATIO ** np.arange(0, np.log(layers) / np.log(ORDER_RATIO)))
    orders = np.union1d(np.arange(1, ORDERS_WITHOUT_GAP + 1), spaced)
    return {
        "resolution": packing.line,
        "highest": MAX_FREQUENCY_IN_LAYER_PASSAGES * layers / packing.affine_passage,
        "orders": orders[orders <= layers].astype(int),
    }
