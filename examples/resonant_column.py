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

import modal
from analysis.bench import modulus_velocities
from analysis.estimators.coherent import coherent_wave
from analysis.estimators.quality_factor import fitted_resonance, half_power
from modal.modes.damped import damped_modes
from modal.system.damping import ContactDamping

DAMPING = ContactDamping(normal=0.5, tangential=0.5)
WAVES = {"z": "longitudinal", "x": "shear"}  # in a periodic cell shear stands for torsion
HIGHEST = 3e4  # Hz, above which disorder scatters more than the dashpots take

packing = modal.random_packing(400, stress=1e5, seed=1, aspect=10)
velocities = dict(zip("zx", modulus_velocities(packing, "x"), strict=True))

# %%
# **The resonance.** The response at half height, from rest up to 1.3 f_1. Beside the fitted and the
# half-power values stands the damped mode itself, a complex eigenvalue.

figure, axes = plt.subplots(1, 2, figsize=(7.2, 2.6), layout="constrained")
rows = []
for direction, mark in zip(WAVES, "os", strict=True):
    velocity = velocities[direction]
    expected = velocity / (2 * packing.length)
    response = modal.frequency_response(
        packing,
        direction=direction,
        highest=1.3 * expected,
        resolution=expected / 10,
        damping=DAMPING,
    )
    motion = response.layer_displacement[:, response.layer_displacement.shape[1] // 2]
    fitted = fitted_resonance(response.frequency, motion)
    width = half_power(response.frequency, abs(motion))
    modes = damped_modes(packing, DAMPING, near=fitted.frequency, count=6)
    nearest = int(np.argmin(abs(modes.frequency / fitted.frequency - 1)))
    row = {"wave": WAVES[direction], "resonance": fitted.frequency, "quality": fitted.quality}
    row |= {"half_power": width.quality, "of_mode": modes.quality[nearest]}
    row |= {"velocity": 2 * packing.length * fitted.frequency, "of_moduli": velocity}
    rows.append(row)
    ratio = response.frequency / fitted.frequency
    axes[0].plot(ratio, abs(motion), f"k{mark}-", ms=2.5, lw=0.6, label=WAVES[direction])

    # **The coherent wave** of a pulse in the same packing: Q = omega / (2 alpha v). It is read over
    # half of the column, which has room for wavelengths from 4 f_1 on.
    duration = 1.3 * packing.length / velocity
    wave = modal.propagate(packing, duration, direction=direction, damping=DAMPING)
    coherent = coherent_wave(wave.signals, packing.length)
    phase_velocity = 2 * np.pi * coherent.frequency / coherent.wavenumber
    with np.errstate(divide="ignore", invalid="ignore"):
        quality = np.pi * coherent.frequency / (coherent.attenuation * phase_velocity)
    known = (quality > 0) & (coherent.frequency > 4 * fitted.frequency)
    known &= coherent.frequency < HIGHEST
    axes[1].loglog(coherent.frequency[known] / 1e3, quality[known], f"k{mark}", ms=2.5, mfc="w")
    span = np.array([fitted.frequency, HIGHEST])
    axes[1].loglog(span / 1e3, fitted.quality * span[0] / span, "k-", lw=0.6)
    axes[1].loglog(fitted.frequency / 1e3, fitted.quality, f"k{mark}", ms=5)

axes[0].set(xlabel="frequency / $f_1$", ylabel="motion at half height / that of the base")
axes[0].legend(frameon=False)
axes[1].set(xlabel="frequency, kHz", ylabel="Q", xticks=[2, 5, 10, 20], xticklabels=[2, 5, 10, 20])
axes[1].minorticks_off()
rows = pd.DataFrame(rows)
print(rows.to_string(index=False, float_format="%.4g"))
plt.show()

if __name__ == "__main__" and len(sys.argv) == 2:
    write(sys.argv[1], {"resonant_column": figure}, {})
    columns = {
        "wave": "{wave}",
        "f_1, Hz": "{resonance:.0f}",
        "Q, fitted": "{quality:.2f}",
        "Q, half power": "{half_power:.2f}",
        "Q of the damped mode": "{of_mode:.2f}",
        "2 L f_1, m/s": "{velocity:.1f}",
        "V of the moduli, m/s": "{of_moduli:.1f}",
    }
    write_page(f"{sys.argv[1]}/resonant_column.md", rows, columns)
