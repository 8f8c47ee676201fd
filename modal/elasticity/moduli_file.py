"""Elastic moduli as a file: "granular-moduli", version 1; see `docs/formats.md`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from modal.elasticity.moduli import ElasticModuli
from modal.formats.hdf5 import complete, get, open_h5, put
from modal.formats.provenance import Provenance, new_product

SCHEMA = "granular-moduli"
VERSION = 1
TENSORS = ("stiffness", "affine", "whole")
ATTRIBUTES = {
    "density": float, "region": str, "error": float, "asymmetry": float, "products": int,
    "solver": str,
}  # fmt: skip


def write_moduli(
    path: str | Path,
    moduli: ElasticModuli,
    network_sha256: str = "",
    made: Provenance | None = None,
) -> None:
    """Write the moduli atomically, and the non-affine motions if there are any."""
    with new_product(path, SCHEMA, VERSION, made) as file:
        file.attrs["network_sha256"] = network_sha256
        file.attrs.update({name: getattr(moduli, name) for name in ATTRIBUTES})
        for name in TENSORS:
            put(file, name, getattr(moduli, name), "Pa")
        if moduli.non_affine is not None:
            put(file, "non_affine/displacement", moduli.non_affine[:, :, :3], "m")
            put(file, "non_affine/rotation", moduli.non_affine[:, :, 3:], "rad")


def read_moduli(path: str | Path) -> ElasticModuli:
    """Read and validate, without the non-affine motions; InputError for anything wrong."""
    with open_h5(path, SCHEMA, VERSION) as file:
        said: dict[str, Any] = {name: get(file, name, "f", (6, 6)) for name in TENSORS}
        with complete(path):
            said |= {name: kind(file.attrs[name]) for name, kind in ATTRIBUTES.items()}
    return ElasticModuli(**said)
