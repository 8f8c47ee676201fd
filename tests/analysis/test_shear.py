"""S-waves in reports: a wall that slides sends an S-wave, of which no P-wave is made."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_crystal import coarse_gain
from oracles import stepped
from refusals import refusal
from shear_lattice import ShearLattice
from study_folder import measured

import modal
from analysis.agreement import Agreement, relative
from analysis.case import Case, kind_of
from analysis.packing_data import PackingData
from analysis.quantities.velocity import chain, first_peak, longest
from modal.elasticity.moduli import write_moduli
from modal.packing.network import write_network
from modal.theory.fcc import FccLattice
from modal.waves.response import frequency_response, write_response
from modal.waves.signals import write_signals

LAYERS = 100
LATTICE = ShearLattice.of_crystal(FccLattice(1e5), LAYERS)
"""The closed form of the crystal's S-waves."""


@pytest.fixture(scope="module")
def products(tmp_path_factory) -> Path:
    """Return a crystal's S-wave as YADE would have recorded it, the linear one, and its moduli."""
    folder = tmp_path_factory.mktemp("products")
    network = modal.fcc(cells=(1, 1, LAYERS))
    write_network(folder / "case02.network.h5", network)
    write_response(folder / "case02.response.h5", coarse_gain(network))
    linear = modal.propagate(network, 4e-4, direction="x", interval=5e-7).signals
    write_signals(folder / "case02.shear.signals.h5", linear)
    # The study's own command writes this name also for a wall that slides (WAVE_DIRECTION).
    write_signals(folder / "case02.signals.h5", replace(linear, producer="yade"))
    write_moduli(folder / "case02.moduli.h5", modal.elastic_moduli(network))
    return folder


@pytest.fixture(scope="module")
def packing(products) -> PackingData:
    """Return the crystal with its files."""
    return PackingData.of(Case("case02", products))


def test_run_whose_wall_slides_is_no_p_wave(packing):
    assert packing.yade is None
    assert packing.shown is packing.linear
    assert packing.linear.direction == "z"
    assert packing.shear.keys() == {"yade", "linear"}


@pytest.mark.parametrize(
    ("file", "kind"),
    [
        ("case02.signals.h5", "shear_yade.signals"),
        ("case02.shear.signals.h5", "shear.signals"),
        ("case02.moduli.h5", "moduli"),
    ],
)
def test_kind_of_a_file_follows_from_its_contents(file, kind, products):
    assert kind_of(products / file) == kind


PRODUCERS = pytest.mark.parametrize("producer", ["shear_yade", "shear_linear"])


@PRODUCERS
def test_velocity_of_long_s_waves_is_that_of_the_lattice(producer, packing):
    assert longest(packing, producer).value == pytest.approx(LATTICE.velocity, rel=1e-3)


@PRODUCERS
def test_band_edge_of_s_waves_is_that_of_the_lattice(producer, packing):
    edge = LATTICE.branches(np.array([np.pi / LATTICE.crystal.layer_distance]))[0, 0]
    low_pass = chain(packing, producer).low_pass_frequency
    assert low_pass == pytest.approx(edge / (2 * np.pi), rel=5e-3)


@PRODUCERS
def test_dispersion_of_s_waves_is_that_of_the_lattice(producer, packing):
    wavenumber = np.linspace(0.01, 0.8, 80) * np.pi / LATTICE.crystal.layer_distance
    omega = chain(packing, producer).omega(wavenumber)
    assert omega == pytest.approx(LATTICE.branches(wavenumber)[0], rel=5e-3)


@PRODUCERS
def test_first_peaks_of_s_waves_lag_behind_the_front(producer, packing):
    assert first_peak(packing, producer).value == pytest.approx(LATTICE.velocity, rel=0.05)


def test_gain_of_s_waves_is_largest_at_a_quarter_of_a_wave(packing):
    """Find the maximum where the source end is free, as with P-waves."""
    passage_frequency = LATTICE.velocity / packing.network.length
    response = frequency_response(
        packing.network,
        direction="x",
        resolution=0.2 * passage_frequency,
        highest=9 * passage_frequency,
    )
    assert response.gain_maxima()[0] == pytest.approx(passage_frequency / 4, rel=0.05)


def test_result_has_velocities_of_s_waves_and_by_the_moduli(products):
    result = measured("case02", products)
    for name in ("v_s_moduli", "v_s_long_waves_linear", "v_s_long_waves_yade"):
        assert result.value(f"{name}_m_per_s") == pytest.approx(LATTICE.velocity, rel=1e-3)
    # There was no run of a wall that pushes.
    assert np.isnan(result.value("v_p_long_waves_yade_m_per_s"))
    assert result.value("v_p_long_waves_linear_m_per_s") > LATTICE.velocity


def test_run_whose_wall_slides_is_compared_with_a_linear_s_wave():
    network = modal.fcc(cells=(1, 1, 30))
    run = stepped(network, 1e-4, 1e-7, every=5, direction="x", particles=True)
    agreement = Agreement(network, replace(run, producer="yade", time_step=1e-7))
    measured_run = agreement.measured(agreement.run)
    linear = agreement.linear("none")
    assert relative(measured_run["chain"], linear["chain"]) < 1e-9


def test_response_of_an_s_wave_is_not_the_gain_of_reports(tmp_path):
    network = modal.fcc(cells=(1, 1, 20))
    write_network(tmp_path / "a.network.h5", network)
    response = frequency_response(network, highest=2e4, direction="x")
    write_response(tmp_path / "a.response.h5", response)
    with refusal("other_response"):
        Case("a", tmp_path).read("response")
