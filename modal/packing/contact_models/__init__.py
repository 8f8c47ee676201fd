"""Find contact models by name, one class a module: force, energy and tangent of a contact.

The name of a model is that of its module, with hyphens; the class is the module's `LAW`: a named
tuple of the numbers that one contact needs, or of arrays (m,) for many. Its methods take the
overlap, m, and the effective radius R1 R2 / (R1 + R2), m, and return

- `normal_force`: the compressive force, N;
- `elastic_energy`: the work of this force from touch on, J;
- `stiffness_normal`: its tangent, N/m;
- `stiffness_tangential`: the tangent along the contact without slip, N/m;

and `overlap_of_force` returns the overlap of a force, N. A model may have more:

- `friction_force`: the force, N, whose product with the coefficient of friction bounds the shear
  force, where this is not the normal force, because adhesion presses the surfaces together;
- `rupture_distance`, of the effective radius alone: the gap, m, up to which a contact that has
  formed at touch goes on to act. Its other functions then take negative overlaps;
- `stiffness_rolling` and `stiffness_twisting`, N m/rad, with `rolling_limit` and `twisting_limit`,
  N m: the springs of a contact that resists turns by itself, and the moments at which they yield.

All methods are plain functions of numbers or arrays, because the loop over moving contacts is
compiled from them: they may call functions of their module, but no other methods. `own_numbers`
converts the numbers after a model's name to its parameters. Networks, crystals, pre-stress and
samples from files get the laws from `laws_of`, the only function that knows all models.
"""

import importlib
import pkgutil
from typing import Any

import numpy as np

from modal.packing.contact_law import Elasticity, Material
from modal.tools.arrays import Bools
from modal.tools.errors import InputError

MODELS = tuple(sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__)))
"""Names of the contact models."""

ContactLaw = Any
"""The law of one contact, or of many: an instance of a model's class `LAW`."""


def laws_of(spheres: Material, walls: Elasticity | None = None) -> tuple[ContactLaw, ContactLaw]:
    """Return the contact law between two spheres, and between a sphere and a wall.

    Walls are of the spheres' material by default. Raises InputError for an unknown contact model,
    or for a wrong number of parameters.

    >>> from modal.packing.contact_law import GLASS
    >>> pair, wall = laws_of(GLASS)
    >>> float(pair.overlap_of_force(pair.normal_force(1e-6, 6e-4), 6e-4))
    1e-06
    """
    name, *words = spheres.contact_model.split() or [""]
    if name not in MODELS:
        raise InputError(
            "contact_model",
            f"contact model {name!r}",
            f"there are {', '.join(MODELS)}",
            "choose one",
        )
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise InputError(
            "contact_model_numbers",
            f"contact model {spheres.contact_model}",
            remedy="give numbers after its name",
        ) from None
    law = importlib.import_module(f"{__name__}.{name.replace('-', '_')}").LAW
    takes_numbers = hasattr(law, "own_numbers")
    if numbers and not takes_numbers:
        raise InputError(
            "contact_model_numbers",
            f"contact model {name} takes no numbers",
            remedy=f"leave {numbers[0]:g} out",
        )
    pair_numbers = []
    wall_numbers = []
    if takes_numbers:
        pair_numbers = law.own_numbers(numbers, wall=False)
        wall_numbers = law.own_numbers(numbers, wall=True)
    pair = law(*spheres.moduli, *pair_numbers)
    wall = law(*spheres.against(walls or spheres), *wall_numbers)
    return pair, wall


def friction_force(law: ContactLaw, overlap: Any, radius: Any) -> Any:
    """Return the force, N, that friction is proportional to: by the law, or the normal force.

    `overlap` and effective `radius`, m, are numbers or (m,).
    """
    if hasattr(law, "friction_force"):
        return law.friction_force(overlap, radius)
    return law.normal_force(overlap, radius)


def rupture_distance(law: ContactLaw, radius: Any) -> Any:
    """Return the gap, m, up to which existing contacts act; 0 for most models."""
    if hasattr(law, "rupture_distance"):
        return law.rupture_distance(radius)
    return 0.0 * radius


def acts_across_gaps(law: ContactLaw) -> bool:
    """Return whether existing contacts of a law still act across a gap."""
    return hasattr(law, "rupture_distance")


def turning_stiffnesses(
    law: ContactLaw, overlap: Any, radius: Any, rolling: float, twisting: float
) -> tuple[Any, Any]:
    """Return the stiffnesses against rolling and twisting, N m/rad, each a number or (m,).

    If the law has none, the stiffnesses are those of rough or angular grains: the tangential
    stiffness on arcs of the effective radius (K. Iwashita, M. Oda, J. Eng. Mech. 124, 285, 1998; J.
    Ai et al., Powder Technol. 206, 269, 2011). In this case a coefficient `rolling` or `twisting`
    of 0 gives no stiffness.
    """
    if resists_turning(law):
        return law.stiffness_rolling(overlap, radius), law.stiffness_twisting(overlap, radius)
    stiffness = law.stiffness_tangential(overlap, radius) * radius * radius
    return stiffness * (rolling > 0), stiffness * (twisting > 0)


def turning_limits(law: ContactLaw, overlap: Any, radius: Any) -> tuple[Any, Any]:
    """Return the law's own limits, N m, of rolling and twisting moments; 0 for most laws."""
    if resists_turning(law):
        return law.rolling_limit(overlap, radius), law.twisting_limit(overlap, radius)
    return 0.0 * radius, 0.0 * radius


def resists_turning(law: ContactLaw) -> bool:
    """Return whether a law itself, without coefficients, resists rolling and twisting."""
    return hasattr(law, "stiffness_rolling")


def law_of_each(laws: tuple[ContactLaw, ContactLaw], wall: Bools) -> ContactLaw:
    """Return the law with parameters of each contact; `wall` (m,) marks contacts with a wall."""
    pair_law, wall_law = laws
    columns = [
        np.where(wall, wall_number, pair_number)
        for wall_number, pair_number in zip(wall_law, pair_law, strict=True)
    ]
    return type(pair_law)(*columns)
