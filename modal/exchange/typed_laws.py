"""Contact laws of spheres and walls as they are typed, and what they say of forces alone."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from modal.exchange import dump, lammps, liggghts
from modal.exchange.input_script import Script
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.particles_and_contacts import Packing, PairLaw
from modal.packing.scan import ForceLaw
from modal.tools.errors import InputError


class TypedLaws(NamedTuple):
    """Contact laws from a line that the user typed.

    pair_law: function that returns the law between two types of sphere. walls: the walls with their
    own laws. notes: friction and, for hertz/material, Young's modulus and Poisson's ratio by name.
    """

    pair_law: PairLaw
    walls: dump.Walls
    remarks: list[str]
    notes: dict[str, float]

    def between(self, first: int, second: int) -> ProgramLaw:
        """Return the law between two types of sphere, or between a wall and a type."""
        if first < 0:
            return self.walls[first].law(second)
        return self.pair_law(first, second)


def read_typed_laws(pair: str, wall: str | None, units: Units) -> TypedLaws:
    """Return the laws of the lines --pair and --wall, in the words of LAMMPS or LIGGGHTS.

    A wall without a law of its own (only `zplane LOW HIGH`) has the law of the spheres.
    """
    typed = lammps.parse_typed_pair(pair)
    program = liggghts if typed.style[0] == "gran" else lammps
    words = [typed.style[0], *(typed.coefficients[2:] or typed.style[1:])]
    script = Script(style=typed.style, pair_coefficients=[typed.coefficients])
    if wall:
        wall_words = wall.split()
        if wall_words[0] == "zplane" and program is lammps:
            wall_words = [*words, *wall_words]
        script.walls = {dump.TYPED_WALL: tuple(wall_words)}
    pair_law = program.read_pair_law(script, units)
    read_wall_law = partial(program.read_wall_law, script=script, units=units, pair_law=pair_law)
    walls = dump.read_walls(script, units, read_wall_law, program.PLANES_PER_FIX)
    notes = {"mu_wave": pair_law(dump.ONLY_TYPE, dump.ONLY_TYPE).friction}
    is_material = words[1:2] == ["hertz/material"] and "tangential mindlin" in pair
    if is_material and words[words.index("tangential") + 2] == "NULL":
        notes |= {"young": units.pressure * float(words[2]), "poisson": float(words[4])}
    return TypedLaws(pair_law, walls, script.remarks, notes)


def force_law(laws: TypedLaws, packing: Packing) -> ForceLaw:
    """Return how contact stiffness depends on the force, by the laws of spheres and walls.

    Raises InputError if spheres have several laws, or if a wall has a law of another kind.
    """
    kinds = sorted(set(packing.kind.tolist()))
    sphere_law = laws.pair_law(kinds[0], kinds[0])
    normal, normal_power, tangential, tangential_power = _by_force(sphere_law)
    wall_normal = normal
    wall_tangential = tangential
    for wall in laws.walls.values():
        wall_normal, *wall_powers, wall_tangential, last_power = _by_force(wall.law(kinds[0]))
        if (*wall_powers, last_power) != (normal_power, tangential_power):
            wall_problem = "the law of a wall is of another kind than that of the spheres"
            raise InputError("other_law", wall_problem, remedy="give both Hertz, or both hooke")
    return ForceLaw(
        normal, tangential, wall_normal, wall_tangential, normal_power, tangential_power
    )


def _by_force(law: ProgramLaw) -> tuple[float, float, float, float]:
    """Return coefficient and power of the normal, then of the tangential stiffness, by force.

    For Hertz' law f = N sqrt(R*) overlap^(3/2) the radius of the circle of contact is a = (R* f /
    N)^(1/3). The normal stiffness is 3/2 N a, and the tangential stiffness T a.
    """
    if law.hertz:
        power = 1 / 3
        coefficient = 1.5 * law.normal ** (2 / 3)
        radius_coefficient = law.normal ** (-1 / 3)
    else:
        power = 0.0
        coefficient = law.normal
        radius_coefficient = law.normal**-0.5
    if not law.grows:
        return coefficient, power, law.tangential, 0.0
    tangential_power = 1 / 3 if law.hertz else 0.5
    return coefficient, power, law.tangential * radius_coefficient, tangential_power
