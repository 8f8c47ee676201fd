"""Defaults of the programs, compared with what rules find in the rows of benchmarks.

    python -m benchmarks defaults -o results/benchmarks

prints the table of defaults from the committed rows; nothing is measured.
"""

import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from analysis.study.description import Study
from benchmarks import dem, density, modes, preparation, time_step, wave
from benchmarks.harness import report
from benchmarks.harness.measure import ROOT
from benchmarks.harness.report import Rows, read_csv
from modal.modes.density import RESOLUTION, density_of_states
from modal.preparation.protocol import SETTLED
from modal.waves.motions import RECORDING_INTERVAL, TIME_STEP_FRACTION
from modal.waves.propagate import LINEAR_TOLERANCE


@dataclass(frozen=True)
class Default:
    """A default, its value, the reason by the rows, and whether the rule finds this value."""

    name: str
    value: str
    reason: str
    agrees: bool = True

    def __str__(self) -> str:
        if self.agrees:
            return self.reason
        return f"NOT what the rule finds: {self.reason}"


def wave_of_crystal(rows: Rows) -> Iterator[Default]:
    """Yield time step, interval and amplitude of YADE's wave, and the linear tolerance."""
    best = dem.step_knee(rows)
    last = dem.steps_of(rows)[-1]
    floor = f"the {last['error_velocity']:.1e} of V_P that no step mends"
    reason = f"no step tried has a share of the dispersion's error below {floor}"
    if best:
        reason = (
            f"the largest whose share of the dispersion's error, {best['dispersion_linear']:.1e}, "
            f"is below {floor}; {last['time_step_over_limit']:g} takes "
            f"{last['seconds'] / best['seconds']:.2g} times as long"
        )
    yield Default(
        "time step of YADE, crystal",
        f"{TIME_STEP_FRACTION:g} of the limit",
        reason,
        best is not None and best["time_step_over_limit"] == TIME_STEP_FRACTION,
    )
    longest = dem.interval_knee(rows)["interval_us"]
    yield Default(
        "recording interval",
        f"{1e6 * RECORDING_INTERVAL:g} us",
        f"the dispersion's error stays within {dem.MAX_UNCHANGED_RATIO - 1:.0%} up to "
        f"{longest:.2g} us",
        longest >= 1e6 * RECORDING_INTERVAL,
    )
    yield Default(
        "amplitude",
        f"2A = {last['two_A_nm']:g} nm",
        f"the paper's; V_P is then off by {last['error_velocity']:.1e}, the signals are off the "
        f"linear wave by {last['apart_from_tangent']:.1e}",
    )
    linear = wave.knee(rows)
    yield Default(
        "wave of the springs",
        f"Chebyshev, {LINEAR_TOLERANCE:g}",
        f"the tightest within {wave.MAX_FREE_RATIO - 1:.0%} of the least work: an error of "
        f"{linear['error']:.0e} in {linear['seconds']:.2g} s",
        linear["setting"] == f"tolerance {LINEAR_TOLERANCE:g}",
    )


def packing(rows: Rows) -> Iterator[Default]:
    """Yield the time step of YADE's wave in a random packing."""
    cases = Study(ROOT / "studies/otsubo2017/study.yaml").cases
    step, *smaller = sorted(cases["fraction"].dropna().unique(), reverse=True)
    best = time_step.knee(rows)
    limit = f"{time_step.NON_LINEAR:g}, about the non-linearity at 5 nm"
    reason = f"no step tried has an error below {limit}"
    if best:
        reason = f"the largest whose error of single spheres, {best['error']:.1e}, is below {limit}"
    value = f"{step:g} of the limit"
    if smaller:
        value += ", less where the balance of energy needs it"
    yield Default(
        "time step of YADE, random",
        value,
        reason,
        best is not None and step == best["time_step_over_limit"],
    )


def lowest_modes(rows: Rows) -> Iterator[Default]:
    """Yield the back end of the lowest modes."""
    slower, best = modes.choice(rows)
    peers = [row for row in rows if not row["method"].startswith(modes.OWN) and row["error"]]
    fast = min(peers, key=lambda row: row["seconds"])
    yield Default(
        "lowest modes",
        "block Lanczos with exact counts",
        f"right to {rows[0]['error']:.0e} in {slower:.2f} times the time of its fastest back end "
        f"({best}); the fastest peer ({fast['method']}) takes "
        f"{fast['seconds'] / rows[0]['seconds']:.2g} times as long for {fast['error']:.0e}",
        slower <= modes.FAST_ENOUGH,
    )


HIGHEST_FREQUENCY = 2.15e5
"""Hz, of random packings of the study's glass spheres under 100 kPa, as in the benchmark."""
BETWEEN_RESOLUTIONS = 0.25
"""Relative distance within which a resolution is nearest to one of the sweep, whose next ones lie
at half and at 2.5 times it."""


def states(rows: Rows) -> Iterator[Default]:
    """Yield resolution and standard error of the density of states."""
    tolerance = inspect.signature(density_of_states).parameters["tolerance"].default
    resolution = RESOLUTION * HIGHEST_FREQUENCY
    best = density.knee(rows)
    yield Default(
        "density of states",
        f"{RESOLUTION:g} of the highest frequency, {resolution / 1e3:.3g} kHz here, standard error "
        f"{tolerance:g}",
        f"the coarsest whose kernel, {best['error_of_kernel']:.1e}, errs less than this standard "
        f"error; the {best['vectors']:.0f} vectors that it takes err by at most "
        f"{best['error_of_vectors']:.1e} in this draw",
        # The largest of many errors is within three times the one that was asked for.
        abs(resolution / best["resolution_hz"] - 1) < BETWEEN_RESOLUTIONS
        and best["error_of_vectors"] < 3 * tolerance,
    )


def settled(rows: Rows) -> Iterator[Default]:
    """Yield the limits at which a state of the compression is reached."""
    best = preparation.knee(rows)
    errors = [row["error_e"] for row in preparation.stops(rows)[SETTLED.residual]]
    agrees = SETTLED.stress_error == preparation.STRESS_ERROR * SETTLED.residual
    yield Default(
        "settled state",
        f"residual {SETTLED.residual:g}, stress {SETTLED.stress_error:g}",
        f"e then moves by {max(errors):.1e} at most; up to {best:g} every run keeps it to "
        f"{preparation.DIGIT:g}, half of the last digit that the paper states",
        agrees and SETTLED.residual <= best,
    )


SOURCES: dict[str, Callable[[Rows], Iterator[Default]]] = {
    "wave": wave_of_crystal,
    "random_time_step": packing,
    "eigensolvers": lowest_modes,
    "density": states,
    "preparation": settled,
}
"""Function from the rows of a table to the defaults that follow from them, by the table."""


def table(folder: Path) -> str:
    """Return the defaults whose rows are in a folder, as Markdown."""
    rows: Rows = []
    for name, find_defaults in SOURCES.items():
        path = folder / f"{name}.csv"
        if not path.exists():
            continue
        for default in find_defaults(read_csv(path)):
            row = {"default": default.name, "value": default.value, "reason": str(default)}
            rows.append({**row, "rows": f"`{name}.csv`"})
    if not rows:
        return ""
    return report.table(rows, digits=3).markdown().rstrip("\n")
