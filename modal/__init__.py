"""Eigenmodes of granular packings: contact network in, frequencies and mode shapes out.

The file-format modules (storage, network, signals) and the contact law (hertz_mindlin) need
numpy and h5py alone, so that they also run inside YADE's own interpreter.
"""

__version__ = "0.1.0"
