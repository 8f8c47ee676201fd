"""
Density of states, and the low-pass
===================================

A packing has modes up to some 200 kHz. Waves pass only up to a small part of that: disorder, not
the end of the spectrum, is the filter.
"""

import matplotlib.pyplot as plt
import numpy as np

import modal

net = modal.random_packing(spheres=2000, stress=1e5, seed=1, aspect=12)
states = modal.density_of_states(net, resolution=8e3)
print(states)
ax = states.plot()
ax.set_title("all modes")
plt.show()

# %%
# The spectra of the chain from the source wall to the receiver wall: close to the source every
# frequency of the pulse is there, far away the low ones alone.

signals = modal.propagate(net, duration=2.5e-4, interval=5e-7).signals
order = np.argsort(signals.chain_position)
frequency = np.fft.rfftfreq(len(signals.time), 5e-7)
# The record ends in the middle of the motion; a smooth end leaves no false high frequencies.
end = np.cos(np.pi / 2 * np.clip(np.linspace(-2, 1, len(signals.time)), 0, 1)) ** 2
motion = signals.chain_displacement[:, order] * end[:, None]
spectrum = abs(np.fft.rfft(motion, axis=0)) * 5e-7

figure, ax = plt.subplots()
for share in (0.05, 0.3, 0.6, 0.9):
    k = int(share * len(order))
    z = signals.chain_position[order[k]]
    ax.semilogy(frequency / 1e3, spectrum[:, k] * 1e15, label=f"z = {z * 1e3:.0f} mm")
ax.set(xlim=(0, 200), ylim=(1e-4, None), xlabel="frequency, kHz", ylabel="|U_z|, nm us")
ax.legend()
plt.show()

# %%
# Half of all modes lie above this frequency:

grid = states.grid()
below = states.count_below(grid)[0][:, 6]
print(f"{np.interp(0.5 * below[-1], below, grid) / 1e3:.0f} kHz")
