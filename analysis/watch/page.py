"""The page itself: positions and motions as small whole numbers, and what draws them.

`packing.js` and `player.js` draw with three.js and uPlot, which lie beside them in one file and go
into the page, so that it opens anywhere. Displacements are 16 bits a component, in steps of
1/32,767 of the largest: 35,201 spheres at 100 times are 9 MB of text, their contacts 2 MB.
"""

import base64
import json
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from modal.exchange.picture import (
    MAX_SHOWN_DISPLACEMENT_IN_RADII,
    read_sphere_motion,
    sphere_stress,
)
from modal.exchange.registry import read
from modal.formats.provenance import packing_of, read_provenance, require_same_packing
from modal.formats.whole_file import write_whole
from modal.modes.mode_set import ModeSet
from modal.packing.layers import Layers
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.tools.display import quantity
from modal.tools.errors import InputError
from modal.waves.signals import Signals

STEPS = 32767
"""Number of steps of a displacement from zero to the largest."""
MOTION = 7_500_000
"""Largest size of the displacements in a page, bytes; base64 makes 10 MB of text of it."""
FRAMES = 100, 400
"""Least and largest number of times of a wave in a page: as many as fit into `MOTION`."""
SHOWN_SIGNALS = 16
PRODUCERS = {
    "yade": "a wave simulated by YADE",
    "linear": "the linear wave of its contacts' springs",
    "nonlinear": "a wave whose contacts slide and open",
}
DECADES = 4
"""Powers of ten below the largest slip energy that are shown: eyes tell no more apart."""
SPECTRUM = 2.5
"""Highest frequency of the spectra divided by that of the pulse."""


def watch_page(
    product: str | Path,
    output: str | Path,
    packing: str | Path | None = None,
    chosen: list[int] | None = None,
) -> list[str]:
    """Write the page of a wave (`*.signals.h5`) or modes (`*.modes.h5`); return notes for readers.

    `packing` is the file that it was made from; if None, the one of its name beside the product.
    `chosen` are the modes by number from 1, all by default.
    InputError for files without the motion of every sphere.
    """
    of, moved, numbers = read_sphere_motion(product, chosen)
    packing = packing or _packing_beside(Path(product))
    notes = [note for note in [require_same_packing(product, packing_of(packing))] if note]
    network = read(packing)
    if isinstance(of, Signals):
        shown = _of_wave(network, of, moved) | _of_slip(network, of)
    else:
        shown = _of_modes(network, of, moved, numbers)
    data = _of_packing(network) | shown
    title = f"{Path(product).name}, {data['spheres']:,} spheres"
    write_whole(output, _filled(title, data).encode())
    return notes


def _packing_beside(product: Path) -> Path:
    """Return the packing that a product names as its source, in its folder."""
    names = [source.name for source in read_provenance(product).packing if source.name]
    for name in names:
        if (product.parent / name).is_file():
            return product.parent / name
    told = " or ".join(names) or "of unknown name"
    raise InputError(
        "no_packing",
        f"{product}: its packing, {told}, is not beside it",
        remedy="name that as well",
    )


def _of_packing(network: Network) -> dict[str, Any]:
    """Return where the spheres are, and how hard their contacts press them."""
    low = network.position.min(axis=0)
    step = np.maximum(np.ptp(network.position, axis=0), network.radius.max()) / 65535
    shown: dict[str, Any] = {
        "spheres": network.n_particles,
        "origin": low.tolist(),
        "step": step.tolist(),
        "position": coded(np.round((network.position - low) / step), "<u2"),
        "radius": coded(network.radius, "<f4"),
        "mean_radius": float(network.radius.mean()),
        "visible": MAX_SHOWN_DISPLACEMENT_IN_RADII * float(network.radius.mean()),
        "cell": _of_cell(network),
        "walls": [
            float(z) if (network.particle_j == wall).any() else None
            for z, wall in zip(network.wall_position, (SOURCE_WALL, RECEIVER_WALL), strict=True)
        ],
    }
    if network.force_normal is not None:
        shown["contacts"] = _of_contacts(network, network.force_normal)
    if network.force_normal is not None and network.force_tangential is not None:
        pressure = sphere_stress(network)[:, :3].mean(axis=1)
        shown["pressure"], top = _from_zero(pressure)
        shown["pressure_ends"] = ["0", quantity(top, "Pa", 3)]
    return shown


