"""
Resonant column
===============

A column of grains driven at its base, as in the resonant-column test: the first resonance f_1
between two walls gives a velocity, V = 2 L f_1, and the width of its peak the quality factor Q.
Contacts have dashpots, of which the coherent wave of the same packing loses amplitude too.

`python examples/resonant_column.py FOLDER` writes the table and the figure into a folder.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _committed import write, write_page
from _cut import cylinder

import modal
from analysis.bench import modulus_velocities
from analysis.estimators.coherent import coherent_wave
from analysis.estimators.quality_factor import fitted_resonance, half_power
from modal.modes.damped import damped_modes
from modal.system.damping import ContactDamping

DAMPING = ContactDamping(normal=0.5, tangential=0.5)
WAVES = {"z": "longitudinal", "x": "shear"}
FREQUENCIES = [1, 2, 5, 10, 20]  # kHz, marks of an axis
HIGHEST = 3e4  # Hz, above which disorder scatters more than the dashpots take


def resonance(column, direction, expected, resolution):
    """Return f_1, Hz, and Q by response and by mode, and the response (nf,) at half height.

    The response goes from rest to 1.3 times the `expected` resonance, Hz. Beside the fitted and the
    half-power values stands the damped mode itself, a complex eigenvalue.
    """
    response = modal.frequency_response(
        column,
        direction=direction,
        highest=1.3 * expected,
        resolution=resolution,
        damping=DAMPING,
    )
    motion = response.layer_displacement[:, response.layer_displacement.shape[1] // 2]
    fitted = fitted_resonance(response.frequency, motion)
    width = half_power(response.frequency, abs(motion))
    modes = damped_modes(column, DAMPING, near=fitted.frequency, count=6)
    nearest = int(np.argmin(abs(modes.frequency / fitted.frequency - 1)))
    row = {"resonance": fitted.frequency, "of_mode": modes.frequency[nearest]}
    row |= {"quality": fitted.quality, "half_power": width.quality}
    row |= {"quality_of_mode": modes.quality[nearest]}
    row |= {"velocity": 2 * column.length * fitted.frequency}
    return row, response.frequency, abs(motion)


# %%
# **Longitudinal and shear columns**: a packing 3 D wide, periodic sideways, whose waves are plane.

packing = modal.random_packing(400, stress=1e5, seed=1, aspect=10)
velocities = dict(zip("zx", modulus_velocities(packing, "x"), strict=True))
rows = []
peaks = []
qualities = []
for direction, mark in zip(WAVES, "os", strict=True):
    velocity = velocities[direction]
    expected = velocity / (2 * packing.length)
    row, frequency, motion = resonance(packing, direction, expected, expected / 10)
    first = row["resonance"]
    rows.append({"wave": WAVES[direction], **row, "of_moduli": velocity})
    peaks.append((WAVES[direction], mark, frequency / first, motion))

    # **The coherent wave** of a pulse in the same packing: Q = omega / (2 alpha v). It is read over
    # half of the column, which has room for wavelengths from 4 f_1 on.
    duration = 1.3 * packing.length / velocity
    wave = modal.propagate(packing, duration, direction=direction, damping=DAMPING)
    coherent = coherent_wave(wave.signals, packing.length)
    phase_velocity = 2 * np.pi * coherent.frequency / coherent.wavenumber
    with np.errstate(divide="ignore", invalid="ignore"):
        quality = np.pi * coherent.frequency / (coherent.attenuation * phase_velocity)
    known = (quality > 0) & (coherent.frequency > 4 * first)
    known &= coherent.frequency < HIGHEST
    qualities.append((mark, coherent.frequency[known], quality[known]))

# %%
# **The torsional column**, as in laboratories: a cylinder cut out of a wider packing, with free
# sides, whose base turns. The mode that turns most tells where to look: near the free sides spheres
# have lost contacts, and the column is softer than its grains are inside.


def torsional_mode(column):
    """Return the frequency, Hz, of the mode whose spheres turn most about the axis, as a sine."""
    modes = modal.eigenmodes(column, lowest=8)
    across = column.position[:, :2] - column.cell_size[:2] / 2
    turn = column.mass * np.sin(np.pi * column.position[:, 2] / column.length)
    around = across[:, 0] * modes.shapes()[:, :, 1] - across[:, 1] * modes.shapes()[:, :, 0]
    return modes.frequency[np.argmax(abs(around @ turn))]


wide = modal.random_packing(1000, stress=1e5, seed=1, aspect=6)
column = cylinder(wide)
expected = torsional_mode(column)
row, frequency, motion = resonance(column, "torsion", expected, expected / 40)
rows.append({"wave": "torsional", **row, "of_moduli": modulus_velocities(wide, "x")[1]})
peaks.append(("torsional", "^", frequency / row["resonance"], motion))
rows = pd.DataFrame(rows)
print(rows.to_string(index=False, float_format="%.4g"))

# %%
# **The picture**: the three resonances; Q of each by its peak (full), and of the coherent waves
# (open), with lines that fall as 1 / f as dashpots make it.

figure, axes = plt.subplots(1, 2, figsize=(7.2, 2.6), layout="constrained")
for wave, mark, over_first, motion in peaks:
    axes[0].plot(over_first, motion, f"k{mark}-", ms=2.5, lw=0.6, label=wave)
for mark, frequency, quality in qualities:
    axes[1].loglog(frequency / 1e3, quality, f"k{mark}", ms=2.5, mfc="w")
for (_, mark, *_), first, quality in zip(peaks, rows["resonance"], rows["quality"], strict=True):
    axes[1].loglog(first / 1e3, quality, f"k{mark}", ms=5)
    if mark != "^":
        span = np.array([first, HIGHEST])
        axes[1].loglog(span / 1e3, quality * first / span, "k-", lw=0.6)
axes[0].set(xlabel="frequency / $f_1$", ylabel="motion at half height / that of the base")
axes[0].legend(frameon=False)
axes[1].set(xlabel="frequency, kHz", ylabel="Q", xticks=FREQUENCIES, xticklabels=FREQUENCIES)
axes[1].minorticks_off()
plt.show()

if __name__ == "__main__" and len(sys.argv) == 2:
    write(sys.argv[1], {"resonant_column": figure}, {})
    columns = {
        "wave": "{wave}",
        "f_1, Hz": "{resonance:.1f}",
        "f of the damped mode, Hz": "{of_mode:.1f}",
        "Q, fitted": "{quality:.2f}",
        "Q, half power": "{half_power:.2f}",
        "Q of the damped mode": "{quality_of_mode:.2f}",
        "2 L f_1, m/s": "{velocity:.1f}",
        "V of the moduli, m/s": "{of_moduli:.1f}",
    }
    write_page(f"{sys.argv[1]}/resonant_column.md", rows, columns)
