"""Remark on the shape of a packing: order, width, length, even thirds, and free surfaces."""

from collections.abc import Iterator

import numpy as np

from modal.packing.network import Network
from modal.packing.occupied import occupied_part
from modal.packing.remark import Remark
from modal.packing.state import unevenness
from modal.packing.summary import crystalline_shares

MAX_UNIFORM_SPREAD = 1e-2
"""Relative spread up to which densities, or ratios of stiffnesses, count as one value."""
MIN_CRYSTALLINE_SHARE = 0.05
"""Share of crystalline spheres in the bulk from which on order is reported."""
MIN_LATTICE_SHARE = 0.99
"""Least share of crystalline spheres in a packing that counts as a lattice."""
MAX_SPHERES_FOR_ORDER = 200_000
"""Largest number of spheres of a packing in which order is sought: a million spheres take 10 s."""
MIN_WIDTH_IN_DIAMETERS = 8.0
"""Least period, in diameters, of a packing that hardly feels its own images; with friction 0.4 the
error of the coordination number is then 0.05."""
LONG_FOR_VELOCITY = 25.0
"""Least length of a packing, in diameters, for a velocity of the longest waves. In packings of 16
to 25 diameters velocities are up to 3 % too high, in longer ones the excess is smaller than the
scatter of samples."""
LONG_FOR_LOW_PASS = 50.0
"""Least length of a packing, in diameters, for a low-pass frequency. At 0.4, 0.5 and 0.6 of the
length, packings of friction 0.4 have low-pass frequencies of 33, 20 and 16 kHz at 100 kPa if the
packing is 41 long, 11.5, 10.3 and 9.4 if it is 87, and 8.7, 8.1 and 7.6 if it is 143 as in the
study."""
MAX_UNEVENNESS = 0.1
"""Largest relative excess of the wave velocity in one third of the length that is not reported. It
was 0.05 at most in 23 random packings of 300 to 35,201 spheres, some of two sizes (0.09 in one of
three that were 3 D wide)."""
MIN_LENGTH_FOR_THIRDS_IN_DIAMETERS = 15.0
"""Least length, in diameters, of a packing whose thirds are compared: in shorter ones the order at
the walls makes the thirds differ."""


def remark_on_shape(network: Network, waves: bool) -> list[Remark]:
    """Remark on crystalline order, and on a cell that is too narrow, or for `waves` too short.

    The width of a lattice, whose springs are all equal, is not checked.
    """
    diameter = 2 * float(network.radius.mean())
    shares: dict[str, float] = {}
    is_lattice = False
    if network.length > 0 and network.cell_size[:2].all():
        is_small = network.n_particles <= MAX_SPHERES_FOR_ORDER
        if is_small:
            shares = crystalline_shares(network)
        springs = network.stiffness_normal[~network.with_wall]
        are_equal = springs.size > 0 and springs.std() <= MAX_UNIFORM_SPREAD * springs.mean()
        # In a large packing the springs alone show a lattice.
        share_of_all = shares.get("crystalline_share", 0.0 if is_small else 1.0)
        is_lattice = bool(are_equal) and share_of_all > MIN_LATTICE_SHARE
    share = shares.get("crystalline_share_of_bulk", shares.get("crystalline_share", 0.0))
    width = float(network.cell_widths[network.cell_periodic].min(initial=np.inf)) / diameter
    length = network.length / diameter
    has_walls = not network.cell_periodic[2]
    remarks = [
        Remark(
            "crystalline",
            share > MIN_CRYSTALLINE_SHARE and not is_lattice,
            f"crystalline share of the bulk {100 * share:.0f} %: of a random packing it is below "
            f"{100 * MIN_CRYSTALLINE_SHARE:.0f} %; take a wider cell, more spheres or another seed",
            share,
        ),
        Remark(
            "narrow",
            width < MIN_WIDTH_IN_DIAMETERS and not is_lattice,
            f"{width:.1f} diameters wide: below {MIN_WIDTH_IN_DIAMETERS:g} spheres feel their own "
            "images; take more spheres or a smaller length over width",
            width,
        ),
        Remark(
            "short",
            waves and has_walls and length < LONG_FOR_LOW_PASS,
            f"{length:.1f} diameters long: below {LONG_FOR_LOW_PASS:g} a low-pass frequency reads "
            f"too high, below {LONG_FOR_VELOCITY:g} a velocity too; take more spheres",
            length,
        ),
    ]
    return [*remarks, remark_on_thirds(network)]


def remark_on_thirds(network: Network) -> Remark:
    """Remark on springs or masses that change along z: one velocity cannot describe the packing."""
    diameter = 2 * float(network.radius.mean())
    excess = 0.0
    if network.length > MIN_LENGTH_FOR_THIRDS_IN_DIAMETERS * diameter:
        excess = unevenness(network)
    text = (
        f"uneven: P-waves are {excess:.0%} faster in one third of the length than in another; "
        "velocities, moduli and attenuation are of a part of it, or a mean"
    )
    return Remark("uneven", MAX_UNEVENNESS < excess < np.inf, text, excess)


def remark_on_free_ends(network: Network) -> Iterator[Remark]:
    """Remark on free surfaces, and on the part of the packing that the void ratio refers to."""
    occupied = occupied_part(network)
    if occupied is None:
        return
    part = f"its {occupied.cubes} cubes away from walls and surfaces"
    if not occupied.cubes:
        part = "the space up to the outermost spheres, too few for a core"
    yield Remark(
        "free_surface",
        True,
        f"free surface at {', '.join(occupied.free_names)}: the void ratio, "
        f"{occupied.void_ratio:.3f} ± {occupied.void_ratio_error:.3f}, is of {part}",
        occupied.void_ratio,
    )
