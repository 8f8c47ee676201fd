"""Match contacts that a file draws as lines between centres with the spheres at their ends.

VTK files of contacts hold no numbers of spheres: each contact is a line from centre to centre, or
to an image of the second sphere beyond a period, with its forces and stiffnesses as data. YADE
(VTKRecorder `intr`, VTKExporter), LIGGGHTS (pair dumps) and Lethe (force chains) draw them so.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from modal.exchange.law import Units
from modal.exchange.particles_and_contacts import Contacts, Packing
from modal.exchange.refusals import refuse
from modal.tools.arrays import Array, Floats, Ints

MAX_DISTANCE_IN_RADII = 0.1
"""Largest distance, in radii, between the end of a line and the centre that it stands for: centres
with six digits or in single precision are nearer."""
MIN_CORRELATION = 0.5
"""Least correlation of the ranks of forces and overlaps; where each line has its own force it is
above 0.9, unless overlaps drown in their last digit."""
MIN_CONTACTS_TO_COMPARE = 10
STIFFNESSES = ("stiffness_normal", "stiffness_tangential")
NAMES = {
    "force": ("forcen", "normalforce", "forcenormal", "fn"),
    "force_vector": ("force", "contactforce"),
    "stiffness_normal": ("kn", "stiffnessnormal", "normalstiffness"),
    "stiffness_tangential": ("ks", "kt", "stiffnesstangential", "tangentialstiffness"),
}
"""Names of the data of contacts, in small letters without underscores, by what they mean."""


class ContactLines(NamedTuple):
    """Contacts as lines, in the units of the file.

    path: the file. ends (m, 2, 3): both ends. fields: data (m,) or (m, k), by the project's own
    names in `NAMES`.
    """

    path: Path
    ends: Floats
    fields: Mapping[str, Array]

    @property
    def have_stiffnesses(self) -> bool:
        """Tell whether normal and tangential stiffnesses are among the data."""
        return set(STIFFNESSES) <= self.fields.keys()


def known_fields(fields: Mapping[str, Array]) -> dict[str, Array]:
    """Return the data whose names are known, by the names of `NAMES`.

    >>> known_fields({"forceN": np.ones(2), "colour": np.ones(2)})
    {'force': array([1., 1.])}
    """
    known: dict[str, Array] = {}
    for name, data in fields.items():
        spelling = name.lower().replace("_", "").replace(" ", "")
        for meaning, spellings in NAMES.items():
            if spelling in spellings:
                known.setdefault(meaning, data)
    return known


class LineContacts(NamedTuple):
    """Contacts found from lines, and the number of lines one of whose ends is at no sphere."""

    contacts: Contacts
    left_out: int


def contacts_of_lines(lines: ContactLines, packing: Packing, units: Units) -> LineContacts:
    """Return the contacts between the spheres of a packing that are drawn as lines.

    A contact that is drawn twice, once on each side of a period, counts once. Lines with a sphere
    at one end only are left out: they are contacts with walls. Raises InputError for a line without
    a sphere at either end, and for forces that do not grow with the overlaps.
    """
    first = _spheres_at(lines, 0, packing, units)
    second = _spheres_at(lines, 1, packing, units)
    unknown = (first < 0) & (second < 0)
    if unknown.any():
        place = " ".join(f"{x:.6g}" for x in lines.ends[np.argmax(unknown), 0])
        refuse(
            lines.path,
            "no_sphere",
            f"a contact begins at {place} and ends, too, where no sphere is",
            remedy="give the file of the same step, the --cell and its --periodic axes",
        )
    known = np.flatnonzero((first >= 0) & (second >= 0))
    pairs = np.sort(np.column_stack([first, second])[known], axis=1)
    _, row = np.unique(pairs, axis=0, return_index=True)
    row = known[np.sort(row)]
    i = first[row]
    j = second[row]
    # Of a contact through a period the line may lead across the whole cell.
    geometry = packing.between(i, j)
    force = _normal_force(lines, row, geometry.normal)
    if force is not None:
        force = units.force * force
        _refuse_shuffled(lines.path, force, geometry.overlap)
    columns = {}
    if lines.have_stiffnesses:
        for name in STIFFNESSES:
            columns[name] = units.stiffness * np.asarray(lines.fields[name], float)[row]
    return LineContacts(Contacts(i, j, force=force, columns=columns), len(lines.ends) - len(known))


def _spheres_at(lines: ContactLines, end: int, packing: Packing, units: Units) -> Ints:
    """Return the indices (m,) of the spheres at one end of each line; -1 if there is none."""
    cell = packing.cell
    point = units.length * lines.ends[:, end]
    edges = np.where(cell.periodic[:, None], cell.edges, 0.0)
    if cell.periodic.any():
        point = point - np.floor(cell.in_edges(point - cell.low)) @ edges
    # A centre on the edge of a period may lie at either side of it.
    shifts = [np.zeros(3), *edges[cell.periodic], *-edges[cell.periodic]]
    from scipy.spatial import KDTree  # not at import: few files have lines

    tree = KDTree(packing.position)
    distance = np.full(len(point), np.inf)
    sphere = np.zeros(len(point), int)
    for shift in shifts:
        near, index = tree.query(point + shift)
        closer = near < distance
        distance[closer] = near[closer]
        sphere[closer] = index[closer]
    sphere[distance > MAX_DISTANCE_IN_RADII * packing.radius[sphere]] = -1
    return sphere


def _refuse_shuffled(path: Path, force: Floats, overlap: Floats) -> None:
    """Raise InputError if forces do not grow with overlaps: they belong to other lines."""
    if len(force) < MIN_CONTACTS_TO_COMPARE or np.ptp(force) == 0 or np.ptp(overlap) == 0:
        return
    from scipy.stats import spearmanr  # not at import: few files have lines

    correlation = spearmanr(force, overlap).statistic
    if correlation < MIN_CORRELATION:
        refuse(
            path,
            "shuffled_forces",
            f"its forces do not grow with the overlaps (correlation of ranks {correlation:.2f})",
            "YADE's VTKRecorder leaves lines through periods out, but not their forces",
            "write contacts by VTKExporter, or the network by yade_scripts/export_scene.py",
        )


def _normal_force(lines: ContactLines, row: Ints, normal: Floats) -> Floats | None:
    """Return the normal forces (k,) of k lines in units of the file; None if the file has none.

    `row` (k,) are the lines, `normal` (k, 3) the unit vectors between the centres.
    """
    for name in ("force", "force_vector"):
        force = lines.fields.get(name)
        if force is None:
            continue
        if force.ndim == 1:
            return np.abs(np.asarray(force, float)[row])
        if force.shape[1:] == (3,):
            return np.abs((np.asarray(force, float)[row] * normal).sum(axis=1))
    return None
