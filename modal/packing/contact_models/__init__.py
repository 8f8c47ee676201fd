"""Contact models by name, one class a module: force, energy and tangent of a contact of spheres.

A module's name with hyphens is that of its model, its `LAW` the class: a named tuple of what one
contact needs, or many (arrays (m,)). Its methods take the overlap, m, and the effective radius, m,
R1 R2 / (R1 + R2): `normal_force`, compressive, N; `elastic_energy`, its work from touch on, J;
`stiffness_normal`, its tangent, N/m; `stiffness_tangential`, along the contact without slip, N/m;
and `overlap_of_force`, of a force, N, the inverse of the first. They are plain functions of numbers
or of arrays, from which the loop over moving contacts is compiled, too: they may call `elementwise`
functions of their module, and no other methods. What it needs beside E* and G*, `own_numbers` makes
of the numbers behind the model's name. Networks, crystals, pre-stress, and samples from files take
them from `laws_of`; nothing else knows which models there are.
"""

import importlib
import pkgutil
from typing import Any

import numpy as np

from modal.packing.contact_law import Elasticity, Material
from modal.tools.arrays import Bools
from modal.tools.errors import InputError

MODELS = tuple(sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__)))
"""Their names."""


ContactLaw = Any
"""The law of one contact, or of many: a `LAW`."""


def laws_of(spheres: Material, walls: Elasticity | None = None) -> tuple[ContactLaw, ContactLaw]:
    """The law between two spheres, and that of a sphere and a wall, of its own material if any.

    InputError for a contact model that there is not, or numbers that it does not take.

    >>> from modal.packing.contact_law import GLASS
    >>> pair, wall = laws_of(GLASS)
    >>> float(pair.overlap_of_force(pair.normal_force(1e-6, 6e-4), 6e-4))
    1e-06
    """
    name, *words = spheres.contact_model.split() or [""]
    if name not in MODELS:
        raise InputError(f"contact model {name!r}: there are {', '.join(MODELS)}; choose one")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise InputError(
            f"contact model {spheres.contact_model}: give numbers after its name"
        ) from None
    law = importlib.import_module(f"{__name__}.{name.replace('-', '_')}").LAW
    own = getattr(law, "own_numbers", None)
    if numbers and own is None:
        raise InputError(f"contact model {name} takes no numbers: leave {numbers[0]:g} out")
    sides = (spheres.moduli, False), (spheres.against(walls or spheres), True)
    pair, wall = (law(*moduli, *(own(numbers, flat) if own else ())) for moduli, flat in sides)
    return pair, wall


def law_of_each(laws: tuple[ContactLaw, ContactLaw], wall: Bools) -> Any:
    """The law of many contacts, of which those in `wall` (m,) bool are with a wall."""
    of_pairs, of_walls = laws
    columns = zip(of_walls, of_pairs, strict=True)
    return type(of_pairs)(*(np.where(wall, flat, curved) for flat, curved in columns))
