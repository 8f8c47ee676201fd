"""Pictures: VTK and extended XYZ, read back."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import packings
import pytest

import modal
from modal.__main__ import main
from modal.exchange.picture import contact_lines, sphere_stress, write_xyz
from modal.modes.mode_set import read_modes
from modal.packing.network import write_network
from modal.packing.state import contacts_per_particle, stress_tensor
from modal.waves.signals import read_signals


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    """Write a packing of radii 1:3 between walls, and its modes; return it and the folder."""
    folder = tmp_path_factory.mktemp("pictures")
    network = packings.polydisperse(False)
    write_network(folder / "p.network.h5", network)
    name = str(folder / "p.network.h5")
    assert main(["modes", name, "--highest", "3", "-o", str(folder / "p.modes.h5")]) == 0
    return network, folder


def exported(folder, *arguments) -> None:
    assert main(["export", str(folder / "p.network.h5"), *map(str, arguments)]) == 0


def read_frames(path) -> list[tuple[float, dict[str, np.ndarray]]]:
    """Return the frames of extended XYZ: times, s, and columns (n,) or (n, k) by their names."""
    lines = path.read_text().splitlines()
    frames = []
    count = int(lines[0])
    for start in range(0, len(lines), count + 2):
        words = lines[start + 1].rsplit("Properties=", 1)[1].split(":")
        time = float(lines[start + 1].split("Time=")[1].split()[0])
        ends = 1 + np.cumsum([int(width) for width in words[5::3]])
        rows = np.array([row.split() for row in lines[start + 2 : start + 2 + count]])
        table = np.split(rows[:, 1 : ends[-1]].astype(float), ends[:-1] - 1, axis=1)
        columns = (part[:, 0] if part.shape[1] == 1 else part for part in table)
        frames.append((time, dict(zip(words[3::3], columns, strict=True))))
    return frames


def named(path, name: str) -> np.ndarray:
    """Return the numbers of a key in the second line of the first frame."""
    numbers = re.search(rf'{name}="([^"]*)"', path.read_text().splitlines()[1])[1]
    return np.array([float(word) for word in numbers.split()])


def read_vtk(path) -> tuple[np.ndarray, dict, np.ndarray, dict]:
    """Return the points, their fields, the cells and their fields."""
    meshio = pytest.importorskip("meshio")
    mesh = meshio.read(path)
    cells = {name: data[0] for name, data in mesh.cell_data.items()}
    return mesh.points, mesh.point_data, mesh.cells[0].data.ravel(), cells


def test_packing_and_modes_in_vtk_read_back_equal(packing):
    """Compare every float64 to its last bit: VTK's files are binary."""
    pytest.importorskip("meshio")
    network, folder = packing
    exported(folder, folder / "p.modes.h5", "-o", folder / "m.vtu")
    points, fields, _, _ = read_vtk(folder / "m.vtu")
    np.testing.assert_array_equal(points, network.position)
    np.testing.assert_array_equal(fields["radius"], network.radius)
    np.testing.assert_array_equal(fields["contacts"], contacts_per_particle(network))
    np.testing.assert_array_equal(fields["stress"], sphere_stress(network))
    modes = read_modes(folder / "p.modes.h5")
    for k, frequency in enumerate(modes.frequency, 1):
        shape = fields[f"mode_{k}_{frequency:.6g}_Hz"]
        np.testing.assert_array_equal(shape, modes.mode_shape[k - 1, :, :3])
    points, _, cells, fields = read_vtk(folder / "m.contacts.vtu")
    ends = points[cells].reshape(-1, 2, 3)
    # Lines lead through the periods: they are as long as the branches, never as the cell.
    np.testing.assert_array_equal(ends, contact_lines(network)[0])
    np.testing.assert_allclose(ends[:, 1] - ends[:, 0], network.branch, atol=1e-17)
    np.testing.assert_array_equal(fields["force_normal"], network.force_normal)
    on_i = network.force_tangential - network.force_normal[:, None] * network.normal
    np.testing.assert_array_equal(fields["force"], on_i)


def test_packing_in_extended_xyz_reads_back_equal(packing, tmp_path):
    """Compare every float64, which 17 digits hold. The cell contains all centres.

    From 0 as this program has it; from the least centre where another one began elsewhere.
    """
    network, folder = packing
    exported(folder, "-o", folder / "p.xyz")
    ((time, columns),) = read_frames(folder / "p.xyz")
    assert time == 0
    np.testing.assert_array_equal(columns["pos"], network.position)
    np.testing.assert_array_equal(columns["radius"], network.radius)
    np.testing.assert_array_equal(columns["stress"], sphere_stress(network))
    assert 'pbc="T T F"' in (folder / "p.xyz").read_text().splitlines()[1]
    corner = [0, 0, network.wall_position[0]]
    np.testing.assert_array_equal(named(folder / "p.xyz", "Origin"), corner)
    lattice = np.diag(network.cell_size)
    np.testing.assert_array_equal(named(folder / "p.xyz", "Lattice").reshape(3, 3), lattice)
    shifted = replace(network, position=network.position - [0.1, 0.2, 0])
    bare = network.unchecked(cell_size=np.zeros(3), cell_periodic=np.zeros(3, bool))
    for name, written in (("away", shifted), ("bare", bare)):
        frames = [(0.0, written.position, {})]
        write_xyz(tmp_path / f"{name}.xyz", written, frames, series=False)
        low = named(tmp_path / f"{name}.xyz", "Origin")
        high = low + named(tmp_path / f"{name}.xyz", "Lattice").reshape(3, 3).diagonal()
        assert (low <= written.position).all()
        assert (written.position <= high).all()


