"""Hold all figures: functions that make a picture of measured cases, drawn and tabulated."""

from collections.abc import Callable
from typing import Any

from analysis.case_measurement import measure_result
from analysis.case_result import CaseResult
from analysis.figures import cases as of_cases
from analysis.figures import modes, spectra, waves
from analysis.figures.picture import Panel, Picture, columns_for, merged
from analysis.frame import frame_of
from analysis.packing_data import PackingData
from modal.tools.errors import InputError, refuse_unknown

Figure = Callable[[Any], Any]
"""A function of a frame of cases, or of one case, that returns a picture or its one panel."""
OF_ROWS: tuple[Figure, ...] = (
    *(of_cases.velocity_cases, of_cases.highest_frequency, of_cases.low_pass_cases),
    *(of_cases.velocity_low_pass, of_cases.wavelength_cases, of_cases.gain_cases),
    *(of_cases.isostaticity, of_cases.scattering),
)
"""Figures of the numbers of cases, as `analysis.frame.frame_of` has them."""
OF_CASES: tuple[Figure, ...] = (
    *(waves.samples, waves.source, waves.signals, waves.signals_stress, waves.space_time),
    *(modes.natural_frequencies, modes.chi_z, modes.mode_shapes, spectra.velocity_frequency),
    *(waves.spectrum_distance, spectra.dispersion),
)
"""Figures of one case and what its files hold."""
FIGURES = {figure.__name__: figure for figure in (*OF_CASES, *OF_ROWS)}


def compose(name: str, cases: list[PackingData]) -> Picture:
    """Return one figure of the given cases.

    Panels of several cases with the same title are joined. Raises InputError if there is no such
    figure, or if no case has the data for it.
    """
    refuse_unknown("figure", name, FIGURES)
    figure = FIGURES[name]
    rows: list[CaseResult] = []
    if figure in OF_ROWS:
        rows = [measure_result(case) for case in cases]
        picture = _as_picture(figure(frame_of(rows)))
    else:
        picture = _join([_as_picture(figure(case)) for case in cases])
    if not picture.shown:
        _refuse_empty(name, picture, rows)
    return picture


def _as_picture(drawn: Picture | Panel) -> Picture:
    """Return the result of a figure's function, panels or a picture, as a picture."""
    if isinstance(drawn, Panel):
        return Picture([drawn])
    return drawn


def _join(pictures: list[Picture]) -> Picture:
    """Return the pictures of several cases as one."""
    first = pictures[0]
    if len(pictures) == 1:
        return first
    panels = merged([panel for picture in pictures for panel in picture.panels])
    if first.shape:
        return Picture(panels, first.columns)
    return Picture(panels, columns_for(len(panels)))


def _refuse_empty(name: str, picture: Picture, rows: list[CaseResult]) -> None:
    """Raise InputError for a picture without any point; the message has the cases' first note."""
    labels = ", ".join(dict.fromkeys(panel.ylabel or panel.title for panel in picture.panels))
    notes = [note for row in rows for note in row.notes]
    problem = f"{name}: nothing to draw, for no case here has {labels}"
    if notes:
        problem += f" ({notes[0]})"
    raise InputError("nothing_to_draw", problem, remedy="add a longer packing")
