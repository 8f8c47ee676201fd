"""HDF5 files that are no packing: this project's other products, and other programs' files."""

from pathlib import Path

import h5py

from modal.exchange.text import fault, shown
from modal.formats.hdf5 import complete, open_h5
from modal.formats.provenance import NETWORK_SCHEMA

SAMPLE_SCHEMA = "granular-sample"
WITH_ITS_PACKING = "give the packing that it is of"
WATCHED = "`python -m analysis watch` or `granular-modes export` with the packing shows it"
BESIDE = "`python -m analysis measure` uses it where it lies beside its packing, under its name"
PRODUCTS = {
    "granular-wave-signals": (
        "a record of a wave",
        f"`python -m analysis measure PACKING RECORD` measures it, {WATCHED}",
    ),
    "granular-plane-wave": ("an early record of a wave from a plane", "`export` shows it"),
    "granular-modes": ("a list of modes", WATCHED),
    "granular-density-of-states": ("a density of states", BESIDE),
    "granular-structure-factor": ("a structure factor", BESIDE),
    "granular-moduli": ("elastic moduli", BESIDE),
    "granular-frequency-response": ("a frequency response", BESIDE),
}
"""Products that are no packing, by their schema: what each is, and what takes it."""
NEEDED = (
    "particles/position, radius, mass, inertia, contacts/particle_i, particle_j, normal, lever_i, "
    "lever_j, stiffness_normal, stiffness_tangential, cell/size, cell/periodic, walls/position"
)
"""Datasets of a network."""
GROUPS_SHOWN = 6


def refuse_other_hdf5(path: Path) -> None:
    """Raise InputError, which says what it is, for an HDF5 file that is no network."""
    with open_h5(path) as file, complete(path):
        schema = file.attrs.get("schema")
        groups = list(file)
        in_motion = isinstance(file.get("particles"), h5py.Group) and (
            "velocity" in file["particles"]
        )
    schema = schema.decode(errors="replace") if isinstance(schema, bytes) else schema
    if isinstance(schema, str) and schema in PRODUCTS:
        what, do = PRODUCTS[schema]
        fault(path, f"{what}, not a packing", f"{WITH_ITS_PACKING}; {do}", code="other_product")
    if isinstance(schema, str) and schema == SAMPLE_SCHEMA:
        what, do = "a sample", "let its name end in .sample.h5"
        if in_motion:
            what = "a checkpoint of spheres in motion"
            do = "the command that wrote it, `pack ... -o`, goes on from it when it is typed again"
        fault(path, f"{what}, not a network", do, code="other_product")
    of_a_network = schema == NETWORK_SCHEMA if isinstance(schema, str) else False
    if of_a_network or {"particles", "contacts"} <= set(groups):
        return
    names = ", ".join(shown(name) for name in groups[:GROUPS_SHOWN]) or "nothing"
    if len(groups) > GROUPS_SHOWN:
        names += ", ..."
    what = f"an HDF5 file of another program, with {names} in it"
    do = f"write what a network needs ({NEEDED}; docs/formats.md), or two tables (*.csv)"
    fault(path, what, do, code="foreign_hdf5")
