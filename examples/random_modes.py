"""
A random packing's modes
========================

A packing of 300 spheres, its lowest modes, and the motions that cost no energy at all.
"""

import matplotlib.pyplot as plt
import numpy as np

import modal

net = modal.random_packing(spheres=300, stress=1e5, seed=2)
print(modal.describe(net))

# %%
# The floppy modes are those of rattlers; they are counted, and not in the list. That no other mode
# is missing is known from an exact count.

low = modal.eigenmodes(net, lowest=30)
print(low)
assert low.certified

# %%
# ``chi_z`` is the share of a mode's motion that points along the packing. A crystal's modes have
# 0 or 1; disorder mixes them.

ax = low.plot()
ax.set_title("share of motion along z")
plt.show()

# %%
# The mode whose motion along z is most like half a sine is nearly the first standing wave of the
# column, with the disorder of its grains.

z = net.position[:, 2]
half_sine = np.sin(np.pi * z / net.length)
along_sine = low.mode_shape[:, :, 2] @ half_sine / (half_sine @ half_sine)
k = int(np.argmax(abs(along_sine)))
shape = low.mode_shape[k][:, 2] / along_sine[k]
figure, ax = plt.subplots()
ax.plot(z * 1e3, shape, ".")
inside = np.linspace(0, net.length, 100)
ax.plot(inside * 1e3, np.sin(np.pi * inside / net.length), label="half a sine")
ax.set(
    xlabel="z, mm",
    ylabel="u_z over its sine's height",
    title=f"mode {k + 1}, {low.frequency[k] / 1e3:.2f} kHz",
)
ax.legend()
plt.show()
