"""A wave from a plane inside a packing that is periodic in all directions.

No wall can move there. Instead all contacts that cross a horizontal plane open by the motion d(t),
along z or sideways: what lies above is pushed one way, what lies below the other, and nothing is
pushed as a whole. Two equal waves leave the plane, up and down, and meet half a cell away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from modal.packing.layers import Layers
from modal.packing.network import Network
from modal.system.contacts import with_sliding
from modal.system.imposed import PlaneOpens, put_on
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass
from modal.tools.arguments import checked
from modal.tools.arrays import Floats
from modal.tools.display import axes_of, quantity
from modal.tools.errors import InputError
from modal.waves.propagate import carried
from modal.waves.signals import DIRECTIONS
from modal.waves.source import Motion, Pulse

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class PlaneWave:
    """What a plane source sends: time (nt,) s, source_displacement (nt,) m, by which it opens.

    layer_position (nl,), m, and layer_displacement (nt, nl), m, along `direction`: means over the
    firmly held spheres of slabs; particle_displacement (nt, n), m, None where a file has none;
    `height` of the plane, m; `truncation` bounds the
    error of all motions relative to the largest, NaN where a file does not say it.
    """

    time: Floats
    source_displacement: Floats
    layer_position: Floats
    layer_displacement: Floats
    particle_displacement: Floats | None
    height: float
    direction: str
    products: int
    truncation: float = np.nan

    def __repr__(self) -> str:
        return (
            f"<PlaneWave along {self.direction} from {quantity(self.height, 'm')}: "
            f"{len(self.time)} times up to {quantity(float(self.time[-1]), 's')}>"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the layers' displacement over time and height; returns the Axes."""
        ax = axes_of(ax)
        motion = self.layer_displacement.T * 1e9
        largest = float(abs(motion).max()) or 1.0
        image = ax.pcolormesh(
            self.time * 1e6, self.layer_position * 1e3, motion, cmap="RdBu_r", shading="nearest",
            vmin=-largest, vmax=largest, rasterized=True,
        )  # fmt: skip
        ax.figure.colorbar(image, ax=ax, label=rf"$u_{self.direction}$, nm")
        ax.set(xlabel=r"time, $\mu$s", ylabel="z, mm")
        return ax


class _Spheres:
    """Records all displacements along an axis."""

    def __init__(self, network: Network, axis: int) -> None:
        self.count, self._axis = network.n_particles, axis
        self._per_root_mass = (1 / RootMass.of(network).diagonal)[axis::6].copy()

    def observe(self, u: Floats, out: Floats) -> None:
        """The displacements (n,) of the mass-scaled motion u (6n,)."""
        np.multiply(u[self._axis :: 6], self._per_root_mass, out=out)

    def reach(self) -> Floats:
        """Shape (1,): of the lightest sphere."""
        return self._per_root_mass.max(keepdims=True)

    def largest(self, record: Floats, _: Floats) -> Floats:
        """Shape (1,), m: of the displacements (k, n)."""
        return abs(record).max(keepdims=True)[0]


@checked
def propagate_from_plane(
    network: Network,
    duration: float,
    height: float,
    *,
    direction: str = "z",
    motion: Motion | None = None,
    interval: float = 1e-6,
    tolerance: float = 1e-9,
    sliding: str = "elastic",
) -> PlaneWave:
    """The two waves that a plane at `height`, m, sends through a packing periodic along z.

    It opens by `motion` along `direction`: z sends P-waves, x and y send S-waves; the other
    arguments are those of `modal.propagate`. InputError for a packing with walls and for a plane
    outside the cell.

    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 40), periodic_z=True)
    >>> propagate_from_plane(crystal, 2e-5, crystal.length / 2).layer_displacement.shape
    (21, 28)
    """
    if not (0 < interval <= duration < np.inf and 0 < tolerance < 1):
        raise InputError(
            "duration and interval must be positive, the interval no longer than the duration, "
            "the tolerance between 0 and 1"
        )
    if direction not in DIRECTIONS:
        raise InputError(f"direction {direction!r}: choose x, y or z")
    if not network.cell_periodic[2]:
        raise InputError("the packing is not periodic along z: its source wall sends the wave")
    low, high = network.wall_position
    if not low <= height <= high:
        raise InputError(
            f"a source at {height:g} m lies outside the cell, which reaches from {low:g} to "
            f"{high:g} m"
        )
    axis, network = DIRECTIONS.index(direction), with_sliding(network, sliding)
    motion = motion or Pulse()
    push = put_on(network, (), PlaneOpens(height, axis)).push[:, 0]
    if not push.any():
        raise InputError(f"nothing resists an opening along {direction} at {height:g} m")
    operator = ContactOperator(network, mass_scaled=True)
    time, recorded, products, truncation = carried(
        operator,
        lambda: RootMass.of(network).over(push),
        _Spheres(network, axis),
        motion,
        duration,
        interval,
        tolerance,
    )
    layers = Layers(network)
    return PlaneWave(
        time,
        motion.displacement(time),
        layers.position,
        np.array([layers.means(row) for row in recorded]),
        recorded,
        float(height),
        direction,
        products,
        truncation,
    )
