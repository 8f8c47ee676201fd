"""Prepare random packings, with and without friction, and relax them to rest.

`protocol` defines the stages of a loading path, `compression` follows this path with YADE or with
modal's own time integration, and `frictionless` minimises the enthalpy of spheres without friction.
"""
