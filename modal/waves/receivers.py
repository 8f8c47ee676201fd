"""What is recorded of a wave: the chain, both walls, layer means and, if asked, every particle."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from modal.packing.chain import wall_to_wall_chain
from modal.packing.layers import Layers
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.system.contacts import terms_of
from modal.system.imposed import WallMoves, put_on
from modal.system.root_mass import RootMass
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError
from modal.waves.signals import DIRECTIONS, Signals
from modal.waves.source import Motion


class Receivers:
    """What is recorded of a motion M^1/2 u (6n,), as one row of `count` numbers, each linear in it.

    The source wall moves along `direction`, x, y or z, and all is recorded along it. In order:
    force on the source and on the receiver wall (N, walls at rest), displacements of the chain,
    their layer means, and those of all particles where `particles` is asked. InputError
    where the wall cannot move anything that way.
    """

    def __init__(
        self,
        network: Network,
        *,
        pre_stress: str = "none",
        particles: bool = False,
        direction: str = "z",
    ) -> None:
        if direction not in DIRECTIONS:
            raise InputError(f"direction {direction!r}: choose x, y or z")
        self.direction, self.axis = direction, DIRECTIONS.index(direction)
        self.network, self.particles = network, particles
        self.chain = wall_to_wall_chain(network)
        self.layers = Layers(network)
        terms = terms_of(pre_stress)
        here = put_on(network, terms, WallMoves(SOURCE_WALL, self.axis))
        self.source, to_source = here.push[:, 0], here.pull[:, 0]
        self.source_stiffness = float(here.held[0, 0])
        if not self.source.any():
            raise InputError(
                f"the source wall moves nothing along {direction}: its contacts have no "
                f"{'normal' if direction == 'z' else 'tangential'} stiffness"
            )
        there = put_on(network, terms, WallMoves(RECEIVER_WALL, self.axis))
        root = RootMass.of(network)
        scaled = root.over(to_source)
        self._near_source = np.flatnonzero(scaled)
        self._to_source = scaled[self._near_source]
        self.area = network.area
        rows = self._observing(to_source, there.pull[:, 0])
        self._rows = (rows @ root.inverse()).tocsr()
        self.count = self._rows.shape[0]

    def _observing(self, *to_walls: Floats) -> sp.csr_matrix:
        """Shape (count, 6n): what a motion is multiplied by; `to_walls` (6n,) are the first rows.

        A product with it goes through the motion once, and always in the same order.
        """
        layer, size = self.layers.layer, self.layers.size
        held, every = np.flatnonzero(layer >= 0), np.arange(len(layer))

        def along(row: Ints, sphere: Ints, weight: Floats) -> sp.csr_matrix:
            places = row, 6 * sphere + self.axis
            return sp.csr_matrix((weight, places), (int(row.max()) + 1, 6 * len(layer)))

        parts = [sp.csr_matrix(row) for row in to_walls]
        parts.append(along(every[: len(self.chain)], self.chain, np.ones(len(self.chain))))
        parts.append(along(layer[held], held, 1 / size[layer[held]]))
        if self.particles:
            parts.append(along(every, every, np.ones(len(every))))
        return sp.vstack(parts, format="csr")

    def move_as(self, number: Ints) -> None:
        """From now on motions are of other bodies: sphere k of the network moves as `number[k]`.

        That is another numbering, or one for many where spheres move alike.
        """
        particle, component = np.divmod(self._rows.indices, 6)
        columns = 6 * number[particle] + component
        shape = self.count, 6 * (int(number.max()) + 1)
        self._rows = sp.csr_matrix((self._rows.data, columns, self._rows.indptr), shape)
        self._rows.sum_duplicates()

    def source_force(self, u: Floats, displacement: float) -> float:
        """The force, N, that holds the source wall at `displacement`, m, in the motion M^1/2 u."""
        pull = float(self._to_source @ u[self._near_source])
        return self.source_stiffness * displacement - pull

    def observe(self, u: Floats, out: Floats) -> None:
        """Write the row (count,) of the motion M^1/2 u (6n,) into `out`."""
        out[:] = self._rows @ u

    def reach(self) -> Floats:
        """Shape (3,): lengths of the rows, of both walls and the longest of all displacements."""
        length = np.sqrt(np.asarray(self._rows.multiply(self._rows).sum(axis=1)).ravel())
        return np.append(length[:2], length[2:].max())

    def largest(self, record: Array, displacement: Floats) -> Floats:
        """Shape (3,): forces on both walls, N, and motion, m, at most in a record (k, count).

        The source wall is held at `displacement` (k,), m.
        """
        source = self.source_stiffness * displacement - record[:, 0]
        return np.array([abs(part).max() for part in (source, record[:, 1], record[:, 2:])])

    def signals(
        self,
        time: Floats,
        rows: Floats,
        motion: Motion,
        *,
        time_step: float,
        run_time: float,
        network_sha256: str = "",
    ) -> Signals:
        """The signals of rows (nt, count) at the times (nt,) under the source's `motion`."""
        d = motion.displacement(time)
        c, nl = 2 + len(self.chain), len(self.layers.position)
        return Signals(
            time=time,
            chain_particle=self.chain,
            chain_position=self.network.position[self.chain, 2],
            chain_displacement=rows[:, 2:c],
            source_displacement=d,
            source_stress=(self.source_stiffness * d - rows[:, 0]) / self.area,
            receiver_stress=rows[:, 1] / self.area,
            producer="linear",
            case=str(self.network.study.get("case", "")),
            amplitude=motion.amplitude,
            input_frequency=motion.frequency,
            time_step=time_step,
            run_time=run_time,
            network_sha256=network_sha256,
            direction=self.direction,
            layer_position=self.layers.position,
            layer_displacement=rows[:, c : c + nl],
            particle_displacement=rows[:, c + nl :] if self.particles else None,
        )
