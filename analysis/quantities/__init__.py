"""Measure quantities of a packing: one registry, in which each quantity is one function.

To add a quantity, write a function decorated with `@quantity(...)` in a module of this folder.
"""

from importlib import import_module

from analysis.quantities.registry import QUANTITIES as QUANTITIES
from analysis.quantities.registry import QUICK as QUICK

# In the order in which results are shown.
WAVES = "velocity", "passband", "scattering", "spectrum", "polarisation", "soft_modes", "gain"
for _room in *WAVES, "elasticity", "packing", "case_files", "records", "amplitude":
    import_module(f"analysis.quantities.{_room}")
