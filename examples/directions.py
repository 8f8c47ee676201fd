"""
Waves in all directions
=======================

The stiffness tensor gives the three velocities along any direction. The crystal is anisotropic; a
random packing is nearly isotropic.
"""

import matplotlib.pyplot as plt
import numpy as np

import modal

packings = {
    "crystal": modal.fcc(cells=(4, 4, 6), periodic_z=True),
    "random": modal.random_packing(1500, stress=1e5, seed=1),
}
angle = np.linspace(0, 2 * np.pi, 121)
figure, axes = plt.subplots(
    1, 2, figsize=(8, 4.4), subplot_kw={"projection": "polar"}, layout="constrained"
)
for ax, (name, packing) in zip(axes, packings.items(), strict=True):
    moduli = modal.elastic_moduli(packing)
    speeds = np.array([moduli.velocities((np.sin(a), 0, np.cos(a))) for a in angle])
    ax.plot(angle, speeds, label=["V_P", "V_S, one", "V_S, other"])
    ax.set_rticks([200, 400, 600])
    ax.set_title(f"{name}, m/s\nanisotropy {moduli.anisotropy:.3f}")
axes[0].legend(loc="center")
plt.show()
