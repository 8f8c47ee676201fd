"""What is recorded of a motion: the chain, layer means, and if asked every sphere."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from modal.packing.chain import wall_to_wall_chain
from modal.packing.layers import Layers
from modal.packing.network import Network
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.waves.signals import COMPONENT, Signals
from modal.waves.source import Motion
from modal.waves.sources import Source


class Receivers:
    """What is recorded of motions u (6n,) along a direction: x, y, z, or turns about z ("torsion").

    `rows` (count, 6n) reads it: the chain's displacements, the layers' means, and those of all
    spheres where `particles` is asked. `chain` is empty where there are no two walls. InputError
    for another direction.
    """

    def __init__(self, network: Network, direction: str = "z", *, particles: bool = False) -> None:
        if direction not in COMPONENT:
            raise InputError(f"direction {direction!r}: choose {', '.join(COMPONENT)}")
        self.direction, self.network, self.particles = direction, network, particles
        self.walls = not network.cell_periodic[2]
        self.chain = wall_to_wall_chain(network) if self.walls else np.empty(0, int)
        self.layers = Layers(network)
        layer, size = self.layers.layer, self.layers.size
        held, every = np.flatnonzero(layer >= 0), sp.identity(len(layer), format="csr")
        means = sp.csr_matrix((1 / size[layer[held]], (layer[held], held)), (len(size), len(layer)))
        read = sp.vstack([every[self.chain], means, *[every] * particles])
        self.rows = sp.kron(read, np.eye(6)[[COMPONENT[direction]]], format="csr")

    def columns(self, record: Array, stresses: Sequence[str]) -> dict[str, Any]:
        """Fields of a recording (k, count): first forces, N, so named, then what `rows` have read.

        Stresses are those forces over the area of the cell.
        """
        forces, seen = np.split(record, [len(stresses)], axis=1)
        c, nl = len(self.chain), len(self.layers.position)
        return {
            **dict(zip(stresses, forces.T / self.network.area, strict=True)),
            "direction": self.direction,
            "chain_particle": self.chain,
            "chain_displacement": seen[:, :c],
            "layer_position": self.layers.position,
            "layer_displacement": seen[:, c : c + nl],
            **({"particle_displacement": seen[:, c + nl :]} if self.particles else {}),
        }

    def signals(
        self,
        time: Floats,
        record: Array,
        motion: Motion,
        source: Source,
        stresses: Sequence[str],
        **settings: Any,
    ) -> Signals:
        """The signals of a record (nt, count) as of `columns`, at times (nt,) of a source's motion.

        `settings`: the further fields of `Signals`, producer, time step and so on.
        """
        return Signals(
            time=time,
            chain_position=self.network.position[self.chain, 2],
            source_displacement=motion.displacement(time),
            source=source.name,
            source_height=source.height_in(self.network),
            case=str(self.network.study.get("case", "")),
            amplitude=motion.amplitude,
            input_frequency=motion.frequency,
            **self.columns(record, stresses),
            **settings,
        )
