"""How random packings are made, with friction and without, and brought to rest.

`protocol` has the stages of a path and `compression` goes through them, in YADE's motion or modal's
own; without friction these are descents of the enthalpy (`frictionless`).
"""
