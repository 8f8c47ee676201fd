"""
How much samples differ
=======================

The error of one packing does not hold the scatter between packings. Measure several seeds: here
V_P of four packings of 600 spheres, and their mean with its standard error.
"""

import matplotlib.pyplot as plt
import numpy as np

import analysis
import modal

seeds = (1, 2, 3, 4)
found = [
    analysis.measure(modal.random_packing(600, stress=1e5, seed=s, aspect=4), quantities=["v_p"])
    for s in seeds
]
speed = np.array([each["v_p"].value for each in found])
error = np.array([each["v_p"].error for each in found])
mean, of_mean = speed.mean(), speed.std(ddof=1) / len(speed) ** 0.5
print(f"V_P = {mean:.1f} +- {of_mean:.1f} m/s; one packing alone: +- {error.mean():.1f}")

figure, ax = plt.subplots()
ax.errorbar(seeds, speed, error, fmt="o", label="one packing, error of the rule")
ax.axhspan(mean - of_mean, mean + of_mean, color="0.85", label="mean, standard error")
ax.set(xlabel="seed", ylabel="V_P, m/s", xticks=seeds)
ax.legend()
plt.show()
