"""
Frequency against wave number
=============================

A Fourier transform over time and place shows which waves a packing carries: in the crystal one
sharp branch up to the end of the band, in a random packing a ridge that widens and fades.
"""

import matplotlib.pyplot as plt
import numpy as np

import modal

packings = {
    "crystal": modal.fcc(cells=(2, 2, 60)),
    "random": modal.random_packing(2000, stress=1e5, seed=1, aspect=9),
}
figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, layout="constrained")
for ax, (name, net) in zip(axes, packings.items(), strict=True):
    record = modal.propagate(net, duration=4e-4).signals
    layers = record.layer_displacement
    window = np.hanning(len(layers))[:, None] * np.hanning(layers.shape[1])
    power = abs(np.fft.fft2(layers * window, s=(1024, 512)))
    power = np.maximum(power[:512], power[:512, (-np.arange(512)) % 512])[:, :256]
    spacing = float(np.diff(record.layer_position).mean())
    wavenumber = np.arange(256) / (512 * spacing) / 1e3
    frequency = np.arange(512) / (1024 * record.time[1]) / 1e3
    shown = power / power.max(axis=1, keepdims=True)
    ax.pcolormesh(wavenumber, frequency, shown, cmap="gray_r", rasterized=True)
    ax.set(title=name, xlabel="1 / wavelength, 1/mm", ylim=(0, 160))
crystal = modal.FccLattice()
kappa = np.linspace(0, 1.25, 100) * 1e3  # rad/m, as far as the map of the layers goes
branch = crystal.low_pass_frequency * np.sin(kappa * crystal.layer_distance / 2)
axes[0].plot(kappa / 2 / np.pi / 1e3, branch / 1e3, "r--", lw=1, label="theory")
axes[0].legend(loc="lower right")
axes[0].set_ylabel("frequency, kHz")
plt.show()
