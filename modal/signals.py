"""Wave signals: what a run, by DEM or by the linear operator, has recorded; its file format.

This module is the one definition of the format "granular-wave-signals", version 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modal.storage import InputError, atomic_h5, get, open_h5, put

SCHEMA = "granular-wave-signals"
VERSION = 1
_DATASETS = {
    "time": ("f", "s"),
    "chain_particle": ("i", "1"),
    "chain_position": ("f", "m"),
    "chain_displacement": ("f", "m"),
    "source_displacement": ("f", "m"),
    "source_stress": ("f", "Pa"),
    "receiver_stress": ("f", "Pa"),
}


@dataclass
class Signals:
    """Recorded signals of one wave run; nt times, nc particles of the chain.

    time (nt,) s; chain_particle (nc,) index into the network; chain_position (nc,) z of the
    centres at the start, m; chain_displacement (nt, nc) along z, m; source_displacement (nt,) m;
    source_stress, receiver_stress (nt,) Pa, change from the static value, compression positive.
    amplitude is A of u = A (1 - cos 2 pi f t), m; time_step, run_time in seconds (run_time is
    the wall-clock time that the run took).
    """

    time: np.ndarray
    chain_particle: np.ndarray
    chain_position: np.ndarray
    chain_displacement: np.ndarray
    source_displacement: np.ndarray
    source_stress: np.ndarray
    receiver_stress: np.ndarray
    producer: str
    case: str
    amplitude: float
    input_frequency: float
    time_step: float
    run_time: float
    network_sha256: str


def source_pulse(time: np.ndarray, amplitude: float, frequency: float) -> np.ndarray:
    """Wall displacement u = A (1 - cos 2 pi f t) for one period, zero elsewhere; m.

    A sine period with its phase shifted by 270 degrees (Otsubo et al. 2017, Fig. 2a).
    """
    time = np.asarray(time)
    inside = (time > 0) & (time * frequency < 1)
    return np.where(inside, amplitude * (1 - np.cos(2 * np.pi * frequency * time)), 0.0)


_ATTRIBUTES = {
    "producer": str,
    "case": str,
    "amplitude": float,
    "input_frequency": float,
    "time_step": float,
    "run_time": float,
    "network_sha256": str,
}


def write_signals(path: str | Path, signals: Signals) -> None:
    """Write the signals atomically."""
    with atomic_h5(path) as file:
        file.attrs.update(schema=SCHEMA, schema_version=VERSION)
        for name, kind in _ATTRIBUTES.items():
            file.attrs[name] = kind(getattr(signals, name))
        for name, (kind, units) in _DATASETS.items():
            data = np.asarray(getattr(signals, name))
            data = data.astype(np.float64 if kind == "f" else np.int32)
            put(file, name.replace("_", "/", 1), data, units, compress=data.ndim == 2)


def read_signals(path: str | Path) -> Signals:
    """Read and validate signals; raises InputError with one line for anything wrong."""
    with open_h5(path, SCHEMA, VERSION) as file:
        nt = len(get(file, "time", "f", (None,)))
        nc = len(get(file, "chain/particle", "i", (None,)))
        columns = {}
        for name, (kind, _) in _DATASETS.items():
            shape = {"chain_displacement": (nt, nc), "chain_particle": (nc,)}.get(name, (nt,))
            shape = (nc,) if name == "chain_position" else shape
            columns[name] = get(file, name.replace("_", "/", 1), kind, shape)
            if not np.isfinite(columns[name]).all():
                raise InputError(f"{path}: {name} is not finite; the run failed, make it again")
        missing = [name for name in _ATTRIBUTES if name not in file.attrs]
        if missing:
            raise InputError(f"{path}: attribute {missing[0]} is missing; make the run again")
        attributes = {name: kind(file.attrs[name]) for name, kind in _ATTRIBUTES.items()}
    return Signals(**columns, **attributes)
