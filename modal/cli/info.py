"""What is in a packing: stresses, void ratio, coordination number, rattlers, zero modes."""

from modal.cli.options import NewFile, Option, Options, Result
from modal.cli.reading import NETWORK
from modal.exchange.registry import import_packing
from modal.modes.collective import summary_at_zero
from modal.packing.plausibility import plausibility
from modal.packing.state import contacts_per_particle, profile, write_profile
from modal.packing.summary import summary
from modal.system.linear_system import LinearSystem

OF_BULK = "crystalline_share", "_of_bulk", "_along_z"
"""What the names of results on order, and on how the bulk differs along z, begin with or end in."""
LAYERS = "write stress, void ratio ... of layers along z, *.csv"
EXAMPLE = "info mine.network.h5"
OPTIONS = NETWORK, Option("--layers", "FILE", LAYERS, kind=NewFile, endings=(".csv",))
OF_STAGES = ("steps_", "seconds_", "contacts_")
"""How notes begin that `pack` leaves of each stage of a loading path: --json has them."""


def run(options: Options) -> Result:
    """Numbers of the packing as a whole, and its layers where they are asked for."""
    found = import_packing(options.network)
    network = found.network
    touching = contacts_per_particle(network)
    if options.layers:
        write_profile(options.layers, profile(network))
    state = summary(network, network.noted("mu_wave"))
    bulk = {k: v for k, v in state.items() if k.startswith(OF_BULK[0]) or k.endswith(OF_BULK)}
    state["particles_with_0_1_2_contacts"] = [int((touching == few).sum()) for few in range(3)]
    options.groups = {
        "packing": {
            "particles": network.n_particles,
            "contacts": network.n_contacts,
            "wall_contacts": int(network.with_wall.sum()),
            "length_m": network.length,
            "degrees_of_freedom": 6 * network.n_particles,
        },
        "state": {name: value for name, value in state.items() if name not in bulk},
        "order, and how the bulk differs along z": bulk,
        "motions without energy": summary_at_zero(LinearSystem.of(network)),
        "contacts and their balance": plausibility(network, sought=found.sought),
    }
    result: Result = {k: v for group in options.groups.values() for k, v in group.items()}
    study = {key: str(value) for key, value in network.study.items()}
    # As they are, without what stands above.
    hidden = (*OF_STAGES, "stress_") if "mu_comp" in study else ("stress_",)
    notes = {k: v for k, v in study.items() if k not in result and not k.startswith(hidden)}
    if notes:
        options.groups["notes of the file, in SI units"] = {"": notes}
    return result | {"study": study}
