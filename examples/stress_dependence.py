"""
Velocity against stress
=======================

Hertz's contacts become stiffer under load. In the crystal V_P grows as the power 1/6 of the stress.
In a random packing it grows a little faster, since the stress also makes new contacts.
"""

import matplotlib.pyplot as plt
import numpy as np

import modal

stresses = np.array([1e4, 1e5, 1e6])
crystal = [modal.FccLattice(stress=s).velocity for s in stresses]
random = [modal.elastic_moduli(modal.random_packing(1000, stress=s, seed=1)).v_p for s in stresses]

figure, ax = plt.subplots()
for name, speed, mark in (("crystal, theory", crystal, "s-"), ("1,000 spheres", random, "o-")):
    power = np.polyfit(np.log(stresses), np.log(speed), 1)[0]
    ax.loglog(stresses / 1e3, speed, mark, label=f"{name}: power {power:.3f}")
ax.set(xlabel="stress, kPa", ylabel="V_P, m/s")
ax.legend()
plt.show()
