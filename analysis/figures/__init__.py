"""The figures: each a function from measured cases to a picture, drawn and tabulated."""

from collections.abc import Callable
from typing import Any

from analysis.figures import cases as of_cases
from analysis.figures import modes, spectra, waves
from analysis.figures.picture import Picture, columns_for, merged
from analysis.frame import frame_of
from analysis.packing_data import PackingData
from analysis.rows import row_of
from modal.tools.errors import InputError, refuse_unknown

Figure = Callable[[Any], Any]
"""Of cases or of one, to a picture, or its one panel."""
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
    """One figure of the given cases; InputError where its name or a product is missing.

    Of several cases those panels that have one title become one.
    """
    refuse_unknown("figure", name, FIGURES)
    rows = [row_of(m) for m in cases] if FIGURES[name] in OF_ROWS else []
    each = [FIGURES[name](one) for one in ([frame_of(rows)] if rows else cases)]
    picture, *others = [one if isinstance(one, Picture) else Picture([one]) for one in each]
    if others:
        panels = merged([panel for one in (picture, *others) for panel in one.panels])
        picture = Picture(panels, picture.columns if picture.shape else columns_for(len(panels)))
    if not picture.shown:
        what = ", ".join(dict.fromkeys(panel.ylabel or panel.title for panel in picture.panels))
        why = next((f" ({note})" for row in rows for note in row.notes), "")
        raise InputError(
            "input",
            f"{name}: nothing to draw, for no case here has {what}{why}",
            remedy="add a longer packing",
        )
    return picture
