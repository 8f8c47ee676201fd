"""VTK, extended XYZ, data files of LAMMPS, old restarts of MercuryDPM; readers of others."""

import importlib
import sys

import numpy as np
import packings
import program_files
import pytest
from refusals import refusal

import modal
from modal.cli.main import main
from modal.exchange import registry
from modal.exchange.registry import import_packing

LAW = "granular hertz/material 6e10 0 0.2 tangential mindlin/force NULL 0 0.3"


@pytest.fixture(scope="module")
def periodic():
    return packings.polydisperse(True)


def compare(found, network, rtol=1e-9):
    """Compare contacts and stiffnesses; masses are those of the file."""
    program_files.assert_same_contacts(found, network, "particle_i particle_j", 0)
    program_files.assert_same_contacts(
        found, network, "stiffness_normal stiffness_tangential", rtol
    )


def test_own_xyz_goes_in_again(tmp_path, periodic):
    modal.write(tmp_path / "x.network.h5", periodic)
    path = tmp_path / "x.xyz"
    assert main(["export", str(tmp_path / "x.network.h5"), "-o", str(path)]) == 0
    found = import_packing(path, pair=LAW).network
    compare(found, periodic)
    np.testing.assert_allclose(found.mass, periodic.mass, rtol=1e-12)
    text = path.read_text()
    path.write_text(text.replace("radius", "size"))
    with refusal("no_column", "radius"):
        import_packing(path, pair=LAW)
    path.write_text(text + text)
    with refusal("several_times"):
        import_packing(path, pair=LAW)
    path.write_text(text[: len(text) // 2].rpartition("\n")[0] + "\n")
    with refusal("cut_off"):
        import_packing(path, pair=LAW)


def data_file(path, network, style="sphere", flags=" 0 0 0"):
    """Write a data file as `write_data` does, with 17 digits."""
    rows = ""
    density = network.mass / (4 / 3 * np.pi * network.radius**3)
    for k in range(network.n_particles):
        numbers = (2 * network.radius[k], density[k], *network.position[k])
        rows += f"{k + 1} 1 {' '.join(f'{number:.17g}' for number in numbers)}{flags}\n"
    side = network.cell_size
    path.write_text(
        "LAMMPS data file via write_data, version 22 Jul 2025, timestep = 7, units = si\n\n"
        f"{network.n_particles} atoms\n1 atom types\n\n0 {side[0]:.17g} xlo xhi\n"
        f"0 {side[1]:.17g} ylo yhi\n0 {side[2]:.17g} zlo zhi\n\nAtoms # {style}\n\n{rows}\n"
        f"Velocities\n\n1 0 0 0 0 0 0\n"
    )
    return path


@pytest.mark.parametrize("flags", [" 0 0 0", ""])
def test_data_file_of_lammps(tmp_path, periodic, flags):
    path = data_file(tmp_path / "x.data", periodic, flags=flags)
    result = import_packing(path, pair=LAW)
    compare(result.network, periodic)
    assert any("--periodic" in remark for remark in result.remarks)
    assert import_packing(path, pair=LAW, periodic="xyz").remarks == []
    with refusal("no_law", "--pair"):
        import_packing(path)


def test_data_files_without_spheres_are_refused(tmp_path, periodic):
    path = data_file(tmp_path / "x.data", periodic, style="atomic")
    with refusal("no_spheres", "atomic"):
        import_packing(path, pair=LAW)


def test_tilted_data_files_of_lammps(tmp_path, periodic):
    """A period along y that leans by a whole period along x describes the same packing."""
    path = data_file(tmp_path / "x.data", periodic)
    side = periodic.cell_size[0]
    tilted = path.read_text().replace("zlo zhi\n", f"zlo zhi\n{side:.17g} 0 0 xy xz yz\n")
    path.write_text(tilted)
    network = import_packing(path, pair=LAW).network
    assert network.cell_vectors[1, 0] == side
    own = np.sort(network.stiffness_normal)
    np.testing.assert_allclose(own, np.sort(periodic.stiffness_normal), rtol=1e-9)


def mdpa_file(path, network, element="SphericParticle3D"):
    """Write spheres as a model part of Kratos, with comments and a part of the model."""
    count = network.n_particles
    nodes = ""
    elements = ""
    radii = ""
    for k in range(count):
        place = " ".join(f"{x:.17g}" for x in network.position[k])
        nodes += f"{k + 1} {place}\n"
        elements += f"{k + 1} 0 {k + 1}\n"
        radii += f"  {k + 1} 0 {network.radius[k]:.17g}\n"
    path.write_text(
        "Begin ModelPartData\n//  VARIABLE_NAME value\nEnd ModelPartData\n\n"
        f"Begin Properties 0\nEnd Properties\n\nBegin Nodes\n{nodes}End Nodes\n\n"
        f"Begin Elements {element}// GUI group identifier: Body\n{elements}End Elements\n\n"
        f"Begin NodalData RADIUS // GUI group identifier: Body\n{radii}End NodalData\n\n"
        "Begin SubModelPart Parts\nBegin SubModelPartNodes\n1\nEnd SubModelPartNodes\n"
        "End SubModelPart\n"
    )
    return path


def test_model_part_of_kratos(tmp_path, periodic):
    side = periodic.cell_size
    options = {"pair": LAW, "cell": (0, side[0], 0, side[1], 0, side[2]), "periodic": "xyz"}
    path = mdpa_file(tmp_path / "xDEM.mdpa", periodic)
    compare(import_packing(path, **options).network, periodic)
    with refusal("no_law"):
        import_packing(path)
    with refusal("no_spheres", "RigidFace3D3N"):
        import_packing(mdpa_file(path, periodic, "RigidFace3D3N"), **options)
    path.write_text(path.read_text().replace("NodalData RADIUS", "NodalData OTHER"))
    with refusal("no_spheres"):
        import_packing(path, **options)


def test_numbers_without_names_are_refused(tmp_path):
    path = tmp_path / "pack.spheres"
    path.write_text("0.1 0.2 0.3 0.05\n0.2 0.2 0.3 0.05\n")
    with refusal("unnamed_columns", "x y z radius"):
        import_packing(path, pair=LAW)


def test_spheres_that_just_touch_have_no_contact(tmp_path):
    """Their overlap is round-off; 0.7 + 0.1 and 0.8 differ by a bit."""
    path = tmp_path / "row.csv"
    path.write_text("x,y,z,r\n0.5,0,0,0.05\n0.6,0,0,0.05\n0.7,0,0,0.05\n0.8,0,0,0.05\n")
    with refusal("no_contacts"):
        import_packing(path, pair=LAW)


OLD_RESTART = """restart_version 3
name column
xmin 0 xmax 2 ymin 0 ymax 2 zmin 0 zmax 1.99700001
dt 1e-05 t 1 tmax 1 save_count_data 1 save_count_ene 1 save_count_stat 1 save_count_fstat 1
dim 3 gravity 0 0 0
options_fstat 1 options_data 1 options_ene 1 options_restart 1
Species 1
k 20000 disp 0 kt 5000 dispt 0 mu 0.5 rho 1.9098593 dim_particle 3
Walls 2
InfiniteWall normal 0 0 -1 position 0
numFiniteWalls 0 normal 0 0 1 position 1.99700001
Boundaries 0
Particles 2
BP 1 1 0.49900001 0 0 0 0.5 0 0 0 0 0 0 1 10 0
TSP BP 1 1 1.49800001 0 0 0 0.5 0 0 0 0 0 0 1 10 0 0
"""
"""Two spheres of 1 kg above each other between walls, overlaps of 1 mm; after MercuryDPM's
documents of 2013."""


def test_old_restart_of_mercury(tmp_path):
    """Compare two masses and three springs in a row: omega^2 = k/m and 3 k/m along z."""
    path = tmp_path / "column.restart"
    path.write_text(OLD_RESTART)
    network = modal.read(path)
    assert network.n_contacts == 3
    frequency = modal.eigenmodes(network, all=True).frequency
    for square in (20000.0, 60000.0):
        expected = np.sqrt(square) / (2 * np.pi)
        assert np.isclose(frequency, expected, rtol=1e-9).any()
    path.write_text(OLD_RESTART.replace("dim 3", "dim 2"))
    with refusal("two_dimensions"):
        modal.read(path)
    path.write_text(OLD_RESTART.rpartition("TSP")[0])
    with refusal("cut_off"):
        modal.read(path)


def test_mixed_species_of_old_restarts(tmp_path):
    """Read the law between two species from the line that ends in (mixed)."""
    text = OLD_RESTART.replace("Species 1", "Species 2")
    own = "k 20000 disp 0 kt 5000 dispt 0 mu 0.5 rho 1.9098593 dim_particle 3\n"
    other = own.replace("20000", "30000")
    mixed = own.replace("20000", "24000").replace("\n", " (mixed)\n")
    text = text.replace(own, own + other + mixed)
    path = tmp_path / "column.restart"
    path.write_text(text.replace("1 10 0 0\n", "1 10 1 0\n"))
    network = modal.read(path)
    between = ~network.with_wall
    assert network.stiffness_normal[between] == [24000.0]


def write_vtk(path, network, name="radius", kind="XMLPolyData"):
    """Write spheres by the library: points with a radius or diameter."""
    core = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints

    points = vtkPoints()
    points.SetDataTypeToDouble()
    points.SetData(numpy_to_vtk(network.position, deep=True))
    is_grid = "UnstructuredGrid" in kind
    data = core.vtkUnstructuredGrid() if is_grid else core.vtkPolyData()
    data.SetPoints(points)
    array = numpy_to_vtk(network.radius * (2 if "iam" in name else 1), deep=True)
    array.SetName(name)
    data.GetPointData().AddArray(array)
    xml = "vtkIOXML" if kind.startswith("XML") else "vtkIOLegacy"
    module = importlib.import_module(f"vtkmodules.{xml}")
    writer = getattr(module, f"vtk{kind}Writer")()
    writer.SetFileName(str(path))
    writer.SetInputData(data)
    writer.Write()


@pytest.mark.parametrize(
    ("file", "name", "kind"),
    [
        ("x.vtp", "rad", "XMLPolyData"),
        ("x.vtu", "Diameter", "XMLUnstructuredGrid"),
        ("x.vtk", "radius", "PolyData"),
        ("y.vtk", "radii", "UnstructuredGrid"),
    ],
)
def test_vtk(tmp_path, periodic, file, name, kind):
    path = tmp_path / file
    write_vtk(path, periodic, name, kind)
    side = periodic.cell_size
    cell = (0, side[0], 0, side[1], 0, side[2])
    options = {"pair": LAW, "cell": cell, "periodic": "xyz"}
    # Legacy files have nine digits or fewer, of which overlaps of some percent need few.
    compare(import_packing(path, **options).network, periodic, 1e-3)
    with refusal("no_law"):
        import_packing(path)
    write_vtk(path, periodic, "colour", kind)
    with refusal("no_spheres", "colour"):
        import_packing(path, **options)


def test_vtk_without_the_library_is_named(tmp_path, monkeypatch):
    path = tmp_path / "x.vtp"
    path.write_text('<?xml version="1.0"?>\n<VTKFile type="PolyData">\n')
    for name in ("vtkmodules", "vtkmodules.vtkIOXML"):
        monkeypatch.setitem(sys.modules, name, None)
    with refusal("not_installed", "pip install vtk"):
        import_packing(path, pair=LAW)


def test_other_packages_add_readers(tmp_path, monkeypatch):
    """Add a distribution with an entry point, as pip would have installed it."""
    (tmp_path / "my_reader.py").write_text(
        "from modal import fcc\n"
        "from modal.exchange.import_result import ImportResult\n"
        "NAME, OPTIONS = 'mine', {}\n"
        "def sniff(path, head):\n    return head.startswith(b'my own')\n"
        "def read(path):\n    return ImportResult(fcc(cells=(1, 1, 4)))\n"
    )
    information = tmp_path / "my_reader-1.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: my-reader\nVersion: 1\n")
    points = information / "entry_points.txt"
    points.write_text(f"[{registry.ENTRY_POINTS}]\nmine = my_reader\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    path = tmp_path / "x.mine"
    path.write_text("my own format\n")
    assert modal.read(path).n_particles == modal.fcc(cells=(1, 1, 4)).n_particles
    points.write_text(f"[{registry.ENTRY_POINTS}]\nmine = no_such_module\n")
    with refusal("broken_reader", "no_such_module"):
        modal.read(path)
