"""Figure 11: velocities over frequency, by each way to them."""

from __future__ import annotations

from analysis.estimators.resonances import mode_velocities
from analysis.estimators.transfer import wall_velocity
from analysis.figures.picture import Panel, each
from analysis.measuring import Measuring
from analysis.quantities.passband import scale
from analysis.quantities.spectrum import standing_waves
from analysis.quantities.velocity import coherent, first_peak, longest, low_frequency


@each
def velocity_frequency(m: Measuring) -> Panel:
    """Fig. 11: phase and group velocity of the linear wave (walls, layers) and modes; dL/dt."""
    top, speed = 0.9 * scale(m), longest(m, "linear").value
    lowest = 0.5 if m.crystal else 0.75
    panel = Panel(
        "frequency (kHz)", "velocity (m/s)", m.label, legend="lower left",
        ylim=(lowest * speed, 1.12 * speed), xlim=(0, top / 1e3),
    )  # fmt: skip
    walls = wall_velocity(m.linear, m.network.length)
    if walls is not None:
        f, phase, group, _ = walls
        keep = (f > 0.7 * low_frequency(m)) & (f < top)
        panel.line(f[keep] / 1e3, phase[keep], "phase, walls", color="0.6")
        if m.crystal:  # of others the derivative is the scatter's, not the wave's
            panel.line(f[keep] / 1e3, group[keep], "group, walls", color="0.6", ls=":")
    wave = coherent(m, "linear")
    # At the lowest frequencies a derivative by differences is a ratio of small numbers.
    for values, text, first, ls in (
        (wave.phase_velocity, "phase, layers", 0.2, "-"),
        (wave.group_velocity, "group, layers", 0.7, ":"),
    ):
        keep = (wave.frequency > first * low_frequency(m)) & (wave.frequency < top)
        panel.line(wave.frequency[keep] / 1e3, values[keep], text, color="k", ls=ls)
    f_r, kappa = standing_waves(m)
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
        "hline",
        [0],
        [first_peak(m, "linear").value],
        None,
        "dL/dt, first peaks",
        color="#c05000",
        ls="--",
    )
    return panel
