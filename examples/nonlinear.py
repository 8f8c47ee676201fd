"""
A wave that is not small
========================

The linear wave is the limit of small amplitudes. With the full contact model contacts slide, open
and close. Here a pulse moves the wall by a tenth, a third and the whole of a mean overlap. Each
motion is drawn over its amplitude.
"""

import matplotlib.pyplot as plt

import modal
from modal.waves.motions import Pulse

net = modal.random_packing(400, stress=1e5, seed=1, aspect=4)
overlap = float(net.overlap.mean())
figure, ax = plt.subplots()
linear = modal.propagate(net, duration=8e-5, motion=Pulse(overlap, 1e5)).signals
middle = len(linear.layer_position) // 2
time = linear.time * 1e6
ax.plot(time, linear.layer_displacement[:, middle] / overlap, "k--", label="linear")
for share in (0.1, 0.3, 1):
    wave = modal.propagate(
        net, 8e-5, nonlinear=True, friction=0.5, motion=Pulse(share * overlap, 1e5)
    )
    moved = wave.signals.layer_displacement[:, middle] / (share * overlap)
    ax.plot(wave.signals.time * 1e6, moved, label=f"amplitude {share:g} of the mean overlap")
ax.set(xlabel="time, us", ylabel="u_z in the middle / amplitude")
ax.legend()
plt.show()
