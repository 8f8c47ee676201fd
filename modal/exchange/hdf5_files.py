"""Explain HDF5 files that are not a packing: other products of this project, or foreign files."""

from pathlib import Path
from typing import NamedTuple

import h5py

from modal.exchange.refusals import quote, refuse
from modal.formats.hdf5 import complete, open_h5
from modal.formats.provenance import NETWORK_SCHEMA

SAMPLE_SCHEMA = "granular-sample"
GIVE_PACKING = "give the packing that it is of"
WATCH = "`python -m analysis watch` or `granular-modes export` with the packing shows it"
KEEP_BESIDE_PACKING = (
    "`python -m analysis measure` uses it where it lies beside its packing, under its name"
)


class OtherProduct(NamedTuple):
    """A product that is not a packing: its description, and the command that uses it."""

    description: str
    use: str


PRODUCTS = {
    "granular-wave-signals": OtherProduct(
        "a record of a wave", f"`python -m analysis measure PACKING RECORD` measures it, {WATCH}"
    ),
    "granular-plane-wave": OtherProduct(
        "an early record of a wave from a plane", "`export` shows it"
    ),
    "granular-modes": OtherProduct("a list of modes", WATCH),
    "granular-density-of-states": OtherProduct("a density of states", KEEP_BESIDE_PACKING),
    "granular-structure-factor": OtherProduct("a structure factor", KEEP_BESIDE_PACKING),
    "granular-moduli": OtherProduct("elastic moduli", KEEP_BESIDE_PACKING),
    "granular-frequency-response": OtherProduct("a frequency response", KEEP_BESIDE_PACKING),
}
"""Products of this project that are not a packing, by their schema."""
NETWORK_DATASETS = (
    "particles/position, radius, mass, inertia, contacts/particle_i, particle_j, normal, lever_i, "
    "lever_j, stiffness_normal, stiffness_tangential, cell/size, cell/periodic, walls/position"
)
"""Datasets that a network needs, for a message."""
MAX_LISTED_GROUPS = 6
"""Largest number of groups of a foreign file that a message lists."""


def refuse_other_hdf5(path: Path) -> None:
    """Raise InputError for an HDF5 file that is not a network; the message says what it is."""
    with open_h5(path) as file, complete(path):
        schema = file.attrs.get("schema")
        groups = list(file)
        particles = file.get("particles")
        in_motion = isinstance(particles, h5py.Group) and "velocity" in particles
    if isinstance(schema, bytes):
        schema = schema.decode(errors="replace")
    if not isinstance(schema, str):
        schema = ""
    if schema in PRODUCTS:
        product = PRODUCTS[schema]
        problem = f"{product.description}, not a packing"
        refuse(path, "other_product", problem, remedy=f"{GIVE_PACKING}; {product.use}")
    if schema == SAMPLE_SCHEMA and in_motion:
        refuse(
            path,
            "other_product",
            "a checkpoint of spheres in motion, not a network",
            remedy="the command that wrote it, `pack ... -o`, goes on from it when it is typed "
            "again",
        )
    if schema == SAMPLE_SCHEMA:
        problem = "a sample, not a network"
        refuse(path, "other_product", problem, remedy="let its name end in .sample.h5")
    if schema == NETWORK_SCHEMA or {"particles", "contacts"} <= set(groups):
        return
    listed = ", ".join(quote(name) for name in groups[:MAX_LISTED_GROUPS]) or "nothing"
    if len(groups) > MAX_LISTED_GROUPS:
        listed += ", ..."
    refuse(
        path,
        "foreign_hdf5",
        f"an HDF5 file of another program, with {listed} in it",
        remedy=f"write what a network needs ({NETWORK_DATASETS}; docs/formats.md), or two tables "
        "(*.csv)",
    )
