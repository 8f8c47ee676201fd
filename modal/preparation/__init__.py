"""Preparation of random packings, with and without friction, and their relaxation to rest.

`protocol` defines the stages of a loading path, `compression` follows it in the motion of YADE or
of modal, and `frictionless` minimises the enthalpy of spheres without friction.
"""
