"""How random packings are made, with friction and without, and brought to rest.

With friction: `protocol`, its `cloud`, and the loop in `compress`; without: `random_packing`.
`protocol` and `cloud` need numpy alone: YADE's script and modal's own loop compress the same way.
"""
