"""
Your own packing
================

Centres and radii alone, as a tomograph gives them: contacts by a gap, stiffnesses from the stress,
moduli, spectrum. The table has 3,000 glass beads whose centres are off by 1 % of the radius; put
your own in its place.
"""

import matplotlib.pyplot as plt
import pandas as pd
from _committed import RESULTS

import analysis
import modal

TABLE = RESULTS.parent / "examples/packings/scan.csv.gz"
CELL = (34.4056e-3, 34.2451e-3, 33.8245e-3)  # m, periods; the table's first line has them

# %%
# **Read the table.** Lengths are in mm there, and in m from here on.

beads = pd.read_csv(TABLE, comment="#") / 1e3
beads.columns = ["x, m", "y, m", "z, m", "radius, m"]
beads.head()

# %%
# **Make a packing of it.** Beads touch if their gap is below 40 um. Overlaps drown in the noise, so
# that the stiffness of the contacts follows from the mean stress, 100 kPa.

packing = modal.from_spheres(
    beads.iloc[:, :3],
    beads["radius, m"],
    cell=CELL,
    law="granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.5",
    stress=1e5,
    tolerance=4e-5,
)
print(modal.describe(packing))

# %%
# **Measure it.** The beads were taken from a packing whose V_P is 548 m/s and V_S 360 m/s. The
# errors contain what other gaps would change.

quantities = ["coordination", "v_p_moduli", "v_s_moduli", "bulk_modulus", "shear_modulus"]
analysis.measure(packing, quantities=quantities)

# %%
# **Its spectrum**: the number of modes per frequency. Single modes do not follow from a scan, and
# `modal.eigenmodes` refuses it; `granular-modes relax --stress` first makes a state at rest of it.

density = modal.density_of_states(packing)
density.plot()
plt.show()
