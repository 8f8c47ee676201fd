"""How random packings with friction are made: the protocol, its cloud, and the loop that runs it.

`protocol` and `cloud` need numpy alone: YADE's script and modal's own loop walk the same way.
"""
