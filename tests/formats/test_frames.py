"""Results as pandas, xarray and HTML: the same numbers, with their units."""

import sys

import numpy as np
import pytest
from refusals import refusal

import analysis
import modal


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(1, 1, 12))


@pytest.fixture(scope="module")
def results(crystal):
    """Return a result of each kind, by name."""
    return {
        "modes": modal.eigenmodes(crystal, lowest=3),
        "signals": modal.propagate(crystal, duration=2e-5, interval=1e-6).signals,
        "response": modal.frequency_response(crystal, highest=2e4),
        "moduli": modal.elastic_moduli(modal.fcc(cells=(2, 2, 4), periodic_z=True)),
        "measurement": analysis.measure(crystal, quantities=["coordination", "void_ratio"]),
    }


def test_frames_of_pandas(results):
    pytest.importorskip("pandas")
    modes = results["modes"].to_pandas()
    assert list(modes.index) == [1, 2, 3]
    np.testing.assert_array_equal(modes["frequency"], results["modes"].frequency)
    assert modes.attrs["units"]["frequency"] == "Hz"
    signals = results["signals"].to_pandas()
    np.testing.assert_array_equal(signals.index, results["signals"].time)
    np.testing.assert_array_equal(signals["receiver_stress"], results["signals"].receiver_stress)
    response = results["response"].to_pandas()
    np.testing.assert_array_equal(response["source_stress"], results["response"].source_stress)
    moduli = results["moduli"].to_pandas()
    assert moduli.loc["xx", "yy"] == results["moduli"].stiffness[0, 1]
    measured = results["measurement"].to_pandas()
    assert measured.loc["coordination", "value"] == results["measurement"]["coordination"].value


def test_datasets_of_xarray(results, crystal):
    pytest.importorskip("xarray")
    modes = results["modes"].to_xarray()
    assert modes["mode_shape"].dims == ("mode", "particle", "motion")
    assert modes.sizes["particle"] == crystal.n_particles
    signals = results["signals"].to_xarray()
    chain = signals["chain_displacement"]
    np.testing.assert_array_equal(chain.values, results["signals"].chain_displacement)
    assert chain.attrs["units"] == "m"
    moduli = results["moduli"].to_xarray()
    assert len(set(moduli["stiffness"].dims)) == 2
    measured = results["measurement"].to_xarray()
    assert float(measured["void_ratio"]) == results["measurement"]["void_ratio"].value


def test_absent_packages_are_named(results, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "xarray", None)
    for result in results.values():
        with refusal("not_installed", "pandas"):
            result.to_pandas()
        with refusal("not_installed", "xarray"):
            result.to_xarray()


def test_notebooks_show_a_description_as_a_table(crystal):
    description = modal.describe(crystal)
    html = description._repr_html_()
    assert html.count("<tr>") == 1 + len(description.splitlines())
    assert f"{crystal.n_particles}, diameters" in html


def test_notebooks_show_tables(results, crystal):
    long = modal.fcc(cells=(2, 2, 40))
    shown = {
        **{name: results[name] for name in ("modes", "moduli", "measurement")},
        "packing": crystal,
        "density of states": modal.density_of_states(crystal, resolution=2e4),
        "transducers": analysis.transducers(long, frequencies_hz=[1e4], radius=1.0),
    }
    for result in shown.values():
        html = result._repr_html_()
        assert html.startswith("<table>")
        assert html.count("<tr>") == html.count("</tr>") > 2
    modes = 6 * crystal.n_particles
    assert f"<td>{modes}, " in shown["density of states"]._repr_html_()
    row = shown["transducers"].rows[0]
    assert f"<td>{row.rule}</td><td>10 kHz</td>" in shown["transducers"]._repr_html_()
    value = results["measurement"]["void_ratio"]
    assert value.text() in value._repr_html_()
    moduli = results["moduli"]
    assert f"{moduli.v_p:.4g} m/s" in moduli._repr_html_()
    assert f"{results['modes'].frequency[0]:.6g}" in results["modes"]._repr_html_()
