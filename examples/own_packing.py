"""
Your own packing
================

From arrays to modes: here a simple cubic block between two walls, whose contacts all have one
stiffness.
"""

import itertools
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import modal
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network, write_network

R, kn, kt, rho = 1e-3, 1e6, 8e5, 2500.0
a, b, c = 3, 3, 8
index = {place: k for k, place in enumerate(itertools.product(range(a), range(b), range(c)))}
position = np.array([[2 * R * x, 2 * R * y, R + 2 * R * z] for x, y, z in index])

# %%
# A contact is a row: indices i and j, the unit vector from i towards j, the periods added to j.

rows = []
for (x, y, z), i in index.items():
    rows.append((i, index[(x + 1) % a, y, z], (1, 0, 0), (x == a - 1, 0, 0)))
    rows.append((i, index[x, (y + 1) % b, z], (0, 1, 0), (0, y == b - 1, 0)))
    if z + 1 < c:
        rows.append((i, index[x, y, z + 1], (0, 0, 1), (0, 0, 0)))
    for wall, at, up in ((SOURCE_WALL, 0, -1), (RECEIVER_WALL, c - 1, 1)):
        if z == at:
            rows.append((i, wall, (0, 0, up), (0, 0, 0)))
i, j, normal, shift = (np.array(column) for column in zip(*rows, strict=True))
normal = normal.astype(float)

n, m, mass = len(index), len(rows), rho * 4 / 3 * np.pi * R**3
net = Network(
    position=position,
    radius=np.full(n, R),
    mass=np.full(n, mass),
    inertia=np.full(n, 0.4 * mass * R**2),
    particle_i=i,
    particle_j=j,
    normal=normal,
    lever_i=R * normal,
    lever_j=np.where((j < 0)[:, None], 0.0, -R * normal),
    stiffness_normal=np.full(m, kn),
    stiffness_tangential=np.full(m, kt),
    cell_shift=shift.astype(int),
    cell_size=2 * R * np.array([a, b, c], float),
    cell_periodic=np.array([True, True, False]),
    wall_position=np.array([0.0, 2 * R * c]),
)

# %%
# Written and read again, it is checked; then it is a packing like any other.

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "cubic.network.h5"
    write_network(path, net)
    net = modal.read(path)
print(modal.describe(net))

# %%
# Its plane P-waves are those of a chain of c masses between fixed ends.

modes = modal.eigenmodes(net, all=True)
r = np.arange(1, c + 1)
chain = np.sqrt(kn / mass) / np.pi * np.sin(np.pi * r / (2 * (c + 1)))
for f in chain:
    nearest = modes.frequency[abs(modes.frequency - f).argmin()]
    print(f"chain {f / 1e3:8.4f} kHz, mode {nearest / 1e3:8.4f} kHz")

figure, ax = plt.subplots()
ax.plot(modes.frequency / 1e3, modes.chi_z, ".", label="modes: share of motion along z")
for k, f in enumerate(chain):
    ax.axvline(f / 1e3, color="0.6", ls=":", label=None if k else "chain of 8 masses")
ax.set(xlabel="frequency, kHz", ylabel="chi_z")
ax.legend(loc="center right")
plt.show()
