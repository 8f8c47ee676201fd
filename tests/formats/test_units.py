"""Numbers are SI: what a file or an array says of its unit is that of the column, or refused."""

from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from refusals import refusal

import modal
from modal.packing.crystal import fcc
from modal.packing.network import read_network, write_network
from modal.tools.units import says
from modal.waves.motions import SampledMotion

CRYSTAL = fcc(cells=(1, 1, 6))
SAME = {
    "m": ["m", "metre", "Meters", "1 m", "SI", "", "none", "-"],
    "kg": ["kg", "kilograms"],
    "N/m": ["N m^-1", "N.m-1", "newton / meter", "newton per metre", "kg/s^2", "N·m⁻¹", "N/(m)"],
    "kg m^2": ["kg*m^2", "kg.m2", "kg m²", "kilogram * meter ** 2"],
    "1": ["1", "", "dimensionless", "-", "m/m"],
    "Hz": ["Hz", "1/s", "hertz"],
    "rad/s": ["rad/s", "s^-1"],
    "N m/rad": ["N m", "J/rad", "N*m/rad"],
    "kg^-1/2": ["kg^(-1/2)", "kg**-0.5", "1/kg^0.5"],
    "kg/m^3": ["kg m^-3", "kg/(m m m)"],
    "Pa": ["N/m^2", "kg/(m s^2)"],
}
OTHERS = {
    "m": "mm|um|\u00b5m|millimeter|micron|in|ft|angstrom|lj|cgs|1e-3 m|Mm|m/1000|1|%|unitless",
    "kg": "g|gram|Mg|ng|tonne|lb|t|kg/m|N",
    "N/m": "N/um|uN/m|nN/m|dyne/m|kgf/m|tonne/s^2|Nmm|kN/m|N|N m|n/m|N/(m s)^2",
    "Hz": "rad/s|kHz|1/ms|rpm",
    "rad/s": "Hz|deg/s|rad",
    "1": "%|rad|m|1e-3|100",
}


@pytest.mark.parametrize("unit", SAME)
def test_spellings_of_a_unit(unit):
    assert [text for text in SAME[unit] if not says(text, unit)] == []


@pytest.mark.parametrize("unit", OTHERS)
def test_other_units_are_none_of_its_spellings(unit):
    assert [text for text in OTHERS[unit].split("|") if says(text, unit)] == []


@pytest.mark.parametrize("attribute", ["units", "unit", "Units", "UNITS"])
@pytest.mark.parametrize("where", ["contacts/stiffness_normal", "contacts", "/"])
def test_a_file_that_says_another_unit_is_refused(attribute, where, tmp_path):
    path = tmp_path / "a.network.h5"
    write_network(path, CRYSTAL)
    for text, accepted in (("SI", "SI"), (np.bytes_(b"si"), "SI"), ("dyn/cm", None), (1e3, None)):
        with h5py.File(path, "r+") as file:
            file[where].attrs[attribute] = text
        if accepted:
            assert read_network(path).n_contacts == CRYSTAL.n_contacts
            continue
        with refusal("unit"):
            read_network(path)


class Quantity(np.ndarray):
    """An array with a unit, as astropy and unyt have them."""

    unit = "N / um"


@pytest.mark.parametrize(
    "given",
    [
        (CRYSTAL.stiffness_normal / 1e6).view(Quantity),
        SimpleNamespace(units="newton / micrometer", magnitude=CRYSTAL.stiffness_normal / 1e6),
        [row.view(Quantity) for row in CRYSTAL.stiffness_normal[:, None]],
    ],
    ids=["array", "pint", "list"],
)
def test_an_array_in_another_unit_is_refused(given):
    with refusal("unit"):
        replace(CRYSTAL, stiffness_normal=given)


def test_an_array_in_the_unit_of_the_column_is_taken():
    column = SimpleNamespace(units="newton / meter", magnitude=CRYSTAL.stiffness_normal)
    taken = replace(CRYSTAL, stiffness_normal=column)
    np.testing.assert_array_equal(taken.stiffness_normal, CRYSTAL.stiffness_normal)


def test_a_masked_number_is_refused():
    """Refuse an array with a masked number; accept a mask that hides nothing."""
    data = np.ma.masked_array(CRYSTAL.stiffness_tangential.copy())
    assert replace(CRYSTAL, stiffness_tangential=data).n_contacts == CRYSTAL.n_contacts
    data[3] = np.ma.masked
    rows = [np.ma.masked_array(row) for row in CRYSTAL.normal]
    rows[2][1] = np.ma.masked
    for column, masked in (("stiffness_tangential", data), ("normal", rows)):
        with refusal("masked"):
            replace(CRYSTAL, **{column: masked})


def test_series_of_pandas_are_plain():
    pandas = pytest.importorskip("pandas")
    taken = replace(CRYSTAL, radius=pandas.Series(CRYSTAL.radius, name="unit"))
    np.testing.assert_array_equal(taken.radius, CRYSTAL.radius)


@pytest.mark.parametrize(
    "ask",
    [
        lambda units: modal.count_modes(CRYSTAL, SimpleNamespace(units=units, magnitude=[30.0])),
        lambda units: SampledMotion(
            SimpleNamespace(units=units, magnitude=[0.0, 1.0]), np.array([0.0, 1e-9])
        ),
    ],
    ids=["frequencies", "motion"],
)
def test_other_arrays_with_units_are_refused_too(ask):
    with refusal("unit"):
        ask("kilohertz")
