"""The figures: each a function from measured cases to a picture, drawn and tabulated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from analysis.figures import beyond, modes, packing, spectra, velocities, waves
from analysis.figures import cases as of_cases
from analysis.figures.picture import Picture
from analysis.measuring import Measuring
from analysis.rows import row_of
from modal.tools.errors import InputError


class Entry(NamedTuple):
    """A figure: its numbers in the paper, its function of cases or of their rows, and of which."""

    number: str
    function: Callable[[list[Any]], Picture]
    of_rows: bool = False


FIGURES: dict[str, Entry] = {
    "samples": Entry("1", packing.samples),
    "source": Entry("2", packing.source),
    "signals": Entry("3", waves.signals),
    "signals_stress": Entry("4", waves.signals_stress),
    "space_time": Entry("5", waves.space_time),
    "velocity_cases": Entry("6", of_cases.velocity_cases, of_rows=True),
    "natural_frequencies": Entry("7", modes.natural_frequencies),
    "highest_frequency": Entry("8", of_cases.highest_frequency, of_rows=True),
    "chi_z": Entry("9", modes.chi_z),
    "mode_shapes": Entry("10", modes.mode_shapes),
    "velocity_frequency": Entry("11", velocities.velocity_frequency),
    "spectrum_distance": Entry("12, 13", waves.spectrum_distance),
    "dispersion": Entry("14, 15", spectra.dispersion),
    "low_pass_cases": Entry("16", of_cases.low_pass_cases, of_rows=True),
    "velocity_low_pass": Entry("17", of_cases.velocity_low_pass, of_rows=True),
    "wavelength_cases": Entry("18", of_cases.wavelength_cases, of_rows=True),
    "gain": Entry("19", of_cases.gain, of_rows=True),
    "gain_cases": Entry("19", of_cases.gain_cases, of_rows=True),
    "isostaticity": Entry("", beyond.isostaticity, of_rows=True),
    "gain_orders": Entry("", beyond.gain_orders, of_rows=True),
    "scattering": Entry("", beyond.scattering, of_rows=True),
    "density_excess": Entry("", beyond.density_excess, of_rows=True),
    "low_pass_rules": Entry("", beyond.low_pass_rules, of_rows=True),
    "low_pass_chains": Entry("", waves.low_pass_chains),
    "structure": Entry("", spectra.structure),
}


def compose(name: str, cases: list[Measuring]) -> Picture:
    """One figure of the given cases; InputError where its name or a product is missing."""
    if name not in FIGURES:
        known = ", ".join(FIGURES)
        raise InputError(f"{name!r} is not a figure; choose one of {known}")
    entry = FIGURES[name]
    rows = [row_of(m) for m in cases] if entry.of_rows else []
    picture = entry.function(rows or cases)
    if not picture.shown:
        what = ", ".join(dict.fromkeys(panel.ylabel or panel.title for panel in picture.panels))
        why = next((f" ({note})" for row in rows for note in row.notes), "")
        raise InputError(
            f"{name}: nothing to draw, for no case here has {what}{why}; add a longer packing"
        )
    return picture


def draw(name: str, cases: list[Measuring], stem: Path) -> list[Path]:
    """Draw one figure; returns the PNG and CSV files written."""
    from analysis.figures.render import save  # Matplotlib, which a figure's numbers do not need

    return save(compose(name, cases), stem)
