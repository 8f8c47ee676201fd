"""S-waves in reports: what is of a wall that slides is called so, and no P-wave is made of it."""

from dataclasses import replace

import numpy as np
import pytest
from oracles import stepped
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
from modal.tools.errors import InputError
from modal.waves.response import frequency_response, write_response
from modal.waves.signals import write_signals

LAYERS = 100
EXACT = ShearLattice.of_crystal(FccLattice(1e5), LAYERS)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A crystal's S-wave as YADE would have recorded it, the linear one, and its moduli."""
    folder = tmp_path_factory.mktemp("products")
    network = modal.fcc(cells=(1, 1, LAYERS))
    write_network(folder / "case02.network.h5", network)
    linear = modal.propagate(network, 4e-4, direction="x", interval=5e-7).signals
    write_signals(folder / "case02.shear.signals.h5", linear)
    # A run of YADE by the study's own command: its wall slid, as WAVE_DIRECTION said.
    write_signals(folder / "case02.signals.h5", replace(linear, producer="yade"))
    write_moduli(folder / "case02.moduli.h5", modal.elastic_moduli(network))
    return folder


def test_a_run_whose_wall_slid_is_no_p_wave(made):
    m = PackingData.of(Case("case02", made))
    assert m.yade is None and m.shown is m.linear and m.linear.direction == "z"
    assert m.shear.keys() == {"yade", "linear"}
    assert kind_of(made / "case02.signals.h5") == "shear_yade.signals"
    assert kind_of(made / "case02.shear.signals.h5") == "shear.signals"
    assert kind_of(made / "case02.moduli.h5") == "moduli"


def test_numbers_of_the_crystals_s_wave(made):
    """V_S, band edge and dispersion against the closed form of its layers."""
    m = PackingData.of(Case("case02", made))
    for key in ("shear_yade", "shear_linear"):
        assert longest(m, key).value == pytest.approx(EXACT.velocity, rel=1e-3)
        edge = EXACT.branches(np.array([np.pi / EXACT.crystal.layer_distance]))[0, 0]
        assert chain(m, key).low_pass_frequency == pytest.approx(edge / (2 * np.pi), rel=5e-3)
        kappa = np.linspace(0.01, 0.8, 80) * np.pi / EXACT.crystal.layer_distance
        assert chain(m, key).omega(kappa) == pytest.approx(EXACT.branches(kappa)[0], rel=5e-3)
        # As of P-waves: the gain is largest where the source end is free, a quarter of a wave.
        passed = EXACT.velocity / m.network.length
        how = {"resolution": 0.2 * passed, "highest": 9 * passed}
        found = frequency_response(m.network, direction="x", **how)
        first = EXACT.velocity / (4 * m.network.length)
        assert found.gain_maxima()[0] == pytest.approx(first, rel=0.05)
        # First peaks lag behind the front: near V_S.
        assert first_peak(m, key).value == pytest.approx(EXACT.velocity, rel=0.05)


def test_result_has_what_slides_and_the_moduli(made):
    row = measured("case02", made)
    for name in ("v_s_moduli", "v_s_long_waves_linear", "v_s_long_waves_yade"):
        assert row.value(f"{name}_m_per_s") == pytest.approx(EXACT.velocity, rel=1e-3)
    # No P-wave is YADE's: there was no run of a wall that pushes.
    assert np.isnan(row.value("v_p_long_waves_yade_m_per_s"))
    assert row.value("v_p_long_waves_linear_m_per_s") > EXACT.velocity


def test_agreement_of_a_run_whose_wall_slides(made):
    """The linear wave beside it slides along the same direction."""
    network = modal.fcc(cells=(1, 1, 30))
    run = stepped(network, 1e-4, 1e-7, every=5, direction="x", particles=True)
    pair = Agreement(network, replace(run, producer="yade", time_step=1e-7))
    found, linear = pair.measured(pair.run), pair.linear("none")
    assert relative(found["chain"], linear["chain"]) < 1e-9


def test_a_response_that_is_not_the_reports_is_refused(made, tmp_path):
    network = modal.fcc(cells=(1, 1, 20))
    write_network(tmp_path / "a.network.h5", network)
    write_response(
        tmp_path / "a.response.h5", frequency_response(network, highest=2e4, direction="x")
    )
    with pytest.raises(InputError) as refused:
        _ = Case("a", tmp_path).read("response")
    assert refused.value.code == "other_response"
