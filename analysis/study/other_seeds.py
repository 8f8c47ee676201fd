"""A case's packing of another seed: the numbers whose scatter over packings is shown, no more.

These are Table 1's and what sets packings apart. Errors are not among them: along every column of a
packing f_low-pass and V_P are had for the study's own packings alone.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

from analysis.case import Case
from analysis.columns import VALUES
from analysis.measures import Measures
from analysis.measures.estimate import Estimate
from analysis.rows import MAPS, Row, add_low_pass, bare_row
from modal.exchange.registry import read_packing
from modal.packing.network import Network
from modal.waves.signals import Signals

AT_REST = "particles", "length_over_d", "void_ratio", "coordination_number", "f_max_khz"
"""Columns that need no wave."""
RULE = {"": MAPS[""]}
"""Of f_low-pass: by the paper's words."""


class OtherSeed(Case):
    """Its packing without remarks for readers, its wave on one chain and the layers."""

    @cached_property
    def network(self) -> Network:
        """Contact network."""
        return read_packing(self.packing_path)

    @cached_property
    def wave(self) -> Signals:
        """The linear wave, from wall to wall and back."""
        return self.linear_wave(particles=False)


def row_of_seed(name: str, folder: Path) -> Row:
    """The numbers of a case's packing in the folder of another seed."""
    case = OtherSeed(name, folder)
    case.check()
    m = Measures(case)
    row = bare_row(case)
    for column in AT_REST:
        row.values[column] = Estimate.of(VALUES[column](m))
    row.values["v_p_first_peaks_yade_m_per_s"] = m.yade_first_peak
    row.values["v_p_first_peaks_linear_m_per_s"] = m.first_peak
    add_low_pass(row, m, RULE)
    return row
