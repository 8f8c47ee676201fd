"""Translate restart files of old versions of MercuryDPM (restart_version 3) to the new format.

Old lines have numbers without names: a particle is its kind (BP, or TSP BP), position, velocity,
radius, angles, angular velocity, 1/mass, 1/inertia and species. A species is a linear law, `k`,
`kt`, `mu`, and lines that end in (mixed) are laws between this species and each earlier one.
"""

from collections.abc import Iterator
from pathlib import Path

from modal.exchange.lines import Lines
from modal.exchange.words import Words

BEGINNING = b"restart_version"
"""First bytes of such a file."""
COUNTED = ("Species", "Walls", "WallsPeriodic", "Boundaries", "Particles")
"""First words of lines that begin a section and state the number of its lines."""
PARTICLE_KINDS = ("TSP", "BP")
"""Words that may stand before the numbers of a particle."""
PARTICLE_NUMBERS = 16
"""Numbers of a particle; those of its springs may follow."""
SPECIES_NAME = "LinearViscoelasticSlidingFriction"
"""Name of the law of all old species in new files."""


def is_old(head: bytes) -> bool:
    """Tell whether a file that begins with `head` is of the old format, with numbers without names.

    Version 1.0, which came after version 3, begins with the old keyword but has names.

    >>> is_old(b"restart_version 3")
    True
    >>> is_old(b"restart_version 1.0 name a xMin 0")
    False
    """
    return head.startswith(BEGINNING) and b"xMin" not in head


def new_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the number and the text of each line, translated to the new format."""
    section = ""
    remaining = 0
    count = 0
    species = -1
    for number, text in Lines(path):
        words = text.split()
        line = Words(words, f"{path}, line {number}", "write the restart file whole")
        if not words:
            continue
        if words[0] in COUNTED:
            section = words[0]
            remaining = int(line.number_after(section))
            count = 0
            title = "Boundaries" if section == "WallsPeriodic" else section
            yield number, f"{title} {remaining}"
        elif section == "Species" and words[0] == "k":
            if words[-1] == "(mixed)":
                yield number, _mixed_species(line, count, species)
                count += 1
            else:
                species += 1
                count = 0
                yield number, _species(line, species)
        elif section and remaining > 0:
            count += 1
            remaining -= 1
            yield number, _member(line, section, count - 1)
        elif words[0] == "xmin":
            yield number, text.replace("min", "Min").replace("max", "Max")
        elif words[0] == "dim":
            yield number, f"systemDimensions {words[1]} particleDimensions 3"


def _species(line: Words, number: int) -> str:
    """Return the line, in the new format, of the law of a species with itself."""
    if line.optional_number_after("dim_particle") == 2:
        line.refuse(
            "two_dimensions",
            "dim_particle 2",
            "discs",
            "a network has spheres that move in space (3)",
        )
    return f"{SPECIES_NAME}Species id {number} {_law(line)}"


def _mixed_species(line: Words, number: int, species: int) -> str:
    """Return the line, in the new format, of the law between a species and an earlier one."""
    return f"{SPECIES_NAME}MixedSpecies idMixed {number} {species} {_law(line)}"


def _law(line: Words) -> str:
    """Return the constants of a law, in the names of new files."""
    return (
        f"stiffness {line.words_after('k', 1)[0]} "
        f"slidingStiffness {line.words_after('kt', 1)[0]} "
        f"slidingFrictionCoefficient {line.words_after('mu', 1)[0]}"
    )


def _member(line: Words, section: str, number: int) -> str:
    """Return the line, in the new format, of a wall, a boundary or a particle."""
    if section == "Walls":
        return _wall(line, number)
    if section == "Particles":
        return _particle(line, number)
    text = " ".join(line.remaining)
    if line.remaining[0] == "normal":
        text = f"PeriodicBoundary {text}"
    return text.replace("pos_left", "distanceLeft").replace("pos_right", "distanceRight")


def _wall(line: Words, number: int) -> str:
    """Return the line, in the new format, of a wall; a flat wall is given by a point on it."""
    kind = line.remaining[0]
    if kind == "numFiniteWalls":
        faces = line.number_after("numFiniteWalls")
        kind = "FiniteWall" if faces else "InfiniteWall"
    text = f"{kind} id {number} indSpecies 0 position"
    if kind != "InfiniteWall":
        return f"{text} 0 0 0"
    normal = line.numbers_after("normal", 3)
    distance = line.number_after("position")
    squared = sum(component**2 for component in normal) or 1.0
    point = [distance * component / squared for component in normal]
    return f"{text} {_join(point)} normal {_join(normal)}"


def _particle(line: Words, number: int) -> str:
    """Return the line, in the new format, of a particle."""
    words = line.remaining
    while words and words[0] in PARTICLE_KINDS:
        words = words[1:]
    if len(words) < PARTICLE_NUMBERS:
        line.refuse("no_spheres", "a particle lacks numbers")
    position = " ".join(words[:3])
    return (
        f"SphericalParticle id {number} indSpecies {words[15]} position {position} "
        f"radius {words[6]} invMass {words[13]}"
    )


def _join(numbers: list[float]) -> str:
    """Return numbers in full precision, with blanks between them."""
    return " ".join(map(repr, numbers))
