"""
P-wave and S-wave
=================

The source wall moves along z and sends a P-wave, or slides along x and sends an S-wave, which is
slower. The dashed lines have the velocities that follow from the elastic moduli.
"""

import matplotlib.pyplot as plt
import numpy as np

import modal

net = modal.random_packing(1500, stress=1e5, seed=1, aspect=6)
v_p, v_s, _ = modal.elastic_moduli(net).velocities((0, 0, 1))

figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
for ax, direction, speed in zip(axes, "zx", (v_p, v_s), strict=True):
    modal.propagate(net, duration=2.5e-4, direction=direction).plot(ax)
    t = np.array([5e-6, 5e-6 + net.length / speed])  # the pulse is highest after 5 us
    ax.plot(1e6 * t, [0, 1e3 * net.length], "k--", lw=1)
    ax.set_title(f"wall along {direction}: {speed:.0f} m/s")
plt.show()
