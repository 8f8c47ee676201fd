"""
Viscous contacts
================

A dashpot beside each spring damps the wave. With a share of the critical damping that is equal
along and across the contact, the quality factor falls as 1 / f.
"""

import matplotlib.pyplot as plt
import numpy as np

import modal
from modal.modes.damped import decay_rates
from modal.system.damping import ContactDamping

net = modal.random_packing(500, stress=1e5, seed=1, aspect=4)
damping = ContactDamping(normal=0.05, tangential=0.05)
modes = modal.eigenmodes(net, all=True)
quality = np.pi * modes.frequency / decay_rates(modes, net, damping)
quality[modes.frequency < 10] = np.nan  # floppy modes have neither frequency nor decay

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
left.loglog(modes.frequency / 1e3, quality, ".", ms=2)
left.set(xlabel="frequency, kHz", ylabel="quality factor")
for given, name in ((None, "elastic"), (damping, "viscous")):
    record = modal.propagate(net, duration=1e-4, damping=given).signals
    middle = len(record.layer_position) // 2
    right.plot(record.time * 1e6, record.layer_displacement[:, middle] * 1e9, label=name)
right.set(xlabel="time, us", ylabel="u_z in the middle, nm")
right.legend()
plt.show()
