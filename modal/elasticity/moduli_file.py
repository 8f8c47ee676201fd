"""Elastic moduli as a file: "granular-moduli", version 1; see `docs/formats.md`."""

from __future__ import annotations

from pathlib import Path

from modal.elasticity.moduli import ElasticModuli
from modal.formats.product import Column, Product
from modal.formats.provenance import Provenance

SCHEMA = "granular-moduli"
VERSION = 1
MOTIONS = {
    "displacement": Column("non_affine/displacement", "f", (6, "n", 3), "m", optional=True),
    "rotation": Column("non_affine/rotation", "f", (6, "n", 3), "rad", optional=True),
}
FORMAT = Product(
    SCHEMA,
    {name: Column(name, "f", (6, 6), "Pa") for name in ("stiffness", "affine", "whole")} | MOTIONS,
    {
        "density": float,
        "region": str,
        "error": float,
        "asymmetry": float,
        "products": int,
        "solver": str,
        "network_sha256": str,
    },
    defaults={"network_sha256": ""},
)


def write_moduli(
    path: str | Path,
    moduli: ElasticModuli,
    network_sha256: str = "",
    made: Provenance | None = None,
) -> None:
    """Write the moduli atomically, and the non-affine motions if there are any."""
    values = vars(moduli) | {"network_sha256": network_sha256}
    if moduli.non_affine is not None:
        values["displacement"] = moduli.non_affine[:, :, :3]
        values["rotation"] = moduli.non_affine[:, :, 3:]
    FORMAT.write(path, values, made)


def read_moduli(path: str | Path) -> ElasticModuli:
    """Read and validate, without the non-affine motions; InputError for anything wrong."""
    said = FORMAT.read(path, leave=MOTIONS)
    return ElasticModuli(
        **{name: said[name] for name in said if name not in (*MOTIONS, "network_sha256")}
    )
