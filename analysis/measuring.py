"""What quantities are measured from: a packing, its waves and spectra, each made when asked for.

All settings follow from the packing, without units of their own: the pulse from V / D, lines of
spectra from the highest frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from analysis.case import Case
from analysis.estimators.coherent import DECAY, PASSAGES, Coherent, longest_waves
from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.effective_medium import of_contacts
from analysis.estimators.finite_amplitude import FiniteAmplitude, finite_amplitude
from analysis.estimators.layer_lattice import is_fcc
from analysis.estimators.low_pass import Passband
from analysis.estimators.other_source import as_of_pulse
from analysis.estimators.own_wave import affine_frequency, coherent_of, own_pulse, own_wave
from analysis.estimators.plane_waves import plane_structure_factor
from analysis.estimators.scattering import Scattering
from analysis.estimators.settled import why_unsettled
from analysis.estimators.source_motion import recorded_motion
from analysis.estimators.structure_factor import structure_factor
from analysis.estimators.transfer import Gain, network_gain
from analysis.estimators.travel_time import cut, first_peaks_of_columns
from analysis.measures import Measures
from analysis.prepare import DENSITY_TOLERANCE, line_width, prepare
from analysis.value import hertz
from modal.elasticity.moduli import ElasticModuli, elastic_moduli
from modal.modes.density import density_of_states
from modal.modes.eigenmodes import eigenmodes
from modal.modes.mode_set import ModeSet
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network, write_network
from modal.packing.plausibility import CRYSTALLINE
from modal.packing.sample import Sample
from modal.packing.state import profile
from modal.packing.summary import crystalline_shares
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.waves.signals import Signals
from modal.waves.source import Motion, Pulse

NARROW = 10.0
"""Diameters: a narrower packing guides its waves at low frequency already."""
WINDOWS = DECAY, DECAY - 1, DECAY + 1
"""Dampings of the window of the coherent wave: the estimator's, and two that tell an error."""
COARSE = 2.0
"""Width of the lines in which the Ioffe-Regel limit is sought, in those of the whole ridge: waves
are a third as wide there as their frequency, hence a tenth of the highest one."""


