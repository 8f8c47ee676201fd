"""Spectra that are kept in a folder: of the very network, and a folder that takes none."""

import numpy as np
import pytest
from changes import stiffer

import analysis
from modal.packing import crystal as gallery

KEPT = ["gain"]


@pytest.fixture
def crystal():
    return gallery.fcc(cells=(1, 1, 30))


def test_networks_of_the_same_spheres_have_spectra_of_their_own(crystal, tmp_path):
    """One half of the contacts along z four times as stiff: another response, kept or not."""
    high = crystal.position[crystal.particle_i, 2] > crystal.length / 2
    uneven = stiffer(crystal, np.where(high, 4, 1), np.where(high, 4, 1))
    for network in (crystal, uneven, crystal):
        fresh = analysis.measure(network, quantities=KEPT)["gain"]
        kept = analysis.measure(network, quantities=KEPT, keep=tmp_path)["gain"]
        np.testing.assert_allclose(kept.value, fresh.value, rtol=1e-9)
    assert len(list(tmp_path.glob("*.response.h5"))) == 2


def test_a_folder_that_takes_no_file_costs_no_number(crystal, tmp_path):
    """The number is told; that it could not be kept is one more caveat."""
    (tmp_path / "file").write_text("")
    fresh = analysis.measure(crystal, quantities=KEPT)["gain"]
    told = analysis.measure(crystal, quantities=KEPT, keep=tmp_path / "file" / "folder")["gain"]
    np.testing.assert_allclose(told.value, fresh.value, rtol=1e-9)
    assert len(told.caveats) == len(fresh.caveats) + 1


def test_a_full_disk_costs_no_number(crystal, tmp_path):
    """Where the network is kept but its spectrum finds no room."""
    analysis.measure(crystal, quantities=KEPT, keep=tmp_path)
    (product,) = tmp_path.glob("*.response.h5")
    product.unlink()
    product.mkdir()  # a folder in the file's place: nothing replaces it
    fresh = analysis.measure(crystal, quantities=KEPT)["gain"]
    told = analysis.measure(crystal, quantities=KEPT, keep=tmp_path)["gain"]
    np.testing.assert_allclose(told.value, fresh.value, rtol=1e-9)
    assert len(told.caveats) == len(fresh.caveats) + 1
