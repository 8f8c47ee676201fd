"""The file of a contact network: the one definition of "granular-contact-network", version 1."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from modal.formats.hdf5 import atomic_h5, get, open_h5, put
from modal.packing.checks import named
from modal.packing.columns import CONTACTS, OPTIONAL, PARTICLES
from modal.packing.network import Network, handed_over

SCHEMA = "granular-contact-network"
VERSION = 1


def write_network(path: str | Path, network: Network) -> None:
    """Write the network atomically; the 4-byte integers of the format are chosen here."""
    with atomic_h5(path) as file:
        file.attrs.update(schema=SCHEMA, schema_version=VERSION, creator="granular-wave-modes")
        for group, fields in (("particles", PARTICLES), ("contacts", CONTACTS)):
            for name, (kind, _, units) in fields.items():
                data = getattr(network, name)
                if data is None:
                    continue
                stored = np.asarray(data).astype({"f": np.float64, "i": np.int32, "b": bool}[kind])
                put(file, f"{group}/{name}", stored, units)
        put(file, "cell/size", np.asarray(network.cell_size, float), "m")
        put(file, "cell/periodic", np.asarray(network.cell_periodic, bool), "1")
        put(file, "walls/position", np.asarray(network.wall_position, float), "m")
        file.create_group("study").attrs.update(network.study)
        file.create_group("provenance").attrs.update(network.provenance)


def read_network(path: str | Path) -> Network:
    """Read and validate a network; raises InputError with one line for anything wrong."""
    with open_h5(path, SCHEMA, VERSION) as file:
        columns: dict[str, Any] = {}
        n: int | None = None
        for name, (kind, tail, _) in PARTICLES.items():
            columns[name] = get(file, f"particles/{name}", kind, (n, *tail))
            n = len(columns[name])
        m: int | None = None
        for name, (kind, tail, _) in CONTACTS.items():
            full = f"contacts/{name}"
            if name in OPTIONAL and full not in file:
                continue
            columns[name] = get(file, full, kind, (m, *tail))
            m = len(columns[name])
        columns["cell_size"] = get(file, "cell/size", "f", (3,))
        columns["cell_periodic"] = get(file, "cell/periodic", "b", (3,))
        columns["wall_position"] = get(file, "walls/position", "f", (2,))
        study = _attributes(file, "study")
        provenance = _attributes(file, "provenance")
    with named(path):
        return Network(**handed_over(**columns), study=study, provenance=provenance)


def _attributes(file: h5py.File, group: str) -> dict[str, Any]:
    # `file.get` would take a damaged group for an absent one.
    return dict(file[group].attrs) if group in file else {}
