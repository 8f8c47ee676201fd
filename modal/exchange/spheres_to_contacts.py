"""Make a packing of spheres alone: their contacts and stiffnesses follow from a typed law.

With overlaps, as a simulation has them, contacts are the pairs that overlap, and the law gives
forces and stiffnesses. Without overlaps, as in a scan, contacts are the pairs whose gap is below a
tolerance, and stiffnesses follow from the mean stress (`modal.packing.scan`). Readers of files
without contacts call `import_spheres`; `from_spheres` takes arrays.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from modal.exchange import lammps
from modal.exchange.contact_lines import ContactLines, contacts_of_lines
from modal.exchange.import_result import ImportResult, build_network
from modal.exchange.law import Units
from modal.exchange.particles_and_contacts import Contacts, Packing
from modal.exchange.refusals import refuse
from modal.exchange.rows import Rows
from modal.exchange.spheres import SphereOptions, Spheres, packing_of, wall_line_of
from modal.exchange.typed_laws import TypedLaws, force_law, read_typed_laws
from modal.formats.hdf5 import named
from modal.packing.columns import frozen
from modal.packing.scan import Scan, ScannedSpheres
from modal.tools.errors import InputError


def import_spheres(
    path: str | Path,
    spheres: Spheres,
    options: SphereOptions,
    rows: Rows | None = None,
    contact_lines: ContactLines | None = None,
) -> ImportResult:
    """Return the packing of spheres alone.

    Parameters
    ----------
    path : str or Path
        The file, for messages.
    spheres : Spheres
        The spheres of the file.
    options : SphereOptions
        Options that were given with the file.
    rows : Rows, optional
        Rows of the file, for messages with a line number.
    contact_lines : ContactLines, optional
        Contacts as lines; if they have stiffnesses, no law is needed. Contacts with walls follow
        from the positions and the law.

    Raises
    ------
    InputError
        If a law is missing, or if the spheres are invalid.
    """
    if options.pair is None and contact_lines is not None and contact_lines.have_stiffnesses:
        return _import_with_stiffnesses(path, spheres, options, contact_lines)
    if options.pair is None:
        refuse(
            path,
            "no_law",
            "spheres alone have no stiffnesses",
            remedy=f"`import` them with a contact law ({lammps.EXAMPLE}), without overlaps also "
            "with --stress PA --tolerance GAP",
        )
    _refuse_incomplete_scan(options)
    units = options.units
    wall_line = options.wall
    if wall_line is None and options.cell is None:
        wall_line = wall_line_of(spheres.cell, units)
    laws = read_typed_laws(options.pair, wall_line, units)
    remarks = list(laws.remarks)
    packing = packing_of(path, spheres, options, laws.walls, remarks, rows)
    if options.stress is None:
        contacts = None
        if contact_lines is not None:
            contacts = _contacts_of(contact_lines, packing, units, remarks)
            # The typed law takes the place of stiffnesses.
            contacts = _with_walls(replace(contacts, columns={}), packing)
        result = build_network(packing, contacts, laws.between)
    else:
        scan = Scan(options.tolerance or 0.0, options.stress, force_law(laws, packing))
        result = _build_scanned_network(packing, scan, laws)
    result.remarks += remarks
    return result


def _import_with_stiffnesses(
    path: str | Path, spheres: Spheres, options: SphereOptions, contact_lines: ContactLines
) -> ImportResult:
    """Return the packing of spheres whose contacts have stiffnesses, so that no law is needed."""
    for name in ("wall", "stress", "tolerance"):
        if getattr(options, name) is not None:
            refuse(
                contact_lines.path,
                "no_law",
                f"--{name} without a law",
                "the stiffnesses of the file are those of contacts between spheres alone",
                "give --pair, too",
            )
    remarks: list[str] = []
    packing = packing_of(path, spheres, options, {}, remarks)
    contacts = _contacts_of(contact_lines, packing, options.units, remarks)
    result = build_network(packing, contacts, None)
    result.remarks += remarks
    return result


def _contacts_of(
    contact_lines: ContactLines, packing: Packing, units: Units, remarks: list[str]
) -> Contacts:
    """Return the contacts of lines; add a remark on omitted lines."""
    contacts, left_out = contacts_of_lines(contact_lines, packing, units)
    if left_out:
        remarks.append(
            f"{left_out} contacts end where no sphere is and are left out: those with walls follow "
            "from --wall, those through periods from --cell and --periodic"
        )
    return contacts


def _with_walls(contacts: Contacts, packing: Packing) -> Contacts:
    """Return contacts followed by those with walls, whose forces follow from the law."""
    touching = packing.touching()
    at_wall = touching.j < 0
    count = int(at_wall.sum())
    if not count:
        return contacts
    if contacts.force is None:
        contacts = replace(contacts, force=np.full(len(contacts.i), np.nan))
    unknown = np.full(count, np.nan)
    return contacts.with_walls(touching.i[at_wall], touching.j[at_wall], unknown, None)


def _refuse_incomplete_scan(options: SphereOptions) -> None:
    """Raise InputError for an invalid stress or tolerance, or for a tolerance without a stress."""
    stress = options.stress
    tolerance = options.tolerance or 0.0
    if stress is not None and not 0 < stress < np.inf:
        raise InputError("stress", f"stress {stress:g}", "must be positive", "give it in Pa")
    if not 0 <= tolerance < np.inf:
        raise InputError("tolerance", f"tolerance {tolerance:g}", "must not be negative")
    if tolerance and stress is None:
        raise InputError(
            "no_stress",
            "a tolerance of gaps without a stress",
            "across a gap no law gives a stiffness",
            "give the mean stress of the packing in Pa (--stress)",
        )


def _build_scanned_network(packing: Packing, scan: Scan, laws: TypedLaws) -> ImportResult:
    """Return the network of a packing with unknown overlaps, and the figures of its scan.

    The material and the friction of the law are noted, for a state at rest (`relax --stress`).
    """
    mass = packing.mass
    radius = packing.radius
    inertia = 0.4 * mass * radius**2
    bodies = frozen(position=packing.position, radius=radius, mass=mass, inertia=inertia)
    spheres = ScannedSpheres(
        bodies,
        cell_size=packing.cell.high - packing.cell.low,
        cell_periodic=packing.cell.periodic,
        wall_position=np.array(packing.cell.planes),
        has_wall=~np.isnan(packing.cell.walls),
    )
    with named(packing.name):
        network = spheres.network(scan, laws.notes)
    figures = {
        "gap_tolerance": scan.tolerance,
        "scan_stress": scan.stress,
        "coordination_number": network.coordination_number,
    }
    return ImportResult(network, told=figures, sought=True)
