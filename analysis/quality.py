"""Quality factor over frequency of packings with viscous contacts: a table and a figure.

Of a packing whose elastic modes are at hand, to first order in the damping
(`modal.modes.damped.decay_rates`); of one without, of complex modes near some frequencies, which
are exact. Damping ratios that are alike make dashpots nearly proportional to springs, and Q f is
then the same for all modes: (k / m*)^1/2 / (4 pi beta) where all contacts are alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analysis.case import Case
from analysis.figures.picture import Panel, Picture
from analysis.table import Table
from modal.modes.damped import damped_modes, decay_rates
from modal.system.damping import ContactDamping
from modal.tools.errors import InputError

NEAREST = 6
"""Complex modes near each frequency."""
SHOWN = 5
"""Rows of a packing's elastic modes in the table, evenly over the logarithm of frequency."""
HEADER = ("packing", "modes", "frequency, kHz", "quality factor", "Q f, MHz", "residual, at most")
Quality = tuple[str, np.ndarray, np.ndarray, np.ndarray]
"""By which rule, frequency (k,) Hz, quality factor (k,), residual (k,), NaN to first order."""


def quality_of(case: Case, damping: ContactDamping, near: Sequence[float]) -> Quality:
    """Quality factors of a packing's modes; InputError where there is nothing to go by."""
    modes = case.shaped_modes
    if modes is not None:
        f = modes.frequency
        rate = decay_rates(modes, case.network, damping)
        return "elastic, first order", f, np.pi * f / rate, np.full(len(f), np.nan)
    if not near:
        raise InputError(f"{case.name}: no modes among the files; give them, or --near HZ")
    found = [damped_modes(case.network, damping, near=f, count=NEAREST) for f in near]
    f, quality, residual = (
        np.concatenate([getattr(one, name) for one in found])
        for name in ("frequency", "quality", "residual")
    )
    return "complex", f, quality, residual


def table_of(found: dict[str, Quality]) -> Table:
    """Some rows a packing: of elastic modes evenly chosen, of complex ones their medians."""
    rows = []
    for name, (rule, f, quality, residual) in found.items():
        if rule == "complex":
            parts = np.split(np.arange(len(f)), len(f) // NEAREST)
        else:
            wanted = np.geomspace(f[0], f[-1], SHOWN)
            parts = [np.array([np.argmin(abs(f - at))]) for at in wanted]
        for part in parts:
            worst = residual[part].max()
            rows.append(
                [
                    name,
                    rule,
                    f"{np.median(f[part]) / 1e3:.4g}",
                    f"{np.median(quality[part]):.4g}",
                    f"{np.median(quality[part] * f[part]) / 1e6:.4g}",
                    f"{worst:.0e}" if np.isfinite(worst) else "",
                ]
            )
    return Table("Quality factor over frequency", HEADER, rows)


def picture_of(found: dict[str, Quality], damping: ContactDamping) -> Picture:
    """Beyond the paper: quality factor of modes over frequency."""
    title = f"damping ratios {damping.normal:g}, {damping.tangential:g}"
    panel = Panel("frequency (kHz)", "quality factor", title, xscale="log", yscale="log")
    looks = ({"color": "k", "marker": "."}, {"color": "#c05000", "marker": "x"})
    for k, (name, (rule, f, quality, _)) in enumerate(found.items()):
        panel.line(f / 1e3, quality, f"{name}, {rule}", ls="none", ms=4, **looks[k % len(looks)])
    return Picture([panel])