@pytest.mark.parametrize("axis", ["y", "z"])
def test_wave_becomes_frames_at_its_times(packing, axis, capsys):
    """Compare displacements in frames with the record; positions have --scale times of them."""
    network, folder = packing
    product = folder / f"{axis}.signals.h5"
    wave = ["wave", str(folder / "p.network.h5"), "--duration", "2e-5", "--particles"]
    assert main([*wave, "--direction", axis, "-o", str(product)]) == 0
    signals = read_signals(product)
    arguments = (product, "--frames", 5, "--scale", 1e4)
    exported(folder, *arguments, "-o", folder / "w.xyz")
    frames = read_frames(folder / "w.xyz")
    assert 4 <= len(frames) <= 5
    for time, columns in frames:
        (k,) = np.flatnonzero(signals.time == time)
        displacement = columns["displacement"]
        np.testing.assert_array_equal(
            displacement[:, "xyz".index(axis)], signals.particle_displacement[k]
        )
        assert np.count_nonzero(displacement.any(axis=0)) == (time > 0)
        np.testing.assert_allclose(
            columns["pos"] - network.position, 1e4 * displacement, atol=1e-17
        )
    pytest.importorskip("meshio")
    capsys.readouterr()
    exported(folder, *arguments, "--json", "-o", folder / "w.vtu")
    written = json.loads(capsys.readouterr().out)["written"]
    assert {*written} == {*map(str, folder.glob("w*.vtu")), str(folder / "w.pvd")}
    listed = ElementTree.parse(folder / "w.pvd").iter("DataSet")
    for (time, columns), entry in zip(frames, listed, strict=True):
        assert float(entry.get("timestep")) == time
        points, fields, _, _ = read_vtk(folder / entry.get("file"))
        np.testing.assert_array_equal(points, columns["pos"])
        np.testing.assert_array_equal(fields["displacement"], columns["displacement"])


def test_frames_of_a_mode_are_one_period(packing):
    """Check that displacements change sign in half a period; the largest is half a radius."""
    network, folder = packing
    arguments = (folder / "p.modes.h5", "--modes", 2, "--frames", 4)
    exported(folder, *arguments, "-o", folder / "a.xyz")
    frames = read_frames(folder / "a.xyz")
    frequency = read_modes(folder / "p.modes.h5").frequency[1]
    np.testing.assert_allclose([time * frequency for time, _ in frames], [0, 0.25, 0.5, 0.75])
    first, third = (columns["pos"] - network.position for _, columns in frames[::2])
    np.testing.assert_allclose(first, -third, atol=1e-16)
    largest = np.linalg.norm(first, axis=1).max()
    np.testing.assert_allclose(largest, network.radius.mean() / 2, rtol=1e-9)


def test_stresses_of_spheres_add_up_to_that_of_the_packing():
    """Compare the sum with the packing's stress: two levers to one point make a branch."""
    network = packings.polydisperse(True)
    volume = 4 / 3 * np.pi * network.radius**3
    total = (volume[:, None] * sphere_stress(network)).sum(axis=0) / network.cell_size.prod()
    mean = stress_tensor(network)
    mean = (mean + mean.T) / 2
    expected = mean[(0, 1, 2, 1, 2, 0), (0, 1, 2, 2, 0, 1)]
    np.testing.assert_allclose(total, expected, atol=1e-12 * np.trace(mean))


@pytest.mark.parametrize(
    ("arguments", "code", "name"),
    [
        (("p.modes.h5", "--modes", "9", "-o", "p.xyz"), "no_such_mode", "--modes 9"),
        (("p.modes.h5", "--frames", "4", "-o", "p.xyz"), "frames", "--frames"),
        (("p.modes.h5", "--frames", "0", "-o", "p.xyz"), "frames", "--frames 0"),
        (("--frames", "4", "-o", "p.xyz"), "no_product", "--frames"),
        (("other.modes.h5", "-o", "p.xyz"), "other_packing", "other.network.h5"),
    ],
    ids=["no such mode", "several modes", "no frames", "nothing to animate", "other packing"],
)
def test_export_refuses_in_one_line(packing, one_line, monkeypatch, arguments, code, name):
    _, folder = packing
    monkeypatch.chdir(folder)
    write_network("other.network.h5", modal.fcc(cells=(2, 2, 4)))
    main(["modes", "other.network.h5", "--highest", "1", "-o", "other.modes.h5"])
    one_line(main, ["export", "p.network.h5", *arguments], name, code=code)
