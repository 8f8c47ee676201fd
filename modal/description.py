"""A packing in a few lines for people: stresses, voids, rattlers, motions without energy."""

from collections.abc import Mapping
from typing import Any

from modal.formats.tables import html_table
from modal.modes.collective import every_floppy
from modal.packing.network import Network
from modal.packing.plausibility import is_of_a_solid, median_density
from modal.packing.summary import summary
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked
from modal.tools.display import quantity, table
from modal.tools.errors import InputError

STRESSES = {"stress_pa": "stress xx, yy, zz", "wall_stress_pa": "stress on walls"}
"""Labels of the stresses in a summary."""


class Description(str):
    """Lines of text on a packing, which a notebook shows as a table.

    Attributes
    ----------
    rows : list of tuple of str
        Name and text of each line.
    """

    rows: list[tuple[str, str]]

    @classmethod
    def of(cls, rows: list[tuple[str, str]]) -> "Description":
        """Return the description with these lines."""
        description = cls(table(rows))
        description.rows = rows
        return description

    def _repr_html_(self) -> str:
        """Return the lines as a table, for a notebook."""
        return html_table(["packing", ""], [list(row) for row in self.rows])


@checked
def describe(network: Network) -> Description:
    """Describe spheres, cell, contacts, stresses, void ratio, rattlers and floppy modes.

    Parameters
    ----------
    network : Network
        The packing.

    Returns
    -------
    Description
        Lines of text, a `str`; a notebook shows them as a table.

    Raises
    ------
    InputError
        If `network` is not a packing.

    Examples
    --------
    >>> import modal
    >>> print(modal.describe(modal.fcc(cells=(2, 2, 20))))
    spheres              80, diameters 2.54 mm
    cell                 5.079 mm x 5.079 mm x 36.66 mm, walls 36.66 mm apart
    contacts             472, 8 of them with the walls
    coordination number  11.700
    stress xx, yy, zz    95.52 kPa, 95.52 kPa, 100 kPa
    stress on walls      100 kPa, 100 kPa
    void ratio           0.3778
    floppy modes         0
    """
    state = summary(network)
    contacts_with_walls = int(network.with_wall.sum())
    rows = [("spheres", f"{network.n_particles}, diameters {_diameters(network)}")]
    if network.fixed is not None:
        rows.append(("held", _held(network)))
    rows += [
        ("cell", _cell(network)),
        ("contacts", f"{network.n_contacts}, {contacts_with_walls} of them with the walls"),
        ("coordination number", f"{network.coordination_number:.3f}"),
    ]
    for name, label in STRESSES.items():
        if name in state:
            rows.append((label, ", ".join(quantity(value, "Pa") for value in state[name])))
    if "void_ratio" in state:
        rows.append(("void ratio", _void_ratio(state)))
    if state["rattlers"]:
        without = state["coordination_number_without_rattlers"]
        rows.append(("rattlers", f"{state['rattlers']}; coordination number {without:.3f} without"))
    rows.append(("floppy modes", _floppy_modes(network)))
    density = median_density(network)
    if not is_of_a_solid(density):
        rows.append(("density", f"{density:.4g} kg/m^3, of no solid: mass in kg, radius in m?"))
    return Description.of(rows)


def _diameters(network: Network) -> str:
    """Return the smallest and the largest diameter, or the one that all spheres have."""
    smallest = quantity(2 * float(network.radius.min()), "m")
    largest = quantity(2 * float(network.radius.max()), "m")
    if smallest == largest:
        return smallest
    return f"{smallest} to {largest}"


def _held(network: Network) -> str:
    """Return a text with the number of spheres that are held in all or in some motions."""
    held = int(network.held.sum())
    description = f"{held} spheres in all motions"
    assert network.fixed is not None
    partly = int(network.fixed.any(axis=1).sum()) - held
    if partly:
        description += f", {partly} in some"
    return f"{description}; {network.degrees_of_freedom} degrees of freedom"


def _cell(network: Network) -> str:
    """Return a text with the sides of the cell, and with what bounds the cell along z."""
    sides = " x ".join(quantity(side, "m") for side in network.cell_size)
    if network.cell_vectors is not None:
        sides += ", at angles"
    if network.cell_periodic[2]:
        return f"{sides}, periodic along z"
    return f"{sides}, walls {quantity(network.length, 'm')} apart"


def _void_ratio(state: Mapping[str, Any]) -> str:
    """Return the void ratio of a summary, with its error if the packing has free surfaces."""
    void_ratio = f"{state['void_ratio']:.4f}"
    if "void_ratio_error" in state:
        free_ends = ", ".join(state["free_ends"])
        void_ratio += f" ± {state['void_ratio_error']:.4f}, free at {free_ends}"
    return void_ratio


def _floppy_modes(network: Network) -> str:
    """Return the number and the kinds of floppy modes, or why they are not known."""
    try:
        floppy = every_floppy(LinearSystem.of(network))
    except InputError as error:
        return str(error)
    kinds = []
    for kind, number in floppy.kinds.items():
        if number:
            kinds.append(f"{number} {kind.replace('_', ' ')}")
    details = ", ".join(kinds)
    if floppy.unstable:
        details = f"and {floppy.unstable} unstable modes; {details}".strip("; ")
    description = f"{floppy.total}"
    if not floppy.counted:
        description = f"at least {description}"
    if details:
        description += f" ({details})"
    return description
