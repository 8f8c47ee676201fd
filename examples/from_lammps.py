"""
A packing of LAMMPS
===================

120 spheres with friction, written by LAMMPS. They are imported, and the lowest modes of the springs
are compared with what the contact model of LAMMPS adds to them.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt

import modal
from modal.modes.first_order import shift_by_law

files = Path(sys.argv[0]).resolve().parent / "packings"
contacts, log = str(files / "mine.contacts"), str(files / "log.lammps")
net = modal.read(files / "mine.atoms", contacts=contacts, log=log)
low = modal.eigenmodes(net, lowest=15)

figure, ax = plt.subplots()
ax.plot(low.frequency / 1e3, shift_by_law(net, low) / low.frequency * 100, "o")
ax.axhline(0, color="0.6", lw=0.8)
ax.set(xlabel="frequency of the springs, kHz", ylabel="added by the contact model, %")
plt.show()
