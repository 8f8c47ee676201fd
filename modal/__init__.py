"""Small-strain waves in sphere packings: contact network in, modes, counts and waves out.

>>> import modal
>>> net = modal.fcc(stress=1e5, cells=(2, 2, 20))
>>> low = modal.eigenmodes(net, lowest=3)
>>> low.certified
True

`modal.read` reads a packing from a file, `modal.fcc` and `modal.random_packing` make one. All other
functions take a packing; each result has named fields, a `repr`, and `plot()` where a picture is
expected. The modules behind these names are loaded when a name is first used, so that the file
formats also work inside YADE's own Python, which has neither scipy nor numba.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from modal.description import describe as describe
    from modal.elasticity.depth import velocities_by_depth as velocities_by_depth
    from modal.elasticity.sensitivity import moduli_sensitivity as moduli_sensitivity
    from modal.elasticity.static_response import elastic_moduli as elastic_moduli
    from modal.exchange.registry import read as read
    from modal.exchange.spheres_of_arrays import from_spheres as from_spheres
    from modal.modes.counts import count_modes as count_modes
    from modal.modes.density import density_of_states as density_of_states
    from modal.modes.eigenmodes import eigenmodes as eigenmodes
    from modal.modes.sensitivity import frequency_sensitivity as frequency_sensitivity
    from modal.packing.crystal import fcc as fcc
    from modal.packing.network import RECEIVER_WALL as RECEIVER_WALL
    from modal.packing.network import SOURCE_WALL as SOURCE_WALL
    from modal.packing.network import Network as Network
    from modal.packing.network import write_network as write  # noqa: F401
    from modal.preparation.random_packing import random_packing as random_packing
    from modal.system.matrices import mass_matrix as mass_matrix
    from modal.system.matrices import stiffness_matrix as stiffness_matrix
    from modal.theory.fcc import FccLattice as FccLattice
    from modal.tools.errors import InputError as InputError
    from modal.waves.propagate import propagate as propagate
    from modal.waves.response import frequency_response as frequency_response

__version__ = "1.0.0"
__distribution__ = "granular-wave-modes"
_MODULES = {
    "FccLattice": "modal.theory.fcc",
    "InputError": "modal.tools.errors",
    "Network": "modal.packing.network",
    "RECEIVER_WALL": "modal.packing.network",
    "SOURCE_WALL": "modal.packing.network",
    "count_modes": "modal.modes.counts",
    "density_of_states": "modal.modes.density",
    "describe": "modal.description",
    "eigenmodes": "modal.modes.eigenmodes",
    "elastic_moduli": "modal.elasticity.static_response",
    "fcc": "modal.packing.crystal",
    "frequency_response": "modal.waves.response",
    "frequency_sensitivity": "modal.modes.sensitivity",
    "from_spheres": "modal.exchange.spheres_of_arrays",
    "mass_matrix": "modal.system.matrices",
    "moduli_sensitivity": "modal.elasticity.sensitivity",
    "propagate": "modal.waves.propagate",
    "random_packing": "modal.preparation.random_packing",
    "read": "modal.exchange.registry",
    "stiffness_matrix": "modal.system.matrices",
    "velocities_by_depth": "modal.elasticity.depth",
    "write": "modal.packing.network:write_network",
}
"""Module of each public name, and its name there after a colon if that is another one."""
__all__ = [*_MODULES]


if not TYPE_CHECKING:  # a type checker follows the imports above and reports other names

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module 'modal' has no attribute {name!r}")
        module, _, inner_name = _MODULES[name].partition(":")
        return getattr(importlib.import_module(module), inner_name or name)


def __dir__() -> list[str]:
    return sorted(__all__)
