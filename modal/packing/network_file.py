"""The file of a contact network: the one definition of "granular-contact-network"."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from modal.formats.hdf5 import atomic_h5, get, open_h5, put
from modal.packing.checks import named
from modal.packing.columns import CONTACTS, OF_BONDS, OPTIONAL, PARTICLES
from modal.packing.network import Network, handed_over
from modal.tools.errors import InputError

SCHEMA = "granular-contact-network"
VERSION = (1, 2)
"""With a column of `OF_BONDS` a file says 2, which a reader that would miss it refuses."""


def write_network(path: str | Path, network: Network) -> None:
    """Write the network atomically; the 4-byte integers of the format are chosen here."""
    with atomic_h5(path) as file:
        version = VERSION[any(getattr(network, name) is not None for name in OF_BONDS)]
        file.attrs.update(schema=SCHEMA, schema_version=version, creator="granular-wave-modes")
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
        for group, fields in (("particles", PARTICLES), ("contacts", CONTACTS)):
            _refuse_unknown(file, group, fields)
            length: int | None = None
            for name, (kind, tail, _) in fields.items():
                full = f"{group}/{name}"
                if name in OPTIONAL and full not in file:
                    continue
                columns[name] = get(file, full, kind, (length, *tail))
                length = len(columns[name])
        columns["cell_size"] = get(file, "cell/size", "f", (3,))
        columns["cell_periodic"] = get(file, "cell/periodic", "b", (3,))
        columns["wall_position"] = get(file, "walls/position", "f", (2,))
        study = _attributes(file, "study")
        provenance = _attributes(file, "provenance")
    with named(path):
        return Network(**handed_over(**columns), study=study, provenance=provenance)


def _refuse_unknown(file: h5py.File, group: str, known: Iterable[str]) -> None:
    """A column of a later program may change the answer; in version 1 there was none that does."""
    further = sorted(set(file.get(group, ())) - set(known))
    if further and file.attrs["schema_version"] != 1:
        raise InputError(
            f"{file.filename}: {group}/{further[0]} is unknown to this program and may change the "
            "answer; update the program, or leave it out"
        )


def _attributes(file: h5py.File, group: str) -> dict[str, Any]:
    # `file.get` would take a damaged group for an absent one.
    return dict(file[group].attrs) if group in file else {}
