"""Options and functions that commands about a packing share: its file, its springs, frequencies."""

from modal.cli.options import SKIP, Option, Options, output
from modal.exchange.registry import read_remarked
from modal.packing.network import Network
from modal.system.contacts import SLIDING, TANGENTS
from modal.tools.display import quantity

NETWORK = Option("network", "", "*.network.h5, or *.sample.h5", kind=str)
PRE_STRESS_HELP = (
    "carried forces in the tangent stiffness: none, the normal ones, all (full), or as "
    "the contact model of the program that the packing is from (law)"
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
    ]
    if product_ending:
        options += [output(f"write *{product_ending}", (product_ending,)), SKIP]
    return tuple(options)


def packing_of(options: Options, *, waves: bool = False) -> Network:
    """Read the packing of the command's file, and add remarks on it to the command's.

    With `waves` the packing must be long enough for waves along z.
    """
    return read_remarked(options.network, options.remarks.append, waves=waves)


def remark_on_ends(options: Options, frequency: float, below: bool, above: bool) -> None:
    """Remark on a frequency, Hz, `below` the first or `above` the highest mode: perhaps in kHz."""
    if below or above:
        where = "below the first" if below else "above the highest"
        options.remarks.append(f"{quantity(frequency, 'Hz')} lies {where} mode: is it in Hz?")
