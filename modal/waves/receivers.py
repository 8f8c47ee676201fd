"""Record the motion of a chain of spheres, means over layers and discs, or all spheres."""

from collections.abc import Sequence
from typing import Any, Required, TypedDict, Unpack

import numpy as np
import scipy.sparse as sp

from modal.packing.chain import wall_to_wall_chain
from modal.packing.ends import has_two_ends
from modal.packing.layers import Layers
from modal.packing.network import Network
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError
from modal.waves.discs import Disc
from modal.waves.energy_balance import EnergyBalance
from modal.waves.motions import Motion
from modal.waves.signals import COMPONENT, Direction, Signals
from modal.waves.sources import Source, direction_of


class SignalSettings(TypedDict, total=False):
    """Fields of `Signals` that describe the computation, and that receivers do not know."""

    producer: Required[str]
    time_step: Required[float]
    run_time: Required[float]
    balance: EnergyBalance | None
    slip_ends: Ints | None
    slip_energy: Floats | None


class Receivers:
    """The receivers of motions u (6n,) along x, y or z, or of turns about z ("torsion").

    Parameters
    ----------
    network : Network
        The packing of n spheres.
    direction : str
        "x", "y", "z" or "torsion"; InputError for any other word.
    particles : bool
        Whether to record every sphere.
    discs : sequence of Disc
        Discs whose mean motion is recorded; InputError for a disc with another direction.

    Attributes
    ----------
    rows : sparse matrix (count, 6n)
        Matrix that gives, from u, the displacements of the chain, the means of the layers and of
        the discs, and the displacements of all spheres.
    chain : ndarray (nc,)
        Spheres from wall to wall; empty if there are no two walls, flat or rough.
    layers : Layers
    """

    def __init__(
        self,
        network: Network,
        direction: Direction = "z",
        *,
        particles: bool = False,
        discs: Sequence[Disc] = (),
    ) -> None:
        if direction not in COMPONENT:
            raise InputError(
                "direction", f"direction {direction!r}", remedy=f"choose {', '.join(COMPONENT)}"
            )
        self.direction = direction
        self.network = network
        self.particles = particles
        self.discs = discs
        for disc in discs:
            direction_of(disc, direction)
        self.walls = has_two_ends(network)
        self.chain = np.empty(0, int)
        if self.walls:
            self.chain = wall_to_wall_chain(network)
        self.layers = Layers(network)
        every_sphere = sp.identity(network.n_particles, format="csr")
        readings = [every_sphere[self.chain], _layer_means(self.layers)]
        if len(discs):
            readings.append(sp.csr_matrix([_disc_mean(network, disc) for disc in discs]))
        if particles:
            readings.append(every_sphere)
        component = np.eye(6)[[COMPONENT[direction]]]
        self.rows = sp.kron(sp.vstack(readings), component, format="csr")

    def columns(self, record: Array, stresses: Sequence[str]) -> dict[str, Any]:
        """Return the fields of a recording from a record (k, count).

        The record has first the forces that belong to `stresses`, N, then the readings of `rows`.
        Stresses are these forces divided by the area of the cell.
        """
        forces, readings = np.split(record, [len(stresses)], axis=1)
        ends = np.cumsum([len(self.chain), len(self.layers.position), len(self.discs)])
        chain, layers, discs, spheres = np.split(readings, ends, axis=1)
        fields = {
            **dict(zip(stresses, forces.T / self.network.area, strict=True)),
            "direction": self.direction,
            "chain_particle": self.chain,
            "chain_displacement": chain,
            "layer_position": self.layers.position,
            "layer_displacement": layers,
        }
        if len(self.discs):
            positions = [disc.position_in(self.network) for disc in self.discs]
            fields["disc_position"] = np.array(positions)
            fields["disc_displacement"] = discs
        if self.particles:
            fields["particle_displacement"] = spheres
        return fields

    def signals(
        self,
        time: Floats,
        record: Array,
        motion: Motion,
        source: Source,
        stresses: Sequence[str],
        **settings: Unpack[SignalSettings],
    ) -> Signals:
        """Return the signals of a record (nt, count), as `columns` describes it, at times (nt,), s.

        `settings` are further fields of `Signals`.
        """
        return Signals(
            time=time,
            chain_position=self.network.position[self.chain, 2],
            source_displacement=motion.displacement(time),
            source=source.name,
            source_height=source.height_in(self.network),
            source_position=source.position_in(self.network),
            case=str(self.network.study.get("case", "")),
            amplitude=motion.amplitude,
            input_frequency=motion.frequency,
            **self.columns(record, stresses),
            **settings,
        )


def _layer_means(layers: Layers) -> sp.csr_matrix:
    """Return the matrix (nl, n) that averages over the spheres of each layer."""
    in_layer = np.flatnonzero(layers.layer >= 0)
    layer = layers.layer[in_layer]
    weights = 1 / layers.size[layer]
    return sp.csr_matrix((weights, (layer, in_layer)), (len(layers.size), len(layers.layer)))


def _disc_mean(network: Network, disc: Disc) -> Floats:
    """Return the weights (n,) that average over the spheres of a disc."""
    spheres = disc.spheres(network)
    weights = np.zeros(network.n_particles)
    weights[spheres] = 1 / len(spheres)
    return weights
