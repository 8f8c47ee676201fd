"""Read VTK files by the library vtk: points with radii (.vtp, .vtu, legacy .vtk), spheres alone.

LIGGGHTS, YADE (VTKRecorder and VTKExporter), MFiX, Lethe, JaxDEM and this project's `export` write
them. The radius or the diameter of the points has many names. Such a file has no contact law and no
cell. A second file may have the contacts as lines with forces or stiffnesses as data.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from modal.exchange.contact_lines import ContactLines, known_fields
from modal.exchange.digits import are_rounded_to_single_precision, count_written_digits
from modal.exchange.import_result import ImportResult
from modal.exchange.refusals import refuse
from modal.exchange.registry import Option
from modal.exchange.sphere_table import read_heading
from modal.exchange.spheres import OPTIONS as SPHERE_OPTIONS
from modal.exchange.spheres import SphereKeywords, SphereOptions, Spheres
from modal.exchange.spheres_to_contacts import import_spheres
from modal.formats.tables import load_optional
from modal.tools.arrays import Array, Floats

NAME = "VTK (*.vtp, *.vtu, *.vtk)"
OPTIONS = {
    "contacts": Option("of the spheres: a VTK file with lines from centre to centre"),
    **SPHERE_OPTIONS,
}
XML_READERS = {
    "PolyData": "vtkXMLPolyDataReader",
    "UnstructuredGrid": "vtkXMLUnstructuredGridReader",
}
"""Readers of the library by the type of an XML file."""
SINGLE_DIGITS = 7
"""Significant digits of a number in single precision."""
SAMPLED_NUMBERS = 1500
"""Number of coordinates whose digits are looked at."""
MAX_DIGITS = 17


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether a file is in a VTK format, by its first line or its root element."""
    return head.startswith(b"# vtk DataFile") or b"<VTKFile" in head[:500]


def read(
    path: Path,
    scales: Sequence[float] | None = None,
    contacts: str | Path | None = None,
    **sphere_options: Unpack[SphereKeywords],
) -> ImportResult:
    """Return the packing of a file; `sphere_options` are described at `SphereOptions`.

    `contacts` is a file with lines between the centres.
    """
    options = SphereOptions(scales=scales, **sphere_options)
    position, fields = read_points(path)
    columns: dict[str, Floats] = {}
    for name, data in fields.items():
        known = read_heading(name).name
        if known and data.ndim == 1:
            columns.setdefault(known, data)
    if "radius" not in columns and "diameter" in columns:
        columns["radius"] = columns["diameter"] / 2
    if "radius" not in columns:
        listed = ", ".join(fields) or "none"
        problem = f"its points have no radius (fields: {listed})"
        refuse(path, "no_spheres", problem, remedy="give the file of the spheres, with radii")
    radius = columns["radius"].astype(float)
    spheres = Spheres(
        position=position,
        radius=radius,
        number=_numbers(columns.get("id")),
        mass=columns.get("mass"),
        density=columns.get("density"),
        digits=count_digits(position, radius),
    )
    contact_lines = None if contacts is None else read_contact_lines(Path(contacts))
    return import_spheres(path, spheres, options, contact_lines=contact_lines)


def read_contact_lines(path: Path) -> ContactLines:
    """Return the lines of a file, each from centre to centre, with their data.

    Raises InputError if lines are absent or have more than two points, or if the data of some lines
    are missing.
    """
    data = _read_with_library(path)
    lines = getattr(data, "GetLines", lambda: None)()
    if lines is None and hasattr(data, "GetCells"):
        lines = data.GetCells()
    if lines is None or lines.GetNumberOfCells() == 0:
        remedy = "give the file of the contacts (YADE: intr)"
        refuse(path, "no_contacts", "no lines in it", remedy=remedy)
    support = load_optional("vtkmodules.util.numpy_support", "VTK files")
    points = support.vtk_to_numpy(data.GetPoints().GetData()).astype(float)
    ends = support.vtk_to_numpy(lines.GetConnectivityArray())
    count = lines.GetNumberOfCells()
    if len(ends) != 2 * count:
        refuse(path, "no_contacts", "lines of more than two points", remedy="give contacts alone")
    fields = known_fields(_fields_of(data.GetCellData()))
    for name, values in fields.items():
        if len(values) != count:
            refuse(
                path,
                "other_length",
                f"{len(values)} numbers of {name} for {count} lines",
                "the VTKRecorder of YADE leaves lines through periods out",
                "write contacts by VTKExporter, or the network by yade_scripts/export_scene.py",
            )
    return ContactLines(path, points[ends.reshape(count, 2)], fields)


def read_points(path: Path) -> tuple[Floats, dict[str, Array]]:
    """Return the points (n, 3) of a file and their fields (n,) or (n, k) by name.

    Raises InputError if the library is absent, or if it cannot read the file.
    """
    data = _read_with_library(path)
    support = load_optional("vtkmodules.util.numpy_support", "VTK files")
    if data is None or not hasattr(data, "GetPoints") or data.GetNumberOfPoints() == 0:
        refuse(path, "no_spheres", "no points in it", remedy="give the file of the spheres")
    points: Floats = support.vtk_to_numpy(data.GetPoints().GetData()).astype(float)
    return points, _fields_of(data.GetPointData())


def _fields_of(attributes: Any) -> dict[str, Array]:
    """Return the arrays of points or cells by name."""
    support = load_optional("vtkmodules.util.numpy_support", "VTK files")
    fields = {}
    for index in range(attributes.GetNumberOfArrays()):
        array = attributes.GetArray(index)
        if array is not None:
            fields[array.GetName()] = support.vtk_to_numpy(array)
    return fields


def _read_with_library(path: Path) -> Any:
    """Return the data set of a file as an object of vtk; None if it cannot be read."""
    head = path.read_bytes()[:2000]
    if head.startswith(b"# vtk DataFile"):
        legacy = load_optional("vtkmodules.vtkIOLegacy", "VTK files")
        reader = legacy.vtkGenericDataObjectReader()
        reader.ReadAllScalarsOn()
        reader.ReadAllVectorsOn()
        reader.ReadAllFieldsOn()
    else:
        xml = load_optional("vtkmodules.vtkIOXML", "VTK files")
        kind = re.search(rb"<VTKFile[^>]*?\stype=[\"'](\w+)", head)
        name = XML_READERS.get(kind[1].decode() if kind else "")
        if name is None:
            problem = "neither PolyData nor UnstructuredGrid"
            refuse(path, "no_spheres", problem, remedy="give the *.vtp or *.vtu of the spheres")
        reader = getattr(xml, name)()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def _numbers(identifiers: Array | None) -> Floats | None:
    """Return the numbers of spheres; None if they are absent or not distinct."""
    if identifiers is None or len(np.unique(identifiers)) < len(identifiers):
        return None
    return identifiers.astype(float)


def count_digits(position: Floats, radius: Floats) -> int:
    """Return the significant digits of positions (n, 3) and radii (n,), whichever have fewer.

    Some programs write centres in single precision and radii in double. Text that was read in
    single precision may have fewer digits than this precision; radii of few digits are exact.
    """
    numbers = position.ravel()[:SAMPLED_NUMBERS]
    if are_rounded_to_single_precision(position.ravel()):
        written = (np.format_float_positional(number) for number in numbers.astype(np.float32))
        return min(count_written_digits(written), SINGLE_DIGITS)
    if are_rounded_to_single_precision(radius):
        return SINGLE_DIGITS
    written = (repr(number) for number in numbers.tolist())
    return min(count_written_digits(written), MAX_DIGITS)
