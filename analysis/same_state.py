"""Compare packings: a mean makes sense only over samples of the same state.

The compared properties are measured on the contact networks; if a property cannot be measured, the
program's note in the file is compared instead. Only properties that all packings have are compared.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from modal.packing import state
from modal.packing.contact_checks import force_ratio
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.tools.arrays import Floats
from modal.tools.display import plain

MAX_STANDARD_ERRORS = 4.0
"""Largest difference of two means over different spheres or contacts, in its standard errors. By
chance one pair of 16,000 differs by more."""
AXES = "xx", "yy", "zz", "yz", "zx", "xy"


class Number(NamedTuple):
    """A property of a packing, and its standard error as a mean; NaN if it is not known."""

    value: float
    error: float = 0.0


@dataclass(frozen=True)
class Property:
    """A property in which samples of the same state may differ only a little.

    Attributes
    ----------
    words : str
        Description of the property, for messages.
    measure : callable
        Function that measures it on a contact network.
    tolerance : float
        Difference that is allowed beyond the errors of the means: a share of the largest value if
        `relative`, else in the unit of the values.
    relative : bool
        Whether `tolerance` is a share of the largest value.
    """

    words: str
    measure: Callable[[Network], Number]
    tolerance: float
    relative: bool = True


class Difference(NamedTuple):
    """A property, by its code, that shows that packings are not samples of the same state."""

    code: str
    smallest: float
    largest: float
    allowed: float

    def as_json(self) -> dict[str, Any]:
        """Return the code of the property and its numbers, for JSON."""
        return plain(self._asdict())

    def __str__(self) -> str:
        ends = f"{self.smallest:.4g} to {self.largest:.4g}"
        return f"{SAME_STATE[self.code].words} {ends}, which may differ by {self.allowed:.2g}"


UNKNOWN = Number(np.nan)


def note(network: Network, name: str) -> float:
    """Return the number in a note of a network; NaN without such a note."""
    noted = network.study.get(name)
    if isinstance(noted, int | float | np.number) and not isinstance(noted, bool):
        return float(noted)
    return np.nan


def _ratio(above: Floats, below: Floats) -> Number:
    """Return the ratio of two sums over spheres or contacts, and its standard error."""
    if not len(above) or not below.sum() > 0:
        return UNKNOWN
    value = above.sum() / below.sum()
    residual = above - value * below
    return Number(float(value), float(np.sqrt((residual**2).sum()) / below.sum()))


def _stress(network: Network) -> Floats:
    """Return the stress tensor (3, 3), Pa; NaN without forces or without a volume."""
    has_volume = network.cell_size[:2].all() and network.length > 0
    if not (has_volume and network.n_contacts and state.has_forces(network)):
        return np.full((3, 3), np.nan)
    return state.stress_tensor(network)


def _size_of_stress(network: Network) -> Number:
    """Return the rms of the principal stresses, Pa; without forces the noted stress."""
    size = float(np.linalg.norm(_stress(network)) / np.sqrt(3))
    if np.isfinite(size):
        return Number(size)
    return Number(note(network, "stress"))


def _part_of_stress(row: int, column: int) -> Callable[[Network], Number]:
    """Return a function that measures a component of the stress divided by the rms stress.

    A shear stress has an error, because no preparation controls it.
    """

    def part(network: Network) -> Number:
        tensor = _stress(network)
        size = _size_of_stress(network).value
        if not size > 0:
            return UNKNOWN
        error = 0.0
        if row != column:
            force = state.contact_forces(network, "stress")[:, row]
            shares = force * network.branch[:, column] / state.volume_between_walls(network)
            error = float(shares.std() * np.sqrt(len(shares)) / size)
        return Number(float(tensor[row, column] / size), error)

    return part


def _mean_diameter(power: int) -> Callable[[Network], Number]:
    """Return a function that measures the mean diameter, m, weighted by a power of the diameter.

    A high power gives large spheres more weight.
    """

    def mean(network: Network) -> Number:
        diameter = 2 * network.radius
        weight = (diameter / diameter.max()) ** power
        return _ratio(diameter * weight, weight)

    return mean


def _density(network: Network) -> Number:
    """Measure the density of the spheres, kg/m^3."""
    return _ratio(network.mass, 4 / 3 * np.pi * network.radius**3)


def _stiffness(network: Network) -> Number:
    """Measure the mean normal stiffness between spheres divided by the mean diameter, Pa."""
    stiffness = network.stiffness_normal[~network.with_wall]
    return _ratio(stiffness, np.full(len(stiffness), 2 * network.radius.mean()))


def _stiffness_ratio(network: Network) -> Number:
    """Measure the tangential divided by the normal stiffness between spheres."""
    pair = ~network.with_wall
    return _ratio(network.stiffness_tangential[pair], network.stiffness_normal[pair])


def _law(network: Network) -> Number:
    """Measure force / (stiffness times overlap), which identifies the contact law.

    It is 2/3 for the law of Hertz, and 1 for a linear one.
    """
    ratio = force_ratio(network)
    if not len(ratio):
        return UNKNOWN
    return Number(float(np.median(ratio)))


def _resistance_to_turning(network: Network) -> Number:
    """Measure the stiffness of rolling and twisting, divided by normal stiffness and D^2."""
    total = np.zeros(network.n_contacts)
    for stiffness in (network.stiffness_rolling, network.stiffness_twisting):
        if stiffness is not None:
            total = total + stiffness
    return _ratio(total, network.stiffness_normal * (2 * network.radius.mean()) ** 2)


def _coordination(network: Network) -> Number:
    """Measure the mean number of contacts of force-bearing spheres, which depends on history."""
    bearing = force_bearing(network)
    if not bearing.any():
        return UNKNOWN
    contacts = state.contacts_per_particle(network)[bearing].astype(float)
    return _ratio(contacts, np.ones(len(contacts)))


def _width(network: Network) -> Number:
    """Measure the narrower side of the cell, in mean diameters."""
    return Number(float(network.cell_size[:2].min() / (2 * network.radius.mean())))


def _periods(network: Network) -> Number:
    """Return the axes with periods as digits of one number, 110 for periods along x and y."""
    along = np.asarray(network.cell_periodic, int)
    return Number(float(along @ [100, 10, 1]))


def _friction(name: str) -> Callable[[Network], Number]:
    """Return a function that reads a friction from the notes."""
    return lambda network: Number(note(network, name))


def _property_of_stress(axes: str) -> Property:
    """Return the property of one component of the stress, as "xy"."""
    row, column = map("xyz".index, axes)
    words = f"stress {axes} over the whole stress"
    return Property(words, _part_of_stress(row, column), 0.1, relative=False)


SAME_STATE: dict[str, Property] = {
    # V_P goes as stress^(1/6): a tenth changes it by 1.6 %, as much as samples of one state differ.
    # Compressions that settle end within 0.3 % of their stress, servos of other programs within a
    # few per cent.
    "stress": Property("the stress, Pa,", _size_of_stress, 0.1),
    # Each part beside the whole: packings that are compressed oedometrically differ by some per
    # cent in what they bear across.
    **{f"stress_{axes}": _property_of_stress(axes) for axes in AXES},
    # Draws of one mixture differ by the error of drawing alone; the rest is for digits in files.
    "diameter": Property("the mean diameter, m,", _mean_diameter(0), 0.01),
    "large_spheres": Property("the mean diameter by volume, m,", _mean_diameter(3), 0.01),
    "density": Property("the density of the spheres, kg/m^3,", _density, 0.01),
    # V goes as its root; at one stress it follows the coordination number, to a few per cent.
    "stiffness": Property("the mean stiffness of a contact over D, Pa,", _stiffness, 0.1),
    # One number of a law and Poisson's ratio.
    "stiffness_ratio": Property("tangential over normal stiffness", _stiffness_ratio, 0.02),
    "law": Property("force over stiffness times overlap", _law, 0.05),
    "turning": Property("the resistance to turning over D^2", _resistance_to_turning, 0.05),
    # Frictions 0.1 apart make 0.1 to 0.5 of difference, samples of 2,000 spheres differ by 0.05.
    "coordination": Property("contacts of a sphere", _coordination, 0.03),
    "periods": Property("periods along x, y and z", _periods, 0.0),
    # Nothing measures it: a note must be the same wherever it is known.
    "mu_comp": Property("the friction of the compression", _friction("mu_comp"), 1e-6),
    "mu_wave": Property("the friction of the wave", _friction("mu_wave"), 1e-6),
    # Waves that fit across the cell set in at V / width.
    "width": Property("the width, D,", _width, 0.1),
}
"""Properties by their code; the comments give the reason for each tolerance."""
State = Mapping[str, Number]
"""Properties of a packing by their code."""


def state_of(network: Network) -> State:
    """Measure all properties that samples of the same state have in common."""
    return {code: each.measure(network) for code, each in SAME_STATE.items()}


def differences(states: Sequence[State]) -> list[Difference]:
    """Return the properties in which packings differ by more than samples of the same state."""
    different = []
    for code, each in SAME_STATE.items():
        numbers = [one.get(code, UNKNOWN) for one in states]
        known = [number for number in numbers if np.isfinite(number.value)]
        if len(known) < 2:
            continue
        low = min(known)
        high = max(known)
        scale = 1.0
        if each.relative:
            scale = max(abs(low.value), abs(high.value))
        error = float(np.hypot(low.error, high.error))
        allowed = each.tolerance * scale + MAX_STANDARD_ERRORS * error
        if high.value - low.value > allowed:
            different.append(Difference(code, low.value, high.value, allowed))
    return different
