"""What the packing is: void ratio, coordination number, crystalline share."""

from __future__ import annotations

from analysis.measuring import Measuring
from analysis.quantities.registry import quantity
from analysis.value import Value, unknown
from modal.packing.state import contacts_per_particle, profile, void_ratio
from modal.packing.summary import crystalline_shares


@quantity("void_ratio", "1", "volume of voids over that of spheres, from wall to wall")
def of_voids(packing: Measuring) -> Value:
    """Exact for the packing."""
    return Value(void_ratio(packing.network), "1")


@quantity("coordination", "1", "contacts of a sphere, rattlers and contacts with walls included")
def coordination(packing: Measuring) -> Value:
    """Exact for the packing."""
    return Value(float(contacts_per_particle(packing.network).mean()), "1")


@quantity("crystalline_share", "1", "share of spheres in crystalline surroundings")
def crystalline_share(packing: Measuring) -> Value:
    """Of all spheres; a random packing has few."""
    network = packing.network
    shares = crystalline_shares(network, profile(network))
    if "crystalline_share" not in shares:
        return unknown("1", "the cell has no periods along x and y, or its spheres are not equal")
    return Value(shares["crystalline_share"], "1")
