"""
A bench test
============

Two transducers in a packing of 1,000 spheres: what do the rules of laboratories read from the
traces, and what is true? The answer is known here, from the elastic moduli.
"""

import matplotlib.pyplot as plt
import pandas as pd

import analysis
import modal

# %%
# **The specimen**: spheres between two walls at 100 kPa, eight times as long as wide.

packing = modal.random_packing(1000, stress=1e5, seed=1, aspect=8)
print(modal.describe(packing))

# %%
# **The test.** One period of a sine along x, sent and received by discs 15 mm from each other.

low, high = 0.004, 0.019  # m
test = analysis.transducers(packing, (low, high), [1e4, 2e4, 4e4])
print(f"by the moduli: V_S {test.v_s:.0f} m/s, V_P {test.v_p:.0f} m/s")

# %%
# **What the rules read.** Near field is the distance over the wavelength; below 2 the S-wave has
# not left the P-wave behind.

rows = [
    {
        "rule": row.rule.replace("_", " "),
        "frequency, kHz": row.frequency / 1e3,
        "V_S, m/s": row.velocity.value,
        "over that of the moduli": row.velocity.value / test.v_s,
        "near field": row.near_field,
        "caveats": ", ".join(row.velocity.codes),
    }
    for row in test.rows
]
table = pd.DataFrame(rows)
pd.set_option("display.max_colwidth", None)  # all caveats
table.round(3)

# %%
# **A picture**: which rule is off by how much, at which frequency.

figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
for rule, readings in table.groupby("rule", sort=False):
    x = readings["frequency, kHz"]
    axes.plot(x, readings["over that of the moduli"], "o-", ms=4, lw=0.7, label=rule)
axes.axhline(1, color="k", lw=0.6)
axes.set(xlabel="frequency of the burst, kHz", ylabel="V_S over that of the moduli")
axes.legend(frameon=False, fontsize=7)
plt.show()
