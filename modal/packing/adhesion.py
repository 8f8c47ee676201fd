"""Read the work of adhesion of two surfaces from the numbers of a contact model."""

from collections.abc import Sequence

from modal.tools.errors import InputError

WORK_RANGE = (1e-9, 1e3)
"""Range of the work of adhesion that is accepted, J/m^2. Clean glass and metals have 0.05 to 2;
larger numbers stand for glues."""


def read_work_of_adhesion(model: str, numbers: Sequence[float], wall: bool) -> float:
    """Return the work of adhesion of a contact, J/m^2, from the numbers after a model's name.

    `numbers` are the work between two spheres and, if it differs, that between sphere and wall. The
    work of adhesion is the energy that separates a unit area, twice the surface energy of equal
    bodies. Raises InputError for more or fewer numbers, or a number outside `WORK_RANGE`.

    >>> read_work_of_adhesion("dmt", [0.1, 0.2], wall=True)
    0.2
    """
    low, high = WORK_RANGE
    in_range = all(low <= number <= high for number in numbers)
    if len(numbers) not in (1, 2) or not in_range:
        raise InputError(
            "adhesion",
            f"contact model {model}",
            "give the work of adhesion of two spheres, J/m^2, and that of sphere and wall where "
            f"it is another, as {model} 0.1",
            f"{low:g} to {high:g}",
        )
    return float(numbers[-1] if wall else numbers[0])
