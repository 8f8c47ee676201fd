"""Describe sources of waves, and receivers: walls, planes, single spheres, discs of spheres.

>>> import modal
>>> from modal.sources import Disc
>>> crystal = modal.fcc(cells=(2, 2, 20))
>>> modal.propagate(crystal, 2e-5, source=Disc((0, 0, 0), 0.003, "x")).signals.direction
'x'
"""

from modal.waves.discs import Disc
from modal.waves.sources import Plane, Point, RoughWall, Source, Wall

__all__ = ["Disc", "Plane", "Point", "RoughWall", "Source", "Wall"]
