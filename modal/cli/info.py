"""Summarise a packing: stresses, void ratio, coordination number, rattlers, zero modes."""

from typing import Any

from modal.cli.options import NewFile, Option, Options, Result
from modal.cli.reading import NETWORK
from modal.exchange.registry import import_packing
from modal.modes.collective import summary_at_zero
from modal.packing.network import Network
from modal.packing.plausibility import plausibility
from modal.packing.state import contacts_per_particle, profile, write_profile
from modal.packing.summary import summary
from modal.system.linear_system import LinearSystem

BULK_PREFIX = "crystalline_share"
BULK_SUFFIXES = ("_of_bulk", "_along_z")
"""Beginnings and endings of the names of results on order and on the change of the bulk along z."""
LAYERS_HELP = "write stress, void ratio ... of layers along z, *.csv"
EXAMPLE = "info mine.network.h5"
OPTIONS = (
    NETWORK,
    Option("--layers", "FILE", LAYERS_HELP, kind=NewFile, endings=(".csv",)),
)
STAGE_PREFIXES = ("steps_", "seconds_", "contacts_")
"""Beginnings of the notes that `pack` writes for each stage of a loading path; only --json shows
them."""


def run(options: Options) -> Result:
    """Summarise the packing as a whole, and write its layers if a file is named for them."""
    imported = import_packing(options.network)
    network = imported.network
    if options.layers:
        write_profile(options.layers, profile(network))
    state = summary(network, network.noted("mu_wave"))
    bulk = {name: value for name, value in state.items() if _is_about_bulk(name)}
    few_contacts = _particles_with_few_contacts(network)
    options.groups = {
        "packing": {
            "particles": network.n_particles,
            "contacts": network.n_contacts,
            "wall_contacts": int(network.with_wall.sum()),
            **_held_bodies(network),
            "length_m": network.length,
            "degrees_of_freedom": network.degrees_of_freedom,
        },
        "state": {
            **{name: value for name, value in state.items() if name not in bulk},
            "particles_with_0_1_2_contacts": few_contacts,
        },
        "order, and how the bulk differs along z": bulk,
        "motions without energy": summary_at_zero(LinearSystem.of(network)),
        "contacts and their balance": plausibility(network, sought=imported.sought),
    }
    result: Result = {}
    for group in options.groups.values():
        result |= group
    study = {name: str(value) for name, value in network.study.items()}
    notes = _notes_to_show(study, result)
    if notes:
        options.groups["notes of the file, in SI units"] = {"": notes}
    return result | {"study": study}


def _held_bodies(network: Network) -> dict[str, int]:
    """Return how many particles are held in all motions, and in some; empty if all are free."""
    if network.fixed is None:
        return {}
    held = int(network.held.sum())
    return {"held": held, "held_in_some_motions": int(network.fixed.any(axis=1).sum()) - held}


def _is_about_bulk(name: str) -> bool:
    """Return whether a result is about crystalline order, or about the bulk's change along z."""
    return name.startswith(BULK_PREFIX) or name.endswith(BULK_SUFFIXES)


def _particles_with_few_contacts(network: Network) -> list[int]:
    """Return the numbers of particles with 0, 1 and 2 contacts."""
    contacts = contacts_per_particle(network)
    return [int((contacts == number).sum()) for number in range(3)]


def _notes_to_show(study: dict[str, str], result: dict[str, Any]) -> dict[str, str]:
    """Return the notes of a file that are not among the results, without stages and stresses."""
    hidden = ["stress_"]
    if "mu_comp" in study:
        hidden += STAGE_PREFIXES
    notes = {}
    for name, value in study.items():
        if name not in result and not name.startswith(tuple(hidden)):
            notes[name] = value
    return notes
