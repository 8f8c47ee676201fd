"""What is in a packing: stresses, void ratio, coordination number, rattlers, zero modes."""

from modal.cli.reading import NETWORK
from modal.cli.table import Given, NewFile, Option, Result
from modal.cli.terminal import COST, Groups
from modal.exchange.registry import import_packing
from modal.modes.collective import summary_at_zero
from modal.packing.plausibility import plausibility
from modal.packing.state import contacts_per_particle, profile, write_profile
from modal.packing.summary import summary
from modal.system.linear_system import LinearSystem

GROUPS = {
    "packing": ("particles", "contacts", "wall_contacts", "length_m", "degrees_of_freedom"),
    "state": (
        *("stress_pa", "largest_off_diagonal_stress_pa", "wall_stress_pa", "void_ratio"),
        *("coordination_number", "coordination_number_without_rattlers", "rattlers"),
        *("particles_with_0_1_2_contacts", "fabric_diagonal"),
    ),
    "order, and how the bulk differs along z": (
        *("crystalline_share", "crystalline_share_of_bulk", "void_ratio_of_bulk"),
        *("coordination_number_of_bulk", "solid_fraction_deviation_along_z"),
        *("coordination_number_deviation_along_z", "stress_deviation_along_z"),
    ),
    "motions without energy": (
        *("floppy_modes", "floppy_modes_by_kind", "floppy_modes_counted", "unstable_modes"),
    ),
}
"""Titles for people and what stands under them; the rest is about contacts and the file."""
LAYERS = "write stress, void ratio ... of layers along z, *.csv"
EXAMPLE = "info mine.network.h5"
OPTIONS = NETWORK, Option("--layers", "FILE", LAYERS, kind=NewFile)
OF_STAGES = ("steps_", "seconds_", "contacts_")
"""How notes begin that `pack` leaves of each stage of a loading path: --json has them."""


def run(options: Given) -> Result:
    """Numbers of the packing as a whole, and its layers where they are asked for."""
    found = import_packing(options.network)
    network = found.network
    touching = contacts_per_particle(network)
    if options.layers:
        write_profile(options.layers, profile(network))
    return {
        "particles": network.n_particles,
        "contacts": network.n_contacts,
        "wall_contacts": int(network.with_wall.sum()),
        "length_m": network.length,
        "particles_with_0_1_2_contacts": [int((touching == few).sum()) for few in range(3)],
        **summary(network, network.noted("mu_wave")),
        **plausibility(network, sought=found.sought),
        "degrees_of_freedom": 6 * network.n_particles,
        **summary_at_zero(LinearSystem.of(network)),
        "study": {key: str(value) for key, value in network.study.items()},
    }


def shown(result: Result) -> Groups:
    """The result in titled groups; notes of the file last, as they are, without what is above."""
    groups = {
        title: {name: result[name] for name in names if name in result}
        for title, names in GROUPS.items()
    }
    apart = {name for names in GROUPS.values() for name in names}
    apart |= {"study", *COST}
    groups["contacts and their balance"] = {k: v for k, v in result.items() if k not in apart}
    hidden = (*OF_STAGES, "stress_") if "mu_comp" in result["study"] else ("stress_",)
    notes = {name: text for name, text in result["study"].items() if name not in result}
    shown = {name: text for name, text in notes.items() if not name.startswith(hidden)}
    return groups | ({"notes of the file, in SI units": {"": shown}} if shown else {})
