"""Whether packings are samples of one state: without that a mean over them says nothing.

What is compared is measured on the contact networks; a note that a program left in a file counts
only where nothing can be measured. A property that one of the packings does not have is compared
among the others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from modal.packing import state
from modal.packing.checks import force_ratio
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.tools.arrays import Floats
from modal.tools.display import plain

STANDARD_ERRORS = 4.0
"""Of the difference of two means over different spheres, or contacts, of one kind: beyond them one
pair of 16,000 lies by chance."""
AXES = "xx", "yy", "zz", "yz", "zx", "xy"


class Number(NamedTuple):
    """A property of a packing, NaN where it is not known, and its standard error as a mean."""

    value: float
    error: float = 0.0


@dataclass(frozen=True)
class Property:
    """How samples of one state may differ in a property, beyond the errors of their means.

    `tolerance` is a share of the largest value if `relative`, else in the unit of the values.
    """

    words: str
    measure: Callable[[Network], Number]
    tolerance: float
    relative: bool = True


class Difference(NamedTuple):
    """A property, by its name, in which packings are no samples of one state."""

    code: str
    smallest: float
    largest: float
    allowed: float

    def as_json(self) -> dict[str, Any]:
        """Return its code and its numbers."""
        return plain(self._asdict())

    def __str__(self) -> str:
        ends = f"{self.smallest:.4g} to {self.largest:.4g}"
        return f"{SAME_STATE[self.code].words} {ends}, which may differ by {self.allowed:.2g}"


UNKNOWN = Number(np.nan)


def note(network: Network, name: str) -> float:
    """Return the number that a free note of a network gives; NaN where it gives none."""
    noted = network.study.get(name)
    if isinstance(noted, int | float | np.number) and not isinstance(noted, bool):
        return float(noted)
    return np.nan


def _ratio(above: Floats, below: Floats) -> Number:
    """Sum over sum of what spheres, or contacts, have each, and the error of drawing them."""
    if not len(above) or not below.sum() > 0:
        return UNKNOWN
    value = above.sum() / below.sum()
    left = above - value * below
    return Number(float(value), float(np.sqrt((left**2).sum()) / below.sum()))


def _stress(network: Network) -> Floats:
    """Shape (3, 3), Pa; NaN without forces, or without a volume."""
    volume = network.cell_size[:2].all() and network.length > 0
    if not (volume and network.n_contacts and state.has_forces(network)):
        return np.full((3, 3), np.nan)
    return state.stress_tensor(network)


def _size_of_stress(network: Network) -> Number:
    """Pa: root mean square of the principal stresses; without forces the one that is noted."""
    size = float(np.linalg.norm(_stress(network)) / np.sqrt(3))
    return Number(size if np.isfinite(size) else note(network, "stress"))


def _part_of_stress(row: int, column: int) -> Callable[[Network], Number]:
    """A component over the whole; of a shear stress, which nothing controls, with its error."""

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
    """Mean of the diameter weighted by a power of it, m: the higher, the more of the large ones."""

    def mean(network: Network) -> Number:
        diameter = 2 * network.radius
        weight = (diameter / diameter.max()) ** power
        return _ratio(diameter * weight, weight)

    return mean


def _density(network: Network) -> Number:
    return _ratio(network.mass, 4 / 3 * np.pi * network.radius**3)


def _stiffness(network: Network) -> Number:
    """Mean normal stiffness between spheres over the mean diameter, Pa."""
    stiffness = network.stiffness_normal[~network.with_wall]
    return _ratio(stiffness, np.full(len(stiffness), 2 * network.radius.mean()))


def _across_over_along(network: Network) -> Number:
    pair = ~network.with_wall
    return _ratio(network.stiffness_tangential[pair], network.stiffness_normal[pair])


def _law(network: Network) -> Number:
    """Force over stiffness times overlap: 2/3 of Hertz' law, 1 of a linear one."""
    ratio = force_ratio(network)
    return Number(float(np.median(ratio))) if len(ratio) else UNKNOWN


def _resistance_to_turning(network: Network) -> Number:
    """Stiffness of rolling and twisting over the normal one times squared diameter."""
    turning = [network.stiffness_rolling, network.stiffness_twisting]
    total = sum((each for each in turning if each is not None), np.zeros(network.n_contacts))
    return _ratio(total, network.stiffness_normal * (2 * network.radius.mean()) ** 2)


def _coordination(network: Network) -> Number:
    """Contacts of a force-bearing sphere: what is left to see of friction and of the history."""
    bearing = force_bearing(network)
    if not bearing.any():
        return UNKNOWN
    contacts = state.contacts_per_particle(network)[bearing].astype(float)
    return _ratio(contacts, np.ones(len(contacts)))


def _width(network: Network) -> Number:
    return Number(float(network.cell_size[:2].min() / (2 * network.radius.mean())))


def _periods(network: Network) -> Number:
    """Number of axes with periods, those of x and y as tens: walls or none along z count one."""
    along = np.asarray(network.cell_periodic, int)
    return Number(float(along @ [100, 10, 1]))


def _friction(name: str) -> Callable[[Network], Number]:
    return lambda network: Number(note(network, name))


def _property_of_stress(axes: str) -> Property:
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
    "stiffness_ratio": Property("tangential over normal stiffness", _across_over_along, 0.02),
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
"""Properties by their code, with what samples of one state may differ by, and why."""
State = Mapping[str, Number]
"""Properties of a packing by their code."""


def state_of(network: Network) -> State:
    """Measure what samples of one state have in common."""
    return {code: each.measure(network) for code, each in SAME_STATE.items()}


def differences(states: Sequence[State]) -> list[Difference]:
    """Return the properties in which packings differ by more than samples of one state."""
    different = []
    for code, each in SAME_STATE.items():
        known = [one[code] for one in states if code in one and np.isfinite(one[code].value)]
        if len(known) < 2:
            continue
        low, high = min(known), max(known)
        scale = max(abs(low.value), abs(high.value)) if each.relative else 1.0
        allowed = each.tolerance * scale + STANDARD_ERRORS * float(np.hypot(low.error, high.error))
        if high.value - low.value > allowed:
            different.append(Difference(code, low.value, high.value, allowed))
    return different
