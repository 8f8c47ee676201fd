"""How random packings are made, with friction and without, and brought to rest.

With friction: `protocol`, its `cloud`, and the stages of `compression`, which need numpy alone, as
YADE's script and modal's own motion go through them the same way; without friction:
`random_packing`.
"""
