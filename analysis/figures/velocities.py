"""Figure 11: velocities over frequency, by each way to them."""

from __future__ import annotations

from analysis.estimators.resonances import mode_velocities
from analysis.estimators.transfer import wall_velocity
from analysis.figures.picture import Panel, Picture, columns_for
from analysis.measures import Measures


def velocity_frequency(cases: list[Measures]) -> Picture:
    """Fig. 11: phase and group velocity of the linear wave (walls, layers) and modes; dL/dt."""
    panels = []
    for m in cases:
        case = m.case
        top = 0.9 * m.band
        lowest = 0.5 if case.is_crystal else 0.75
        panel = Panel(
            "frequency (kHz)", "velocity (m/s)", case.label, legend="lower left",
            ylim=(lowest * m.long_wave.value, 1.12 * m.long_wave.value), xlim=(0, top / 1e3),
        )  # fmt: skip
        walls = wall_velocity(case.wave, case.network.length)
        if walls is not None:
            f, phase, group, _ = walls
            keep = (f > 0.7 * m.low_frequency) & (f < top)
            panel.line(f[keep] / 1e3, phase[keep], "phase, walls", color="0.6")
            if case.is_crystal:  # of others the derivative is the scatter's, not the wave's
                panel.line(f[keep] / 1e3, group[keep], "group, walls", color="0.6", ls=":")
        wave = m.coherent
        # At the lowest frequencies a derivative by differences is a ratio of small numbers.
        for values, text, first, ls in (
            (wave.phase_velocity, "phase, layers", 0.2, "-"),
            (wave.group_velocity, "group, layers", 0.7, ":"),
        ):
            keep = (wave.frequency > first * m.low_frequency) & (wave.frequency < top)
            panel.line(wave.frequency[keep] / 1e3, values[keep], text, color="k", ls=ls)
        f_r, kappa = m.resonances
        keep = f_r < top
        if keep.sum() > 2:
            phase, group = mode_velocities(f_r[keep], kappa[keep])
            every = slice(None, None, max(1, len(phase) // 25))
            style = {"ls": "none", "mfc": "none", "color": "#0060a8", "ms": 5}
            panel.line(
                f_r[keep][every] / 1e3, phase[every], "phase, modes (Eq. 4)", marker="o", **style
            )
            panel.line(
                f_r[keep][every] / 1e3, group[every], "group, modes (Eq. 4)", marker="v", **style
            )
        panel.add(
            "hline", [0], [m.first_peak.value], None, "dL/dt, first peaks", color="#c05000", ls="--"
        )
        panels.append(panel)
    return Picture(panels, columns=columns_for(len(panels)))
