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
        assert default.agrees, f"{default.name}: {default.value}; {default}"


def test_another_default_would_be_noticed(monkeypatch):
    for name in ("TIME_STEP_FRACTION", "RECORDING_INTERVAL"):
        monkeypatch.setattr(defaults, name, 0.4)
    step, interval, *_ = defaults.wave_of_crystal(read_csv(COMMITTED / "wave.csv"))
    assert not step.agrees
    assert not interval.agrees


def rows(method: str = "", **columns) -> list[dict]:
    """Return the rows of one method, from its columns."""
    rows = []
    for values in zip(*columns.values(), strict=True):
        row = dict(zip(columns, values, strict=True))
        rows.append({**row, "method": method})
    return rows


def steps(floor: float) -> list[dict]:
    """Return rows of the crystal: V_P is off by `floor`, to which the time step adds its share."""
    time_steps = (0.8, 0.4, 0.2, 0.1, 0.05)
    return rows(
        "YADE, 2A = 5 nm",
        time_step_over_limit=time_steps,
        error_velocity=[floor] * 5,
        dispersion_linear=[0.04 * step**2 for step in time_steps],
    )


PACKING = rows(time_step_over_limit=(0.5, 0.2, 0.1), error=(0.1, 0.016, 0.004))
RECORDS = rows(
    dem.RECORDING, interval_us=(0.1, 1, 2, 3), error_dispersion=(1e-4, 1.01e-4, 1.2e-4, 1e-4)
)
TOLERANCES = rows(wave.CHEBYSHEV, products=(200, 210, 219, 240), error=(1e-2, 1e-5, 1e-9, 1e-13))
TOLERANCES += rows(wave.LEAPFROG, products=(100,), error=(0.0,))
WIDTHS = rows(
    "random vectors, more moments",
    resolution_hz=(4e4, 8e3, 2e3),
    error_of_kernel=(4e-3, 8e-4, 2e-4),
)
# 6e-4 of e = 0.7 is less than 5e-4; 1e-2, met by chance before a run moves on, does not count, nor
# does 3e-4, which one run alone has met.
STOPS = rows(
    stop_unbalanced=(1e-2, 1e-2, 3e-3, 3e-3, 1e-3, 1e-3, 3e-4, preparation.END),
    error_e=(1e-4, 1e-4, 2e-3, 9e-4, 4e-4, 6e-4, 1e-9, None),
    e=[0.7] * 8,
)


@pytest.mark.parametrize(
    ("rule", "tried", "column", "best"),
    [
        # 0.04 * 0.2^2 = 1.6e-3 is the largest share below 2e-3, which no step mends.
        (dem.step_knee, steps(2e-3), "time_step_over_limit", 0.2),
        (dem.step_knee, steps(5e-5), None, None),
        # The non-linearity is 0.02.
        (time_step.knee, PACKING, "time_step_over_limit", 0.2),
        (time_step.knee, PACKING[:1], None, None),
        # An error that happens to come back at a longer interval does not count.
        (dem.interval_knee, RECORDS, "interval_us", 1.0),
        # The tightest that is nearly free.
        (wave.knee, TOLERANCES, "error", 1e-9),
        # The coarsest whose kernel is below the standard error, 1e-3; else the finest there is.
        (density.knee, WIDTHS, "resolution_hz", 8e3),
        (density.knee, WIDTHS[:1], "resolution_hz", 4e4),
        # The loosest from which on no run moves a digit; else the tightest there is.
        (preparation.knee, STOPS, None, 1e-3),
        (preparation.knee, STOPS[2:4], None, 3e-3),
    ],
)
def test_each_rule_finds_the_default(rule, tried, column, best):
    default = rule(tried)
    if column:
        default = default[column]
    assert default == best


def test_a_dem_is_set_against_the_fastest_wave_that_is_as_accurate():
    rows = [
        {"method": "linear, Chebyshev", "error": 1e-1, "seconds": 0.1},
        {"method": "linear, Chebyshev", "error": 1e-9, "seconds": 0.2},
        {"method": "linear, leapfrog", "error": 1e-3, "seconds": 0.5},
        {"method": "YADE, 2A = 5 nm", "error": 1e-1, "seconds": 3.0},
        {"method": "YADE, 2A = 5 nm", "error": 1e-3, "seconds": 8.0},
        {"method": "LAMMPS, 2A = 5 nm", "error": 0.2, "seconds": 1.0},
    ]
    assert dem.at_equal_error(rows, "YADE") == (8.0 / 0.2, 1e-3)
    assert dem.at_equal_error(rows, "LAMMPS") == (1.0 / 0.1, 0.2)


def test_exponents_are_those_of_power_laws():
    rows = [{"x": x, "seconds": 1e-6 * x**1.5, "mb": None} for x in (10, 100, 1000)]
    assert diagram.exponent(rows, "seconds") == pytest.approx(1.5)
    assert diagram.exponent(rows, "mb") is None
    assert diagram.exponent(rows[:1], "seconds") is None
