"""Draw the traces of a bench test with two transducers, and the picks of each rule."""

from dataclasses import replace
from typing import Any

import numpy as np

from analysis.bench import TransducerTest
from analysis.estimators.arrival_rules import RULES, RecordPair, travel_time
from analysis.figures.looks import OUTSIDE
from analysis.figures.picture import BLUE, ORANGE, Panel, Picture

RULE_LINES: dict[str, dict[str, Any]] = {
    "first_arrival": {"color": "0.4", "ls": ":"},
    "zero_crossing": {"color": BLUE, "ls": "--"},
    "peak_to_peak": {"color": BLUE, "ls": "-."},
    "cross_correlation": {"color": ORANGE, "ls": "-"},
    "phase": {"color": ORANGE, "ls": (0, (8, 3))},
}
"""Line of each rule; the dashes tell them apart in grey."""
MAX_COLUMNS = 2


def traces(test: TransducerTest, velocity: float) -> Picture:
    """Draw source and receiver against time, a panel for each frequency, each scaled to 1.

    Vertical lines are the travel times by the rules, from the source's first motion on; the thin
    black line is the travel time at `velocity`, m/s. The last panel of the first row has the
    legend.
    """
    panels = [_panel(pair, test.distance, velocity) for pair in test.pairs]
    columns = min(MAX_COLUMNS, len(panels))
    panels[columns - 1].legend = OUTSIDE
    for panel in (*panels[: columns - 1], *panels[columns:]):
        panel.series = [replace(series, label="") for series in panel.series]
    rows = -(-len(panels) // columns)
    return Picture(panels, columns, shape=(5.5 * columns, 2.2 * rows + 0.4))


def _panel(pair: RecordPair, distance: float, velocity: float) -> Panel:
    """Draw the two traces of one frequency."""
    title = f"{pair.frequency / 1e3:.4g} kHz"
    panel = Panel("time (ms)", "motion over its largest (-)", title)
    time = 1e3 * pair.time
    panel.line(time, pair.source / abs(pair.source).max(), "source", color="0.7")
    largest = float(abs(pair.receiver).max()) or 1.0
    panel.line(time, pair.receiver / largest, "receiver", color="k")
    for rule in RULES:
        picked = 1e3 * np.array([travel_time(pair, rule).value])
        known = picked[np.isfinite(picked)]
        panel.vlines(known, rule.replace("_", " "), lw=1.0, **RULE_LINES[rule])
    if velocity > 0:
        panel.vlines([1e3 * distance / velocity], "moduli", color="k", lw=0.5)
    return panel
