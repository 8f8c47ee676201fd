"""What is recorded of a wave: the chain, both walls, layer means and, if asked, every particle."""

from __future__ import annotations

import numpy as np

from modal.formats.arrays import Floats
from modal.formats.hdf5 import InputError
from modal.packing.layers import Layers
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.stiffness.matrices import mass_diagonal
from modal.stiffness.walls import wall_pattern
from modal.waves.chain import wall_to_wall_chain
from modal.waves.signals import DIRECTIONS, Signals
from modal.waves.source import Motion


class Receivers:
    """What is recorded of a motion u (6n,), as one row of `count` numbers, each linear in u.

    The source wall moves along `direction`, x, y or z, and all is recorded along it. In order:
    force on the source and on the receiver wall (N, walls at rest), displacements of the chain,
    their layer means, and those of all particles where `particles` is asked. With `mass_scaled` it
    is M^1/2 u, not u, that is observed. InputError where the wall cannot move anything that way.
    """

    def __init__(
        self,
        network: Network,
        *,
        pre_stress: str = "none",
        particles: bool = False,
        mass_scaled: bool = False,
        direction: str = "z",
    ) -> None:
        if direction not in DIRECTIONS:
            raise InputError(f"direction {direction!r}: choose x, y or z")
        self.direction, self.axis = direction, DIRECTIONS.index(direction)
        self.network, self.particles = network, particles
        self.chain = wall_to_wall_chain(network)
        self.layers = Layers(network)
        self.source, to_source, self.source_stiffness = wall_pattern(
            network, SOURCE_WALL, pre_stress, self.axis
        )
        if not self.source.any():
            raise InputError(
                f"the source wall moves nothing along {direction}: its contacts have no "
                f"{'normal' if direction == 'z' else 'tangential'} stiffness"
            )
        _, to_receiver, _ = wall_pattern(network, RECEIVER_WALL, pre_stress, self.axis)
        self._near_walls = [(np.flatnonzero(row), row) for row in (to_source, to_receiver)]
        self._near_walls = [(at, row[at]) for at, row in self._near_walls]
        self._per_root_mass = None
        if mass_scaled:
            scale = 1 / np.sqrt(mass_diagonal(network))
            self._near_walls = [(at, row * scale[at]) for at, row in self._near_walls]
            self._per_root_mass = scale[self.axis :: 6].copy()
        self.area = network.area
        self.count = 2 + len(self.chain) + len(self.layers.position)
        self.count += network.n_particles if particles else 0

    def source_force(self, u: Floats, displacement: float) -> float:
        """The force, N, that holds the source wall at `displacement`, m, in the motion u (6n,)."""
        at, row = self._near_walls[0]
        return self.source_stiffness * displacement - float(row @ u[at])

    def observe(self, u: Floats, out: Floats) -> None:
        """Write the row (count,) of the motion u (6n,), m and rad, into `out`."""
        along = u[self.axis :: 6]
        if self._per_root_mass is not None:
            along = along * self._per_root_mass
        for k, (at, row) in enumerate(self._near_walls):
            out[k] = row @ u[at]
        c = 2 + len(self.chain)
        out[2:c] = along[self.chain]
        nl = len(self.layers.position)
        out[c : c + nl] = self.layers.means(along)
        out[c + nl :] = along if self.particles else ()

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
