"""Small-strain waves in sphere packings: contact network in, modes, counts and waves out.

>>> import modal
>>> net = modal.fcc(stress=1e5, cells=(2, 2, 20))
>>> low = modal.eigenmodes(net, lowest=3)
>>> low.certified
True

`modal.read` takes a packing from a file, `modal.fcc` and `modal.random_packing` make one. All other
functions take a packing; each result has named fields, a `repr`, and `plot()` where a picture is
expected. The modules behind these names are loaded when a name is first used, so that the file
formats also work inside YADE's own Python, which has neither scipy nor numba.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from modal.description import describe
    from modal.elasticity.moduli import elastic_moduli
    from modal.exchange.registry import read_packing as read
    from modal.modes.counts import count_modes
    from modal.modes.density import density_of_states
    from modal.modes.eigenmodes import eigenmodes
    from modal.packing.crystal import fcc
    from modal.packing.network import Network
    from modal.preparation.random_packing import random_packing
    from modal.theory.fcc import FccLattice
    from modal.tools.errors import InputError
    from modal.waves.propagate import propagate
    from modal.waves.response import frequency_response

__version__ = "0.1.0"
__all__ = [
    "FccLattice",
    "InputError",
    "Network",
    "count_modes",
    "density_of_states",
    "describe",
    "eigenmodes",
    "elastic_moduli",
    "fcc",
    "frequency_response",
    "propagate",
    "random_packing",
    "read",
]
_HOME = {
    "FccLattice": ("modal.theory.fcc", "FccLattice"),
    "InputError": ("modal.formats.hdf5", "InputError"),
    "Network": ("modal.packing.network", "Network"),
    "count_modes": ("modal.modes.counts", "count_modes"),
    "density_of_states": ("modal.modes.density", "density_of_states"),
    "describe": ("modal.description", "describe"),
    "eigenmodes": ("modal.modes.eigenmodes", "eigenmodes"),
    "elastic_moduli": ("modal.elasticity.moduli", "elastic_moduli"),
    "fcc": ("modal.packing.crystal", "fcc"),
    "frequency_response": ("modal.waves.response", "frequency_response"),
    "propagate": ("modal.waves.propagate", "propagate"),
    "random_packing": ("modal.preparation.random_packing", "random_packing"),
    "read": ("modal.exchange.registry", "read_packing"),
}


if not TYPE_CHECKING:  # a type checker follows the imports above and reports other names

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'modal' has no attribute {name!r}")
        module, attribute = _HOME[name]
        return getattr(importlib.import_module(module), attribute)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
