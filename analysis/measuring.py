"""What quantities are measured from: a packing, its waves and spectra, each made when asked for.

All settings follow from the packing, without units of their own: the pulse from V / D, lines of
spectra from the highest frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from analysis.case import Case
from analysis.estimators.coherent import Coherent, longest_waves
from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.layer_lattice import is_fcc
from analysis.estimators.low_pass import Passband
from analysis.estimators.own_wave import coherent_of, own_wave
from analysis.estimators.scattering import Scattering
from analysis.estimators.structure_factor import structure_factor
from analysis.packings.settled import why_unsettled
from analysis.prepare import DENSITY_TOLERANCE, line_width, standing_orders
from modal.elasticity.moduli import ElasticModuli, elastic_moduli
from modal.modes.density import density_of_states
from modal.modes.eigenmodes import eigenmodes
from modal.modes.mode_set import ModeSet
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.plausibility import CRYSTALLINE
from modal.packing.state import profile
from modal.packing.summary import crystalline_shares
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.waves.signals import Signals
from modal.waves.source import Motion

NARROW = 10.0
"""Diameters: a narrower packing guides its waves at low frequency already."""


class Measuring:
    """One packing with what was recorded of it; what is missing is made from its contacts."""

    def __init__(
        self,
        network: Network,
        records: Sequence[Signals] = (),
        source: Motion | None = None,
        case: Case | None = None,
    ) -> None:
        self.network, self.records, self.source = network, records, source
        self._case = case

    @cached_property
    def crystal(self) -> bool:
        """Whether it is an FCC crystal between walls, of which theory knows the waves."""
        return is_fcc(self.network)

    @property
    def diameter(self) -> float:
        """Mean diameter, m."""
        return 2 * float(self.network.radius.mean())

    @property
    def walls(self) -> bool:
        """Whether walls bound it along z, so that one can push and the other listen."""
        return bool(np.isin([SOURCE_WALL, RECEIVER_WALL], self.network.particle_j).all())

    @cached_property
    def wave(self) -> Signals:
        """A P-wave along z: the first record of one, or that of the springs, on every particle."""
        return self._wave("z")

    @cached_property
    def shear_wave(self) -> Signals:
        """The same of a wall that slides along x, or as a record has it."""
        return self._wave("xy")

    def _wave(self, directions: str) -> Signals:
        if not self.walls:
            raise InputError("there are no two walls along z, which a wave here goes between")
        for record in self.records:
            if record.direction in directions:
                return record
        return own_wave(self.network, self.source, directions[0])

    @property
    def wave_of_layers(self) -> Signals:
        """The P-wave as its coherent part is read: of a crystal along its chain.

        Slabs a diameter thick would beat with its layers.
        """
        return replace(self.wave, layer_displacement=None) if self.crystal else self.wave

    @cached_property
    def coherent(self) -> Coherent:
        """The coherent part of the P-wave."""
        return coherent_of(self.network, self.wave, self.crystal)

    @cached_property
    def velocity(self) -> float:
        """V_P, m/s, of the longest waves; NaN where none is read."""
        if self.crystal:
            return chain_dispersion(self.wave).velocity
        return longest_waves(self.coherent)[0]

    @cached_property
    def passband(self) -> Passband:
        """The threshold rule on the P-wave."""
        if not self.velocity > 0:
            raise InputError("no coherent wave goes through enough of the packing to be read")
        return Passband(self.network, self.wave, None, velocity=self.velocity, crystal=self.crystal)

    @cached_property
    def highest(self) -> ModeSet:
        """The highest mode."""
        return eigenmodes(self.network, highest=1, certify=False, shapes=False)

    @cached_property
    def line(self) -> float:
        """Width of a line of spectra, Hz."""
        return line_width(self.network)

    @cached_property
    def density(self) -> tuple[Floats, Floats, Floats]:
        """Frequency, Hz, modes per Hz and modes below, of the whole spectrum."""
        if self._case is not None and self._case.density is not None:
            return self._case.density
        states = density_of_states(self.network, resolution=self.line, tolerance=DENSITY_TOLERANCE)
        grid = states.grid()
        return grid, states.density(grid)[0][:, 6], states.count_below(grid)[0][:, 6]

    @cached_property
    def scattering(self) -> Scattering:
        """Width of the ridge of standing waves over frequency."""
        found = None if self._case is None else self._case.structure
        layers = int(self.network.length / self.diameter)
        if found is None:
            highest = 0.75 * self.velocity / self.diameter
            orders = standing_orders(layers)
            found = structure_factor(self.network, orders, self.line, highest)
        return Scattering.of(found, self.velocity, self.diameter)

    @cached_property
    def moduli(self) -> ElasticModuli:
        """Elastic moduli by the springs' static response."""
        known = None if self._case is None else self._case.moduli
        return elastic_moduli(self.network) if known is None else known

    @cached_property
    def of_one_sample(self) -> tuple[str, ...]:
        """What to know of every quantity of this one packing."""
        if self.crystal:
            return ()
        caveats = ["one sample: how samples differ is not in the error; measure further seeds"]
        if left := why_unsettled(self.network):
            caveats.append(f"not in equilibrium: {left}")
        shares = crystalline_shares(self.network, profile(self.network))
        share = shares.get("crystalline_share_of_bulk", shares.get("crystalline_share", 0.0))
        if share > CRYSTALLINE:
            caveats.append(f"crystalline: {100 * share:.0f} % of the bulk; no random packing")
        return tuple(caveats)

    @cached_property
    def of_waves(self) -> tuple[str, ...]:
        """The same of what is read from waves, which a narrow packing guides."""
        periods = self.network.cell_size[self.network.cell_periodic]
        width = float(periods.min(initial=np.inf)) / self.diameter
        if self.crystal or width >= NARROW:
            return self.of_one_sample
        text = f"narrow: {width:.1f} D wide; waves longer than that feel their images"
        return (*self.of_one_sample, text)
