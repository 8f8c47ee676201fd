"""Networks out again: tables that `import` reads, matrices that scipy reads."""

from dataclasses import replace

import numpy as np
import packings
import program_files
import pytest
import scipy.io
import scipy.linalg
import scipy.sparse as sp

import modal
from modal.cli.main import main

COLUMNS = (
    "particle_i particle_j normal stiffness_normal stiffness_tangential force_normal "
    "force_tangential sliding lever_i"
)


@pytest.fixture(scope="module", params=[False, True], ids=["walls", "periodic"])
def network(request):
    packing = packings.polydisperse(request.param)
    # Tables do not tell where the contact point lies in the overlap: it is in the middle.
    middle = packing.overlap[:, None] / 2
    radius_j = np.where(packing.with_wall, middle[:, 0], packing.radius[packing.partner])
    return replace(
        packing,
        lever_i=(packing.radius[packing.particle_i][:, None] - middle) * packing.normal,
        lever_j=(middle - radius_j[:, None]) * packing.normal,
    )


@pytest.fixture
def exported(network, tmp_path):
    """Return a function that exports to a name and returns the path."""
    modal.write(tmp_path / "mine.network.h5", network)

    def export(name):
        path = tmp_path / name
        assert main(["export", str(tmp_path / "mine.network.h5"), "-o", str(path)]) == 0
        return path

    return export


def test_tables_give_the_network_back(network, exported):
    contacts = exported("x.csv")
    again = modal.read(contacts.with_name("x.spheres.csv"), contacts=contacts)
    program_files.assert_same_contacts(again, network, COLUMNS, 1e-12)
    np.testing.assert_array_equal(again.mass, network.mass)
    np.testing.assert_allclose(again.cell_size, network.cell_size, rtol=1e-14)
    np.testing.assert_array_equal(again.cell_periodic, network.cell_periodic)


@pytest.mark.parametrize("ending", ["npz", "mtx"])
def test_eigenvalues_of_the_written_matrices(network, exported, ending):
    path = exported(f"x.{ending}")
    load = sp.load_npz if ending == "npz" else scipy.io.mmread
    stiffness = load(path).toarray()
    mass = load(path.with_name(f"x.mass.{ending}")).toarray()
    square = scipy.linalg.eigvalsh(stiffness, mass)[-20:]
    expected = modal.eigenmodes(network, highest=20).frequency
    np.testing.assert_allclose(np.sqrt(square) / (2 * np.pi), expected, rtol=1e-9)


def test_held_spheres_leave_the_matrices(network):
    """Leave out rows of motions that spheres cannot make, as in a matrix by hand."""
    fixed = np.zeros((network.n_particles, 6), bool)
    fixed[3] = True
    fixed[5, 2] = True
    rows = np.flatnonzero(~fixed.ravel())
    held = replace(network, fixed=fixed)
    for make in (modal.stiffness_matrix, modal.mass_matrix):
        all_rows = make(held, held=True).toarray()
        np.testing.assert_array_equal(all_rows, make(network).toarray())
        np.testing.assert_array_equal(make(held).toarray(), all_rows[np.ix_(rows, rows)])


def test_mass_scaled_matrix(network):
    scaled = modal.stiffness_matrix(network, mass_scaled=True).toarray()
    plain = modal.stiffness_matrix(network).toarray()
    root = np.sqrt(modal.mass_matrix(network).diagonal())
    np.testing.assert_allclose(scaled, plain / root[:, None] / root, atol=1e-12 * scaled.max())


def test_matrices_of_translations_are_blocks_of_the_whole(network):
    rows = np.arange(6 * network.n_particles).reshape(-1, 6)[:, :3].ravel()
    for make in (modal.stiffness_matrix, modal.mass_matrix):
        matrix = make(network).toarray()
        translations = make(network, translations_only=True).toarray()
        np.testing.assert_allclose(translations, matrix[np.ix_(rows, rows)], rtol=1e-12)


def test_mass_matrix_of_clumps_has_their_tensors(network):
    tensor = np.zeros((network.n_particles, 3, 3))
    tensor[:] = np.diag([1.0, 2.0, 3.0])
    tensor *= network.inertia[:, None, None] / 2
    clumps = replace(network, inertia_tensor=tensor)
    mass = modal.mass_matrix(clumps).toarray()
    np.testing.assert_array_equal(mass[9:12, 9:12], tensor[1])
    np.testing.assert_array_equal(np.diag(mass)[6:9], clumps.mass[1])


def test_what_holds_no_motion_takes_no_modes(network, exported, tmp_path, capsys):
    modes = tmp_path / "x.modes.h5"
    mine = str(tmp_path / "mine.network.h5")
    exported("y.csv")
    assert main(["modes", mine, "--highest", "2", "-o", str(modes)]) == 0
    assert main(["export", mine, str(modes), "-o", str(tmp_path / "x.csv"), "--json"]) == 2
    assert '"no_picture"' in capsys.readouterr().out
