"""Define options and functions that several commands share: packing, springs, frequencies."""

from modal.cli.options import SKIP, Option, Options, output
from modal.exchange.registry import read_remarked
from modal.packing.network import Network
from modal.system.contacts import SLIDING, TANGENTS
from modal.theory.saturation import ADDED_MASS_SHARE, FLUIDS, with_added_mass
from modal.tools.display import quantity

NETWORK = Option("network", "", "*.network.h5, or *.sample.h5", kind=str)
PRE_STRESS_HELP = (
    "carried forces in the tangent stiffness: none, the normal ones, all (full), or as "
    "the contact model of the program that the packing is from (law)"
)
FLUID_HELP = (
    f"that fills the pores ({', '.join(FLUIDS)}): spheres carry along half the mass that they "
    "displace"
)
SLIDING_HELP = "contacts at the friction limit: elastic, or slip, without tangential stiffness"


def springs(product_ending: str = "") -> tuple[Option, ...]:
    """Return the options for a packing's file and for the springs of its contacts.

    For a command that writes a product whose name ends in `product_ending`, also return -o and
    --skip-current.
    """
    options = [
        NETWORK,
        Option("--pre-stress", "", PRE_STRESS_HELP, "none", tuple(TANGENTS)),
        Option("--sliding", "", SLIDING_HELP, "elastic", SLIDING),
        Option("--fluid", "", FLUID_HELP, kind=tuple(FLUIDS)),
    ]
    if product_ending:
        options += [output(f"write *{product_ending}", (product_ending,)), SKIP]
    return tuple(options)


def packing_of(options: Options, *, waves: bool = False, added_mass: bool = True) -> Network:
    """Read the packing of the command's file, and add remarks about the packing to the options.

    With `waves` the packing must be long enough for waves along z. If a fluid is named, the mass of
    the spheres includes the fluid that they carry along, unless `added_mass` is False.
    """
    network = read_remarked(options.network, options.remarks.append, waves=waves)
    if not options.fluid or not added_mass:
        return network
    options.remarks.append(
        f"spheres carry along {ADDED_MASS_SHARE:g} of the mass of {options.fluid} that they "
        "displace; the pressure in the pores and the fluid's friction are left out"
    )
    return with_added_mass(network, options.fluid)


def remark_on_ends(options: Options, frequency: float, below: bool, above: bool) -> None:
    """Add a remark if a frequency, Hz, is outside the spectrum: perhaps kHz were meant.

    `below` says that the frequency is below the first mode, `above` that it is above the highest
    mode.
    """
    if below or above:
        where = "below the first" if below else "above the highest"
        options.remarks.append(f"{quantity(frequency, 'Hz')} lies {where} mode: is it in Hz?")
