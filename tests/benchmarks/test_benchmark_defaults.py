"""The rules that find a default in a benchmark's rows, and the defaults in the committed rows."""

import pytest
from places import ROOT

from benchmarks import defaults, dem, density, preparation, time_step, wave
from benchmarks.harness import diagram
from benchmarks.harness.report import read_csv

COMMITTED = ROOT / "results" / "benchmarks"


@pytest.mark.parametrize("name", defaults.SOURCES)
def test_defaults_are_what_the_rules_find_in_the_committed_rows(name):
    for default in defaults.SOURCES[name](read_csv(COMMITTED / f"{name}.csv")):
        assert default.agrees, f"{default.what}: {default.value}; {default}"


def test_another_default_would_be_noticed(monkeypatch):
    monkeypatch.setattr(defaults, "assigned", lambda script, pattern: 0.4)
    step, interval, *_ = defaults.wave_of_crystal(read_csv(COMMITTED / "wave.csv"))
    assert not step.agrees and not interval.agrees
    assert str(step).startswith("NOT what the rule finds")


def step_rows(floor: float, shares: dict[float, float]) -> list[dict]:
    """Rows of the crystal: V_P is off by `floor`, the time step adds its share."""
    return [
        {
            "method": "YADE, 2A = 5 nm",
            "time_step_over_limit": step,
            "dispersion_linear": share,
            "error_velocity": floor,
        }
        for step, share in shares.items()
    ]


def test_step_of_the_crystal_is_the_largest_below_what_no_step_mends():
    shares = {step: 0.04 * step**2 for step in (0.8, 0.4, 0.2, 0.1, 0.05)}
    # 0.04 * 0.2^2 = 1.6e-3 is the largest share below 2e-3.
    found = dem.step_knee(step_rows(2e-3, shares))
    assert found["time_step_over_limit"] == 0.2
    assert dem.step_knee(step_rows(5e-5, shares)) is None


def test_step_of_the_packing_is_the_largest_below_the_non_linearity():
    rows = [{"time_step_over_limit": step, "error": 0.4 * step**2} for step in (0.5, 0.2, 0.1)]
    # 0.4 * 0.2^2 = 0.016 < 0.02 < 0.4 * 0.5^2 = 0.1.
    assert time_step.knee(rows)["time_step_over_limit"] == 0.2
    assert time_step.knee(rows[:1]) is None


def test_recording_interval_ends_where_the_error_first_changes():
    """An error that happens to come back at a longer interval does not count."""
    rows = [
        {"method": dem.RECORDING, "interval_us": interval, "error_dispersion": error}
        for interval, error in ((0.1, 1.0e-4), (1.0, 1.01e-4), (2.0, 1.2e-4), (3.0, 1.0e-4))
    ]
    assert dem.interval_knee(rows)["interval_us"] == 1.0


def test_tolerance_of_the_wave_is_the_tightest_that_is_nearly_free():
    rows = [
        {"method": "linear, Chebyshev", "products": products, "error": error}
        for products, error in ((200, 1e-2), (210, 1e-5), (219, 1e-9), (240, 1e-13))
    ]
    rows.append({"method": "linear, leapfrog", "products": 100, "error": 0.0})
    assert wave.knee(rows)["error"] == 1e-9


def test_resolution_is_the_coarsest_whose_kernel_is_below_the_standard_error():
    rows = [
        {
            "method": "random vectors, more moments",
            "resolution_hz": width,
            "error_of_kernel": 1e-7 * width,
        }
        for width in (4e4, 8e3, 2e3)
    ]
    assert density.knee(rows)["resolution_hz"] == 8e3
    assert density.knee(rows[:1])["resolution_hz"] == 4e4  # none does: the finest there is


def test_stop_criterion_is_the_loosest_from_which_on_no_run_moves_a_digit():
    """The largest error of all runs counts, and only criteria that all of them have met."""
    errors = {1e-2: (1e-4, 1e-4), 3e-3: (2e-3, 9e-4), 1e-3: (4e-4, 6e-4), 3e-4: (1e-9,)}
    rows = [
        {"stop_unbalanced": criterion, "error_e": error, "e": 0.7}
        for criterion, of_runs in errors.items()
        for error in of_runs
    ]
    rows.append({"stop_unbalanced": preparation.END, "error_e": None})
    # 6e-4 of 0.7 is less than 5e-4; 1e-2, met by chance before a run moves on, does not count.
    assert preparation.knee(rows) == 1e-3
    assert preparation.knee(rows[2:4]) == 3e-3  # none does: the tightest there is


def test_a_dem_is_set_against_the_fastest_wave_that_is_as_accurate():
    names = ("linear, Chebyshev", "linear, leapfrog", "YADE, 2A = 5 nm", "LAMMPS, 2A = 5 nm")
    given = ((1e-1, 0.1), (1e-9, 0.2)), ((1e-3, 0.5),), ((1e-1, 3.0), (1e-3, 8.0)), ((0.2, 1.0),)
    rows = [
        {"method": name, "error": error, "seconds": seconds}
        for name, runs in zip(names, given, strict=True)
        for error, seconds in runs
    ]
    assert dem.at_equal_error(rows, "YADE") == (8.0 / 0.2, 1e-3)
    assert dem.at_equal_error(rows, "LAMMPS") == (1.0 / 0.1, 0.2)


def test_exponents_are_those_of_power_laws():
    rows = [{"x": x, "seconds": 1e-6 * x**1.5, "mb": None} for x in (10, 100, 1000)]
    assert diagram.exponent(rows, "seconds") == pytest.approx(1.5)
    assert diagram.exponent(rows, "mb") is None
    assert diagram.exponent(rows[:1], "seconds") is None
