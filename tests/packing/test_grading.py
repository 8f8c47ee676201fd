"""Tests of grading curves: closed forms, a round trip, refusals."""

import numpy as np
import pytest
from refusals import refusal

import modal
from modal.packing.grading import finer_diameters, radii_of_curve, read_grading
from modal.packing.summary import summary
from modal.preparation.sizes import draw_radii


def test_diameters_of_a_log_normal_mixture_are_those_of_its_moments():
    """Weigh by mass: the median of ln d is higher by three variances, its spread is the same."""
    spread = 0.25
    radii = draw_radii(20_000, ("lognormal", spread), seed=1)
    diameter = 2 * radii
    finer = finer_diameters(diameter, radii**3, [15.8655, 50, 84.1345])
    median = np.exp(np.log(diameter).mean() + 3 * spread**2)
    # The quantiles leave out the coarsest spheres: 1 / (2 n) of the number, 1e-3 of the mass.
    expected = median * np.exp([-spread, 0.0, spread])
    assert finer == pytest.approx(expected, rel=5e-3)


def test_spheres_follow_the_curve_they_are_drawn_from():
    curve = [1e-3, 0.0, 1.5e-3, 30.0, 2e-3, 60.0, 3e-3, 100.0]
    radii = radii_of_curve(20_000, curve)
    diameter = 2 * radii
    assert diameter.min() >= 1e-3
    assert diameter.max() <= 3e-3
    # The coarsest of 20,000 spheres hold a few 1e-4 of the mass.
    assert finer_diameters(diameter, radii**3, [30, 60]) == pytest.approx([1.5e-3, 2e-3], rel=2e-3)
    # Between two points the mass grows with ln d.
    half = finer_diameters(diameter, radii**3, [45])
    assert half == pytest.approx(np.sqrt(1.5e-3 * 2e-3), rel=2e-3)


def test_a_gap_in_the_curve_holds_no_spheres():
    radii = radii_of_curve(2_000, [1e-3, 0.0, 1.2e-3, 50.0, 2e-3, 50.0, 2.4e-3, 100.0])
    inside = (2 * radii > 1.2001e-3) & (2 * radii < 1.999e-3)
    assert not inside.any()


def test_packing_of_a_curve_from_its_file(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text("diameter_m,finer_percent\n1e-3,0\n1.5e-3,50\n2e-3,100\n")
    assert read_grading(path)[:3] == ["curve", "1e-3", "0"]
    packing = modal.random_packing(80, sizes=[str(path)], aspect=1)
    diameter = 2 * packing.radius
    assert diameter.min() >= 1e-3
    assert diameter.max() <= 2e-3
    numbers = summary(packing)
    assert numbers["d10_m"] < numbers["d50_m"] < numbers["d90_m"]
    assert numbers["d50_m"] == pytest.approx(1.5e-3, rel=0.05)
    assert "d50_m" not in summary(modal.fcc(cells=(1, 1, 4)))


@pytest.mark.parametrize(
    "text",
    ["", "1e-3,0\n", "1e-3,0\n2e-3,90\n", "2e-3,0\n1e-3,100\n", "1e-3,0\nfine,100\n", "1,2,3\n"],
)
def test_no_curve_is_refused(text, tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text(text)
    with refusal("grading", "curve.csv"):
        read_grading(path)


def test_sizes_too_far_apart_are_refused():
    with refusal("size_ratio"):
        draw_radii(100, ("curve", 1e-4, 0, 1e-2, 100), seed=1)
    with refusal("unreadable"):
        read_grading("nowhere.csv")