class Measuring:
    """One packing with what was recorded of it; what is missing is made from its contacts.

    `case` has further files of the packing. `keep` is a folder in which costly spectra are kept,
    and found again. `sample` and `amplitudes`, m, are for waves of finite amplitude.
    """

    def __init__(
        self,
        network: Network,
        records: Sequence[Signals] = (),
        source: Motion | None = None,
        case: Case | None = None,
        keep: str | Path | None = None,
        sample: Sample | None = None,
        amplitudes: Sequence[float] = (),
    ) -> None:
        self.sample, self.amplitudes = sample, amplitudes
        self.network, self.records, self.source = network, records, source
        self._case, self._keep = case, keep

    @classmethod
    def of_case(cls, measures: Measures) -> Measuring:
        """A case with what has been measured of it."""
        found = cls(measures.case.network, (), None, measures.case)
        found.measures = measures
        return found

    @cached_property
    def measures(self) -> Measures:
        """What its files give; InputError where it has none."""
        if self._case is None:
            raise InputError("it is read from files of the packing; give these")
        return Measures(self._case)

    @cached_property
    def crystal(self) -> bool:
        """Whether it is an FCC crystal between walls, of which theory knows the waves."""
        return self.walls and is_fcc(self.network)

    @property
    def files(self) -> list[Path]:
        """Files of the packing and of what was made of it."""
        return [] if self._case is None else list((self._case.files or {}).values())

    @property
    def diameter(self) -> float:
        """Mean diameter, m."""
        return 2 * float(self.network.radius.mean())

    @property
    def width(self) -> float:
        """The narrower side of the cell, mean diameters."""
        return float(self.network.cell_size[:2].min()) / self.diameter

    @property
    def walls(self) -> bool:
        """Whether walls bound it along z, so that one can push and the other listen."""
        return bool(np.isin([SOURCE_WALL, RECEIVER_WALL], self.network.particle_j).all())

    def require_walls(self) -> None:
        """InputError without them."""
        if not self.walls:
            raise InputError("there are no two walls along z, which a wave here goes between")

    @cached_property
    def wave(self) -> Signals:
        """A P-wave along z: the first record of one, or that of the springs, on every particle."""
        return self._wave("z")

    @cached_property
    def shear_wave(self) -> Signals:
        """The same of a wall that slides along x, or as a record has it."""
        return self._wave("xy")

    def _wave(self, directions: str) -> Signals:
        self.require_walls()
        for record in self.records:
            if record.direction in directions:
                return self._of_pulse(record)
        return self._of_pulse(own_wave(self.network, self.source, directions[0]))

    def _of_pulse(self, record: Signals) -> Signals:
        """A record as it would be of a pulse, which rules on amplitudes are made for."""
        motion = recorded_motion(record)
        if isinstance(motion, Pulse) and motion.cycles == 1:
            return record
        return as_of_pulse(record, own_pulse(self.network))

    @property
    def short_wave(self) -> Signals:
        """The P-wave up to when the wave of even strains has come a third of the way back."""
        network = self.network
        return cut(self.wave, PASSAGES * network.length / of_contacts(network).velocity)

    @cached_property
    def finite(self) -> FiniteAmplitude:
        """Waves of the sample that are pushed both ways by each of the amplitudes."""
        if self.sample is None:
            raise InputError("waves of finite amplitude are those of a sample, with its friction")
        motion = self.source or own_pulse(self.network)
        rate = affine_frequency(self.network) * self.diameter / self.network.length
        return finite_amplitude(self.sample, self.amplitudes, motion.frequency, PASSAGES / rate)

    @cached_property
    def first_peaks_of_columns(self) -> tuple[float, float]:
        """V_P, m/s, of first peaks along every column of spheres: mean and scatter."""
        return first_peaks_of_columns(self.short_wave, self.network)

    @property
    def coherent(self) -> Coherent:
        """The coherent part of the P-wave."""
        return self.coherents[0]

    @cached_property
    def coherents(self) -> list[Coherent]:
        """The same under windows of three dampings, which tell how far the window decides."""
        return [coherent_of(self.network, self.wave, self.crystal, decay) for decay in WINDOWS]

    @cached_property
    def velocity(self) -> float:
        """V_P, m/s, of the longest waves; NaN where none is read."""
        if not self.walls:
            return float(self.moduli.velocities((0, 0, 1))[0])
        if self.crystal:
            return chain_dispersion(self.wave).velocity
        return longest_waves(self.coherent)[0]

    @property
    def needed_velocity(self) -> float:
        """V_P; InputError where none is read."""
        if not self.velocity > 0:
            raise InputError("no coherent wave goes through enough of the packing to be read")
        return self.velocity

    @cached_property
    def passband(self) -> Passband:
        """The threshold rule on the P-wave."""
        self.require_walls()
        velocity = self.needed_velocity
        return Passband(self.network, self.wave, None, velocity=velocity, crystal=self.crystal)

    @cached_property
    def highest(self) -> ModeSet:
        """The highest mode."""
        return eigenmodes(self.network, highest=1, certify=False, shapes=False)

    @cached_property
    def line(self) -> float:
        """Width of a line of spectra, Hz."""
        return line_width(self.network)

    def _kept(self, kind: str) -> Case | None:
        """The case that has a file of this kind: given, or kept in a folder; None without one.

        One that lies in that folder and is stale is made again.
        """
        folder = None if self._keep is None else Path(self._keep)
        case = self._case
        given = case is not None and case.has(kind)
        if given and (folder is None or case.path(kind).parent.resolve() != folder.resolve()):
            return case
        if folder is None:
            return None
        folder.mkdir(parents=True, exist_ok=True)
        if self._case is None:
            name = self.network.fingerprint[:16]
            packing = folder / f"{name}.network.h5"
            if not packing.is_file():
                write_network(packing, self.network)
        else:
            name, packing = self._case.name, self._case.packing_path
        of = "sample" if self._case is not None and self._case.has("sample") else "network"
        kept = Case(name, folder, {of: packing})
        prepare(kept, [kind])
        kept.files = {of: packing, kind: kept.path(kind)}
        return kept

    @cached_property
    def density(self) -> tuple[Floats, Floats, Floats]:
        """Frequency, Hz, modes per Hz and modes below, of the whole spectrum."""
        if (kept := self._kept("density")) is not None and kept.density is not None:
            return kept.density
        states = density_of_states(self.network, resolution=self.line, tolerance=DENSITY_TOLERANCE)
        grid = states.grid()
        return grid, states.density(grid)[0][:, 6], states.count_below(grid)[0][:, 6]

    @cached_property
    def scattering(self) -> Scattering:
        """Width of the ridge of standing waves over frequency, as far as their limit needs it.

        Of some waves first, then of those on both sides of where the width reaches the frequency.
        """
        kept = self._kept("structure")
        velocity, diameter = self.needed_velocity, self.diameter
        if kept is not None and kept.structure is not None:
            return Scattering.of(kept.structure, velocity, diameter)
        line, highest = COARSE * self.line, 0.75 * velocity / diameter
        # Waves in a length: halves of standing waves between walls, whole ones in a cell without.
        fit = 2 if self.walls else 1

        def ridge(orders: Floats) -> Scattering:
            whole = np.unique(orders.round()).astype(int)
            if self.walls:
                found = structure_factor(self.network, whole, line, highest)
            else:
                along = whole[:, None] * np.array([0, 0, 1])
                found = plane_structure_factor(self.network, along, "L", line, highest)
            return Scattering.of(found, velocity, diameter)

        most = max(1.0, 0.5 * fit * self.network.length / diameter)
        first = ridge(np.geomspace(max(1.0, most / 20), most, 8))
        if not np.isfinite(first.limit):
            return first
        near = fit * self.network.length * first.limit / velocity
        return ridge(np.linspace(0.7 * near, 1.2 * near, 8))

    @cached_property
    def gain(self) -> Gain:
        """Gain factor of P-waves from wall to wall, without damping."""
        self.require_walls()
        if (kept := self._kept("response")) is not None and (found := kept.response) is not None:
            return Gain(found.frequency, found.gain, found.resolution)
        passage = self.network.length / of_contacts(self.network).velocity
        return network_gain(self.network, passage)

    @cached_property
    def moduli(self) -> ElasticModuli:
        """Elastic moduli by the springs' static response."""
        known = None if self._case is None else self._case.moduli
        return elastic_moduli(self.network) if known is None else known

    @cached_property
    def modes(self) -> tuple[ModeSet, Floats, str]:
        """The lowest modes, how they move the spheres along z (k, n), and what they lack.

        Of a file where there is one with shapes, else some that are searched for.
        """
        n, case = 6 * self.network.n_particles, self._case
        modes, along_z = (None, None) if case is None else (case.modes, case.z_shapes)
        if modes is None or along_z is None:
            modes = eigenmodes(self.network, lowest=min(LOWEST, n - 6))
            if modes.mode_shape is None:
                raise InputError("the modes' shapes take too much memory; give a file of modes")
            along_z = modes.mode_shape[:, :, 2]
        count, lacks = len(modes.frequency), ""
        if count + modes.floppy_modes < n:
            end = hertz(modes.frequency[-1])
            lacks = f"list not complete: {count} of {n} modes, up to {end}"
        if modes.missing:
            lacks += f"; {modes.missing} of them are missing"
        return modes, along_z, lacks

    @cached_property
    def first_wave(self) -> float:
        """Hz: of the longest shear wave of a cell without walls, V_S over the cell's side."""
        if not self.network.cell_periodic.all():
            raise InputError("between walls waves have other frequencies: take a periodic cell")
        axes = zip(np.eye(3), self.network.cell_size, strict=True)
        return float(min(self.moduli.velocities(axis)[-1] / side for axis, side in axes))

    @cached_property
    def soft_modes(self) -> ModeSet:
        """All modes below the first wave, certified; zero modes are not among them."""
        modes = eigenmodes(self.network, below=self.first_wave)
        if modes.missing or not len(modes.frequency):
            raise InputError(f"below the first wave {modes.missing} modes are missing of some")
        return modes

    @cached_property
    def of_one_sample(self) -> tuple[str, ...]:
        """What to know of every quantity of this one packing."""
        if self.crystal:
            return ()
        caveats = ["one sample: how samples differ is not in the error; measure further seeds"]
        # Three stresses that differ, as of a triaxial compression, are no fault.
        study = self.network.study
        equal = not {"stress_ratio", "oedometric"} & set(study)
        target = float(study.get("stress", np.nan)) if equal else np.nan
        if left := why_unsettled(self.network, target):
            caveats.append(f"not in equilibrium: {left}")
        shares = crystalline_shares(self.network, profile(self.network))
        share = shares.get("crystalline_share_of_bulk", shares.get("crystalline_share", 0.0))
        if share > CRYSTALLINE:
            caveats.append(f"crystalline: {100 * share:.0f} % of the bulk; no random packing")
        return tuple(caveats)

    @cached_property
    def of_waves(self) -> tuple[str, ...]:
        """The same of what is read from waves, which a narrow packing guides."""
        if self.crystal or self.width >= NARROW:
            return self.of_one_sample
        text = f"narrow: {self.width:.1f} D wide; waves longer than that feel their images"
        return (*self.of_one_sample, text)

    def of_frequency(self, frequency: float) -> tuple[str, ...]:
        """The same of what is read at a frequency, Hz, where the wave may be wider than the cell.

        As the wave of V_P has it, of which none is shorter at this frequency.
        """
        longest = self.velocity / frequency / self.diameter
        if self.crystal or not longest > self.width:
            return self.of_waves
        text = (
            f"wavelength above the width: {longest:.0f} D at {hertz(frequency)}, the "
            f"packing is {self.width:.1f} D wide"
        )
        return (*self.of_waves, text)


LOWEST = 40
"""Modes that are searched for where no file has any."""
