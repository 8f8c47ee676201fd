"""How wide the lines of a packing's spectra are: a part of its highest frequency."""

from __future__ import annotations

import numpy as np

from modal.packing.network import Network
from modal.solvers.spectrum import bound_of_spectrum
from modal.system.operator import ContactOperator

LINE = 0.005
"""Width of a line of the structure factor and of the density of states, in parts of the highest
frequency: 1 kHz in the study's packings under 100 kPa."""


def line_width(network: Network) -> float:
    """`LINE` of the highest frequency, Hz, to three digits: an iteration bounds it."""
    top, _ = bound_of_spectrum(ContactOperator(network, mass_scaled=True))
    return float(f"{LINE * np.sqrt(top) / (2 * np.pi):.3g}")
