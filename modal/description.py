"""A packing in a few lines for people: stresses, voids, rattlers, motions without energy."""

from modal.modes.collective import every_floppy
from modal.packing.network import Network
from modal.packing.plausibility import is_of_a_solid, median_density
from modal.packing.summary import summary
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked
from modal.tools.display import quantity, table
from modal.tools.errors import InputError


@checked
def describe(network: Network) -> str:
    """Spheres, cell, contacts, stresses, void ratio, rattlers and floppy modes of a packing.

    Parameters
    ----------
    network : Network
        The packing.

    Returns
    -------
    str
        Lines of text.

    Raises
    ------
    InputError
        Where `network` is no packing.

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
    told, length = summary(network), quantity(network.length, "m")
    ends = (quantity(2 * float(end), "m") for end in (network.radius.min(), network.radius.max()))
    cell = " x ".join(quantity(side, "m") for side in network.cell_size)
    along_z = "periodic along z" if network.cell_periodic[2] else f"walls {length} apart"
    at_walls = int(network.with_wall.sum())
    rows = [
        ("spheres", f"{network.n_particles}, diameters {' to '.join(dict.fromkeys(ends))}"),
        ("cell", f"{cell}, {along_z}"),
        ("contacts", f"{network.n_contacts}, {at_walls} of them with the walls"),
        ("coordination number", f"{network.coordination_number:.3f}"),
    ]
    for name, words in (("stress_pa", "stress xx, yy, zz"), ("wall_stress_pa", "stress on walls")):
        if name in told:
            rows.append((words, ", ".join(quantity(value, "Pa") for value in told[name])))
    if "void_ratio" in told:
        void_ratio = f"{told['void_ratio']:.4f}"
        if "void_ratio_error" in told:
            free = ", ".join(told["free_ends"])
            void_ratio += f" ± {told['void_ratio_error']:.4f}, free at {free}"
        rows.append(("void ratio", void_ratio))
    if told["rattlers"]:
        without = told["coordination_number_without_rattlers"]
        rows.append(("rattlers", f"{told['rattlers']}; coordination number {without:.3f} without"))
    rows.append(("floppy modes", _floppy(network)))
    density = median_density(network)
    if not is_of_a_solid(density):
        rows.append(("density", f"{density:.4g} kg/m^3, of no solid: mass in kg, radius in m?"))
    return table(rows)


def _floppy(network: Network) -> str:
    """Their number and kinds, or why it is not known."""
    try:
        floppy = every_floppy(LinearSystem.of(network))
    except InputError as error:
        return str(error)
    kinds = ", ".join(f"{n} {kind.replace('_', ' ')}" for kind, n in floppy.kinds.items() if n)
    least = "" if floppy.counted else "at least "
    if floppy.unstable:
        kinds = f"and {floppy.unstable} unstable modes; {kinds}".strip("; ")
    return f"{least}{floppy.total}" + f" ({kinds})" * bool(kinds)
