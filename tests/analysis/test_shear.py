"""S-waves in reports: what is of a wall that slides is called so, and no P-wave is made of it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from packings import stepped
from shear_lattice import ShearLattice

import modal
from analysis.__main__ import main
from analysis.agreement import Agreement, relative
from analysis.belonging import kind_of
from analysis.case import Case
from analysis.measures import Measures
from analysis.rows import row_of
from analysis.study.elasticity import add_elasticity, table_of_elasticity
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
    case = Case("case02", made)
    assert case.signals is None and case.record is case.wave and case.wave.direction == "z"
    assert [record.producer for record in case.shear] == ["yade", "linear"]
    assert kind_of(made / "case02.signals.h5") == "shear_yade.signals"
    assert kind_of(made / "case02.shear.signals.h5") == "shear.signals"
    assert kind_of(made / "case02.moduli.h5") == "moduli"


def test_numbers_of_the_crystals_s_wave(made):
    """V_S, band edge and dispersion against the closed form of its layers."""
    m = Measures(Case("case02", made))
    for wave in m.shear:
        assert wave.long_wave.value == pytest.approx(EXACT.velocity, rel=1e-3)
        edge = EXACT.branches(np.array([np.pi / EXACT.crystal.layer_distance]))[0, 0]
        assert wave.band_edge == pytest.approx(edge / (2 * np.pi), rel=5e-3)
        kappa, f = wave.dispersion
        low = slice(0, 80)
        branch = EXACT.branches(kappa[low])[0] / (2 * np.pi)
        assert f[low] == pytest.approx(branch, rel=5e-3)
        # As of P-waves: the gain is largest where the source end is free, a quarter of a wave.
        first = wave.gain.first_maximum()[0]
        assert first == pytest.approx(EXACT.velocity / (4 * m.case.network.length), rel=0.05)
        # First peaks lag behind the front, arrivals run ahead of the peak: both near V_S.
        for found in (wave.first_peak, wave.arrival):
            assert found.value == pytest.approx(EXACT.velocity, rel=0.05)


def test_report_names_what_slides(made, tmp_path, capsys):
    names = ("network", "shear.signals", "signals", "moduli")
    files = [str(made / f"case02.{name}.h5") for name in names]
    assert main(["report", *files, "-o", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    table = (tmp_path / "shear.csv").read_text()
    assert re.search(r"record by,YADE,linear wave\n", table)
    assert re.search(rf"V_S of the moduli.*,{EXACT.velocity:.4g},{EXACT.velocity:.4g}\n", table)
    # No P-wave's row of Table 1 has YADE in it: there was no run of a wall that pushes.
    first = (tmp_path / "table1.csv").read_text()
    assert "YADE" not in first and "V_P long waves, linear wave" in first
    assert "V_S" not in first and "S-waves: the source wall slides" in said
    assert (tmp_path / "shear_waves.png").is_file()
    figure = (tmp_path / "shear_waves.csv").read_text()
    assert "u_x" in figure and "long-wave $V_S$" in figure and "u_z" not in figure
    velocity = re.search(r'^"V_S long waves, m/s",([^,]*),', table, re.MULTILINE)
    assert float(velocity[1]) == pytest.approx(EXACT.velocity, rel=1e-3)


def test_study_has_a_section_where_the_products_are(made):
    m = Measures(Case("case02", made))
    row = row_of(m)
    add_elasticity(row, m)
    table = table_of_elasticity([row])
    found = dict(zip(table.header, table.rows[0], strict=True))
    for name in (
        "V_S moduli, m/s",
        "V_S long waves, linear wave, m/s",
        "V_S long waves, YADE, m/s",
    ):
        assert float(found[name]) == pytest.approx(EXACT.velocity, rel=1e-3)
    assert not table_of_elasticity([replace(row, values={})]).rows


def test_agreement_of_a_run_whose_wall_slides(made):
    """The linear wave beside it slides along the same direction."""
    network = modal.fcc(cells=(1, 1, 30))
    run = stepped(network, 1e-4, 1e-7, every=5, direction="x", particles=True)
    pair = Agreement(network, replace(run, producer="yade", time_step=1e-7))
    found, linear = pair.measured(pair.run), pair.linear("none")
    assert relative(found.chain, linear.chain) < 1e-9


def test_a_response_that_is_not_the_reports_is_refused(made, tmp_path):
    network = modal.fcc(cells=(1, 1, 20))
    write_network(tmp_path / "a.network.h5", network)
    write_response(
        tmp_path / "a.response.h5", frequency_response(network, highest=2e4, direction="x")
    )
    with pytest.raises(InputError, match="of an S-wave, which the report's gain is not"):
        _ = Case("a", tmp_path).response