def _of_cell(network: Network) -> dict[str, list[float]]:
    """Return the corners of the box of the packing: walls, periods, or outer spheres."""
    reach = network.radius[:, None]
    low, high = (network.position - reach).min(axis=0), (network.position + reach).max(axis=0)
    middle, periodic = (low + high) / 2, network.cell_periodic
    low = np.where(periodic, middle - network.cell_size / 2, low)
    high = np.where(periodic, middle + network.cell_size / 2, high)
    low[2], high[2] = network.wall_position
    return {"low": low.tolist(), "high": high.tolist()}


def _of_contacts(network: Network, force: np.ndarray) -> dict[str, Any]:
    """Return contacts from sphere to sphere, or to a wall (-1), and their normal forces."""
    step = float(abs(network.branch).max(initial=0.0)) / STEPS or 1.0
    return {
        "first": coded(network.particle_i, "<i4"),
        "second": coded(np.maximum(network.particle_j, -1), "<i4"),
        "across": coded(np.round(network.branch / step), "<i2"),
        "step": step,
        "force": _from_zero(force)[0],
    }


def _from_zero(values: np.ndarray) -> tuple[str, float]:
    """Return values, coded in 255 steps from zero to their 99th percentile, and the latter."""
    top = float(np.percentile(values, 99)) if len(values) else 0.0
    top = top if top > 0 else 1.0
    return coded(np.clip(values / top * 255, 0, 255), "u1"), top


