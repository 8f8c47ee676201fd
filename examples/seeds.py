"""
How much samples differ
=======================

The error of one packing does not contain the scatter between packings. Measure several seeds: here
V_P of four packings of 600 spheres, and their mean with its standard error.
"""

import matplotlib.pyplot as plt

import analysis
import modal
from analysis.mean import mean_of_values

seeds = (1, 2, 3, 4)
velocities = []
for seed in seeds:
    packing = modal.random_packing(600, stress=1e5, seed=seed, aspect=4)
    velocities.append(analysis.measure(packing, quantities=["v_p"])["v_p"])
mean = mean_of_values(velocities)
print(f"V_P = {mean.value:.1f} +- {mean.error:.1f} m/s")
print("one packing alone: +-", ", ".join(f"{velocity.error:.1f}" for velocity in velocities))

figure, ax = plt.subplots()
numbers = [velocity.value for velocity in velocities]
errors = [velocity.error for velocity in velocities]
ax.errorbar(seeds, numbers, errors, fmt="o", label="one packing, error of the rule")
low = mean.value - mean.error
high = mean.value + mean.error
ax.axhspan(low, high, color="0.85", label="mean, standard error")
ax.set(xlabel="seed", ylabel="V_P, m/s", xticks=seeds)
ax.legend()
plt.show()
