"""A program that uses modal, which mypy checks with modal itself: types of results, and mistakes.

It does not run. mypy reports each ignored mistake that it no longer finds.
"""

from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import modal
from analysis.estimators.coherent import Coherent
from analysis.packing_data import PackingData
from analysis.quantities.velocity import coherent
from modal.modes.density import DensityOfStates
from modal.modes.mode_set import ModeSet
from modal.packing.network import Network
from modal.waves.nonlinear import NonlinearWave
from modal.waves.propagate import LinearWave
from modal.waves.response import Response

net = modal.read("case06.sample.h5")
assert_type(net, Network)
assert_type(net.position, NDArray[np.float64])
assert_type(modal.fcc(cells=(2, 2, 20)), Network)
assert_type(modal.eigenmodes(net, lowest=3), ModeSet)
assert_type(modal.eigenmodes(net, lowest=3).frequency, NDArray[np.float64])
assert_type(modal.density_of_states(net), DensityOfStates)
assert_type(modal.propagate(net, duration=1e-4), LinearWave)
assert_type(modal.frequency_response(net), Response)
assert_type(modal.FccLattice(stress=1e5).low_pass_frequency, float)
modal.eigenmodes(net, lowest="three")  # type: ignore[arg-type]
modal.eigenmode(net)  # type: ignore[attr-defined]
packing = PackingData(net)
assert_type(coherent(packing, "wave", decay=5.0), Coherent)
coherent(packing, "wave", damping=5.0)  # type: ignore[call-arg]
coherent(packing, 5.0)  # type: ignore[arg-type]
assert_type(modal.propagate(net, 1e-5, nonlinear=True, friction=0.3), NonlinearWave)
modal.propagate(net, 1e-5, directon="x")  # type: ignore[call-overload]
modal.propagate(net, 1e-5, tolerence="small")  # type: ignore[call-overload]
modal.propagate(net, 1e-5, tolerance="small")  # type: ignore[call-overload]
modal.propagate(net, 1e-5, direction="w")  # type: ignore[call-overload]
modal.propagate(net, 1e-5, friction=0.3)  # type: ignore[call-overload]
modal.propagate(net, 1e-5, nonlinear=True, whole=True)  # type: ignore[call-overload]
modal.frequency_response(net, direction="w")  # type: ignore[arg-type]
modal.frequency_response(net, resolutoin=1e3)  # type: ignore[call-arg]
modal.fcc(sells=(1, 1, 4))  # type: ignore[call-arg]
modal.random_packing(sphere=100)  # type: ignore[call-arg]
modal.random_packing(friction="rough")  # type: ignore[arg-type]