def _of_wave(network: Network, signals: Signals, moved: np.ndarray) -> dict[str, Any]:
    most = len(signals.time)
    frames = int(np.clip(MOTION // (2 * network.n_particles), *FRAMES))
    at = np.unique(np.linspace(0, most - 1, min(frames, most)).round().astype(int))
    largest = float(abs(moved).max()) or 1.0
    # A wave that has left the wall is small beside the push: colours are full at its size.
    typical = float(np.median(abs(moved[at]).max(axis=1)))
    chain = signals.chain_displacement
    place = np.argsort(signals.chain_position)
    place = place[np.unique(np.linspace(0, len(place) - 1, SHOWN_SIGNALS).round().astype(int))]
    interval = float(np.mean(np.diff(signals.time)))
    frequency = np.fft.rfftfreq(most, interval)
    band = frequency <= SPECTRUM * signals.input_frequency
    return {
        "kind": "wave",
        "told": (
            f"{network.n_particles:,} spheres; {PRODUCERS.get(signals.producer, 'a wave')}, "
            f"pulse of {quantity(signals.input_frequency, 'Hz')}, "
            f"{quantity(2 * signals.amplitude, 'm')} high; {len(at)} of {most} recorded times. "
            f"Coloured by displacement along {signals.direction}."
        ),
        "along": signals.direction,
        "time": _short(1e6 * signals.time[at]),
        "displacement": quantised(moved[at], largest),
        "real": largest,
        "largest_nm": 1e9 * largest,
        "wall_displacement": _short(1e9 * signals.source_displacement[at]),
        "contrast": float(np.log10(largest / max(typical, 1e-3 * largest))),
        "signal_time": _short(1e6 * signals.time),
        "spectrum_frequency": _short(frequency[band] / 1e3),
        "signals": [
            {
                "name": f"the sphere at z = {1e3 * signals.chain_position[k]:.1f} mm",
                "displacement": _short(1e9 * chain[:, k]),
                "spectrum": _short(1e15 * interval * abs(np.fft.rfft(chain[:, k]))[band]),
            }
            for k in place
        ],
    }


def _of_slip(network: Network, signals: Signals) -> dict[str, Any]:
    """Return what slip dissipated in the contacts of each sphere, on a logarithmic scale."""
    if signals.slip_ends is None or signals.slip_energy is None:
        return {}
    lost = slip_of_spheres(network.n_particles, signals.slip_ends, signals.slip_energy)
    top = float(lost.max())
    if not top > 0:
        return {}
    deep = np.log10(np.maximum(lost, 10.0**-DECADES * top) / top) / DECADES + 1
    whole, count = quantity(float(signals.slip_energy.sum()), "J", 3), len(signals.slip_energy)
    return {
        "slip": coded(np.round(255 * deep), "u1"),
        "slip_ends": [f"{10.0**-DECADES:g} of it or less", quantity(top, "J", 3)],
        "slip_decades": DECADES,
        "slip_told": f"Slip dissipated {whole} in {count} contacts.",
    }


def slip_of_spheres(count: int, ends: np.ndarray, energy: np.ndarray) -> np.ndarray:
    """Return (count,), J: to each sphere half of what its contacts (k, 2) dissipated.

    A contact with a wall gives all to its sphere, so that the sum is that over contacts.
    """
    first, second = ends.T
    pair = second >= 0
    own: np.ndarray = np.bincount(first, np.where(pair, 0.5, 1.0) * energy, count)
    return own + np.bincount(second[pair], 0.5 * energy[pair], count)


def _of_modes(
    network: Network, modes: ModeSet, moved: np.ndarray, numbers: list[int]
) -> dict[str, Any]:
    fits = max(1, MOTION // (6 * network.n_particles))
    if len(numbers) > fits:
        many = f"{len(numbers)} modes of {network.n_particles} spheres"
        raise InputError(
            "too_many_modes",
            f"{many} make too large a page",
            remedy=f"choose up to {fits} with --modes",
        )
    index = np.array(numbers) - 1
    shape = moved[index][:, :, :3]
    largest = np.maximum(np.linalg.norm(shape, axis=2).max(axis=1), np.finfo(float).tiny)
    main = (shape**2).sum(axis=1).argmax(axis=1)  # the axis along which a mode moves most
    layers = Layers(network)
    return {
        "kind": "modes",
        "contrast": 0.0,
        "told": (
            f"{network.n_particles:,} spheres; {len(index)} of {len(modes.frequency)} modes, "
            f"{'' if modes.certified else 'not '}complete by an exact count. "
            "Amplitudes are arbitrary."
        ),
        "displacement": quantised(shape / largest[:, None, None], 1.0),
        "layer_z": _short(1e3 * layers.position),
        "modes": [
            {
                "name": f"{number}: {modes.frequency[k] / 1e3:.6g} kHz",
                "frequency": float(modes.frequency[k]) / 1e3,
                "chi_z": float(modes.chi_z[k]),
                "along": "xyz"[axis],
                "layers": _short(layers.means(u[:, axis]) / top),
            }
            for number, k, u, top, axis in zip(numbers, index, shape, largest, main, strict=True)
        ],
    }


def quantised(values: np.ndarray, largest: float) -> str:
    """Return values in base64 of 16-bit numbers, off by at most half a step of `largest`."""
    return coded(np.round(values / largest * STEPS), "<i2")


def coded(values: np.ndarray, kind: str) -> str:
    """Return numbers of a kind, as `<i2`, in base64."""
    return base64.b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode()


def _short(values: np.ndarray) -> list[float]:
    return [float(f"{value:.5g}") for value in values]


def _filled(title: str, data: dict[str, Any]) -> str:
    """Return the page with the texts and files that it names in doubled braces."""
    # A text in the data cannot end their script element.
    parts = {"data": json.dumps(data).replace("</", "<\\/")}
    parts["title"] = title.replace("&", "&amp;").replace("<", "&lt;")

    def part(name: str) -> str:
        return parts.get(name) or files("analysis.watch").joinpath(name).read_text()

    # In one pass: what is filled in may itself have doubled braces.
    return re.sub(r"\{\{([\w.]+)\}\}", lambda place: part(place[1]), part("page.html"))
