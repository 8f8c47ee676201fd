"""A plane that opens inside a cell without walls: a ring of layers in closed form, and symmetry."""

import h5py
import numpy as np
import pytest
from packings import polydisperse
from refusals import refusal
from scipy.linalg import eigh
from shear_lattice import driven_by_pulse

import modal
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.theory.fcc import FccLattice
from modal.waves.motions import Pulse
from modal.waves.oscillator import oscillation
from modal.waves.signals import read_signals
from modal.waves.sources import MovingSource, Plane, PushingSource

CRYSTAL = FccLattice(1e5)
LAYERS = 40


def from_plane(network, duration, height, **settings):
    settings = {"motion": Pulse(2.5e-9, 1e5), "particles": True} | settings
    return modal.propagate(network, duration, source=Plane(height), **settings)


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(1, 1, LAYERS), periodic_z=True)


@pytest.mark.parametrize("above", [0, 7, 39])
def test_p_wave_against_a_ring_of_layers(crystal, above):
    """Compare with a ring of layers, m u_j'' = C (u_j+1 - 2 u_j + u_j-1).

    C d(t) pushes the two layers of one spring apart.
    """
    height = (above + 1) * CRYSTAL.layer_distance if above < LAYERS - 1 else 0.0
    signals = from_plane(crystal, 1.2e-4, height, tolerance=1e-12).signals
    ring = 2 * np.eye(LAYERS) - np.roll(np.eye(LAYERS), 1, 0) - np.roll(np.eye(LAYERS), -1, 0)
    square, shape = eigh(ring * CRYSTAL.C / CRYSTAL.mass)
    push = np.zeros(LAYERS)
    push[above] = -1
    push[(above + 1) % LAYERS] = 1
    force = 2.5e-9 * CRYSTAL.C / CRYSTAL.mass * push @ shape
    omega = np.sqrt(np.maximum(square, 0))
    omega[0] = omega[1] * 1e-4  # the layers as a whole, which nothing pushes
    exact = (force * driven_by_pulse(signals.time, omega, 1e5)) @ shape.T
    assert signals.particle_displacement == pytest.approx(exact, abs=1e-9 * abs(exact).max())
    rough = from_plane(crystal, 1.2e-4, height, tolerance=1e-3)
    deviation = abs(rough.signals.particle_displacement - exact).max()
    assert 0 < deviation <= rough.truncation * abs(exact).max()
    assert rough.truncation <= 1e-3
    # Two equal waves, up and down; the mass as a whole stays where it is.
    up = np.roll(signals.particle_displacement, -above - 1, axis=1)
    assert up == pytest.approx(-up[:, ::-1], abs=1e-9 * abs(exact).max())


@pytest.mark.parametrize("direction", ["x", "z"])
def test_wave_in_a_random_cell_is_that_of_its_dense_modes(direction):
    """Compare with dense modes; planes between two images of spheres are counted one by one.

    The radii are 1:3.
    """
    cell = polydisperse(periodic_z=True, n=30)
    axis = "xyz".index(direction)
    height = 0.3 * cell.length
    push = np.zeros((cell.n_particles, 6))
    for contact in range(cell.n_contacts):
        i = cell.particle_i[contact]
        j = cell.particle_j[contact]
        n = cell.normal[contact]
        below, above = cell.position[[i, j], 2] + [0, cell.cell_shift[contact, 2] * cell.length]
        planes = height + np.arange(-3, 4) * cell.length
        crossed = ((below < planes) & (planes <= above)).sum()
        crossed -= ((above < planes) & (planes <= below)).sum()
        opening = crossed * np.eye(3)[axis]
        along = n * (n @ opening)
        kt = cell.stiffness_tangential[contact]
        force = cell.stiffness_normal[contact] * along + kt * (opening - along)
        push[i] -= [*force, *np.cross(cell.lever_i[contact], force)]
        push[j] += [*force, *np.cross(cell.lever_j[contact], force)]
    square, shape = eigh(stiffness_matrix(cell).toarray(), np.diag(mass_diagonal(cell)))
    signals = from_plane(cell, 2e-5, height, direction=direction).signals
    motion = (shape.T @ push.ravel())[:, None] * oscillation(Pulse(), square.clip(0), signals.time)
    expected = (shape[axis::6] @ motion).T
    assert signals.particle_displacement == pytest.approx(expected, abs=1e-7 * abs(expected).max())


def test_file_of_before_is_read(crystal, tmp_path):
    """Read a file of the schema "granular-plane-wave", version 1, as it was written."""
    signals = from_plane(crystal, 2e-5, 0.01).signals
    path = tmp_path / "old.plane.h5"
    with h5py.File(path, "w") as file:
        file.attrs.update(schema="granular-plane-wave", schema_version=1, direction="z")
        file.attrs.update(height=0.01, products=7, truncation=1e-10, network_sha256="ab")
        file["time"] = signals.time
        file["source/displacement"] = signals.source_displacement
        file["layers/position"] = signals.layer_position
        file["layers/displacement"] = signals.layer_displacement
    read = read_signals(path, of_any_source=True)
    assert (read.layer_displacement == signals.layer_displacement).all()
    assert read.source == "plane at 0.01 m"
    with refusal("schema", "granular-plane-wave"):
        read_signals(path)
    with h5py.File(path, "r+") as file:
        del file.attrs["height"]
    with refusal("incomplete", "old.plane.h5"):
        read_signals(path, of_any_source=True)


@pytest.mark.parametrize("kind", [MovingSource, PushingSource])
def test_source_that_lacks_a_method_cannot_be_made(kind):
    """Refuse a source that lacks a method, instead of returning None from it."""

    class Incomplete(kind):
        name = "incomplete"

    with pytest.raises(TypeError):
        Incomplete()


def test_source_of_three_methods_sends_a_wave():
    """Define a new source as one class: the plane in the middle of any cell."""

    class Middle(MovingSource):
        name = "middle"

        def height_in(self, network):
            return network.wall_position.mean(keepdims=True)

        def imposed(self, network, direction):
            return Plane(*self.height_in(network)).imposed(network, direction)

        def carried(self, position):
            return np.flatnonzero(position[:, 2] < position[:, 2].mean())

    cell = modal.fcc(cells=(1, 1, 12), periodic_z=True)
    signals = modal.propagate(cell, 2e-5, source=Middle()).signals
    plane = modal.propagate(cell, 2e-5, source=Plane(cell.wall_position.mean())).signals
    assert signals.source == "middle"
    assert np.array_equal(signals.layer_displacement, plane.layer_displacement)
