"""Spectra stored in a folder: each belongs to its network; some folders take no file."""

import numpy as np
import pytest
from changes import stiffer

import analysis
from analysis.spectra_cache import as_read
from modal.formats.provenance import read_provenance
from modal.modes.density import density_of_states
from modal.packing import crystal as gallery


@pytest.fixture
def crystal():
    """Return a column of 30 layers."""
    return gallery.fcc(cells=(1, 1, 30))


def measure_gain(network, keep=None):
    """Measure the gain; store its spectrum in the folder `keep`."""
    return analysis.measure(network, quantities=["gain"], keep=keep)["gain"]


def test_networks_of_the_same_spheres_have_spectra_of_their_own(crystal, tmp_path):
    """Make half of the contacts four times as stiff: the response differs, stored or not."""
    in_upper_half = crystal.position[crystal.particle_i, 2] > crystal.length / 2
    factor = np.where(in_upper_half, 4, 1)
    uneven = stiffer(crystal, factor, factor)
    for network in (crystal, uneven, crystal):
        # A file keeps doubles: only the order of sums may differ.
        np.testing.assert_allclose(
            measure_gain(network, tmp_path).value, measure_gain(network).value, rtol=1e-9
        )
    assert len(list(tmp_path.glob("*.response.h5"))) == 2


@pytest.fixture(params=["no folder", "full disk"])
def unwritable(request, crystal, tmp_path):
    """Return a folder that takes no file: its name is that of a file, or its disk is full."""
    if request.param == "no folder":
        (tmp_path / "file").write_text("")
        return tmp_path / "file" / "folder"
    measure_gain(crystal, tmp_path)
    (product,) = tmp_path.glob("*.response.h5")
    product.unlink()
    # A folder in the file's place, which no file replaces.
    product.mkdir()
    return tmp_path


def test_a_folder_that_takes_no_file_adds_a_caveat(crystal, unwritable):
    """Measure the number; add a caveat that it could not be stored."""
    fresh = measure_gain(crystal)
    value = measure_gain(crystal, unwritable)
    np.testing.assert_allclose(value.value, fresh.value, rtol=1e-9)
    assert value.codes == [*fresh.codes, "not_kept"]


def test_every_quantity_of_a_spectrum_has_the_caveat(crystal, unwritable):
    """Add the caveat to all quantities of the spectrum, and to those of no other."""
    names = ["gain", "gain_maximum", "gain_resolution", "void_ratio"]
    values = analysis.measure(crystal, quantities=names, keep=unwritable)
    with_caveat = [name for name, value in values.items() if "not_kept" in value.codes]
    assert with_caveat == ["gain", "gain_maximum", "gain_resolution"]


def test_a_density_that_is_not_stored_is_that_of_all_motions(crystal):
    """Compare its integral with the number of modes, six a sphere."""
    grid, density, count = as_read("density", density_of_states(crystal))
    assert count[-1] == pytest.approx(6 * crystal.n_particles, rel=1e-6)
    integral = np.trapezoid(density, grid) + count[0]
    # The grid has steps as wide as the kernel: sums over it have an error of 2 %.
    assert integral == pytest.approx(count[-1], rel=0.02)


def test_a_stored_response_is_without_pre_stress_as_that_of_the_command(crystal, tmp_path):
    measure_gain(crystal, tmp_path)
    (product,) = tmp_path.glob("*.response.h5")
    assert read_provenance(product).settings["pre_stress"] == "none"
