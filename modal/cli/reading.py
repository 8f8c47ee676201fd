"""Commands about a packing: their file, what its contacts do (springs, forces), frequencies."""

from modal.cli.options import SKIP, Given, Option, output
from modal.exchange.registry import read_remarked
from modal.packing.network import Network
from modal.system.contacts import SLIDING, TANGENTS
from modal.tools.display import quantity

NETWORK = Option("network", "", "*.network.h5, or *.sample.h5", kind=str)
CARRIED = (
    "carried forces in the tangent stiffness: none, the normal ones, all (full), or as "
    "the contact model of the program that the packing is from (law)"
)
SLIPPING = "contacts at the friction limit: elastic, or slip, without tangential stiffness"


def springs(product: str = "") -> tuple[Option, ...]:
    """A packing's file and the springs of its contacts, with the terms of their forces.

    Of a command that writes, how the names of its files end: the option -o, and --skip-current.
    """
    pre_stress = Option("--pre-stress", "", CARRIED, "none", tuple(TANGENTS))
    sliding = Option("--sliding", "", SLIPPING, "elastic", SLIDING)
    written = (output(f"write {product}"), SKIP) if product else ()
    return NETWORK, pre_stress, sliding, *written


def packing_of(options: Given, *, waves: bool = False) -> Network:
    """The packing of the command's file, remarks on it told.

    `waves` says that waves along z will be read, which need some length.
    """
    return read_remarked(options.network, options.remarks.append, waves=waves)


def remark_on_ends(options: Given, frequency: float, below: bool, above: bool) -> None:
    """Remark on a frequency, Hz, `below` the first or `above` the highest mode: perhaps in kHz."""
    if below or above:
        where = "below the first" if below else "above the highest"
        options.remarks.append(f"{quantity(frequency, 'Hz')} lies {where} mode: is it in Hz?")
