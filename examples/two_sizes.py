"""
Spheres of two sizes
====================

A mixture has a wider spectrum: small spheres are light and move at high frequencies.
"""

import matplotlib.pyplot as plt

import modal

figure, ax = plt.subplots()
for sizes, name in (
    (None, "one size"),
    (("two", 2, 0.5), "two sizes, 1:2, half of the volume each"),
):
    net = modal.random_packing(1000, stress=1e5, seed=1, sizes=sizes)
    states = modal.density_of_states(net, resolution=1e4)
    grid = states.grid()
    ax.plot(grid / 1e3, states.density(grid)[0][:, 6] * 1e3 / net.n_particles, label=name)
ax.set(xlabel="frequency, kHz", ylabel="modes per kHz and sphere")
ax.legend()
plt.show()
