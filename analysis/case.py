"""A case: one packing and what was made of it, read on demand."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from analysis.case_files import SHEAR, CaseFiles, case_name
from analysis.estimators.damped_transform import UNEVEN, layer_distance
from analysis.estimators.effective_medium import of_contacts
from analysis.estimators.layer_lattice import LayerLattice, is_fcc
from analysis.estimators.own_wave import INTERVAL, RECORD, affine_frequency, own_pulse
from analysis.estimators.settled import MARK, why_unsettled
from analysis.estimators.source_motion import recorded_motion
from analysis.estimators.structure_factor import StructureFactor, read_structure
from modal.elasticity.moduli import ElasticModuli, read_moduli
from modal.exchange.registry import read_remarked
from modal.modes.density import read_density
from modal.modes.mode_set import ModeSet, read_modes, read_z_shapes
from modal.packing.network import Network
from modal.packing.state import FORCES, stress_tensor
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.response import Response, read_response
from modal.waves.signals import Signals, read_signals
from modal.waves.source import Motion


class Case(CaseFiles):
    """One packing and what was made of it; what is None is absent."""

    @cached_property
    def network(self) -> Network:
        """Contact network."""
        return read_remarked(self.packing_path, self.notes.append)

    @cached_property
    def lattice(self) -> LayerLattice:
        """The lattice of layers that the theory of a crystal reduces to."""
        if not self.is_crystal:
            raise InputError(
                f"{self.name}: no FCC crystal between two walls, so it has no theory to compare "
                "with; take another packing"
            )
        return LayerLattice.of_network(self.network)

    @cached_property
    def is_crystal(self) -> bool:
        """Whether the case has a theory: its packing is an FCC crystal, whatever its number."""
        return is_fcc(self.network)

    @property
    def mu_comp(self) -> float:
        """Friction of the compression; the wave's is 0.1 more (section 2). NaN if unknown."""
        study = self.network.study
        friction = study.get("mu_comp", float(study.get("mu_wave", np.nan)) - 0.1)
        return round(float(friction), 6)

    @property
    def diameter(self) -> float:
        """Mean diameter, m."""
        return 2 * float(self.network.radius.mean())

    @property
    def stress(self) -> float:
        """Stress, Pa, as the network's study states it; else the mean that its contacts bear.

        That to three digits; NaN without contact forces.
        """
        stated = self.stated_stress
        if np.isfinite(stated) or any(getattr(self.network, name) is None for name in FORCES):
            return stated
        return float(f"{np.trace(stress_tensor(self.network)) / 3:.3g}")

    @property
    def stated_stress(self) -> float:
        """Stress, Pa, that the packing was made for, as its network says; NaN if it does not."""
        return float(self.network.study.get("stress", np.nan))

    @property
    def under_stress(self) -> str:
        """`, 100 kPa`; empty where the stress is unknown."""
        return f", {self.stress / 1e3:g} kPa" if np.isfinite(self.stress) else ""

    @cached_property
    def label(self) -> str:
        """Short name for legends: what it is, and under which stress."""
        kind = "FCC" if self.is_crystal else "random"
        mark = f", {MARK}" if self.unsettled else ""
        return f"{kind}{self.under_stress} ({self.short}{mark})"

    @cached_property
    def unsettled(self) -> str:
        """Why its state does not count as settled; empty where it does."""
        return why_unsettled(self.network, np.nan if self.is_crystal else self.stated_stress)

    def _modes(self, kind: str, *, shapes: bool = False) -> ModeSet | None:
        return read_modes(self.product(kind), shapes=shapes) if self.has(kind) else None

    @cached_property
    def modes(self) -> ModeSet | None:
        """Modes with rotations, without their shapes."""
        return self._modes("modes")

    @cached_property
    def z_shapes(self) -> Floats | None:
        """Shape (k, n), kg^-1/2: how each of the modes moves the particles along z, as waves do."""
        return read_z_shapes(self.product("modes")) if self.has("modes") else None

    @cached_property
    def translations(self) -> ModeSet | None:
        """Modes without rotations."""
        return self._modes("translations.modes")

    @cached_property
    def band(self) -> ModeSet | None:
        """Modes of a band of higher frequencies, for chi_z."""
        return self._modes("band.modes")

    @cached_property
    def highest(self) -> ModeSet | None:
        """The highest modes, from which a run's time step was taken."""
        return self._modes("highest.modes", shapes=True)

    @cached_property
    def recorded(self) -> Signals | None:
        """The recorded wave; None where its wall slid, which is no P-wave but in `shear`."""
        found = self._recorded("signals")
        return found if found is not None and found.direction == "z" else None

    @cached_property
    def signals(self) -> Signals | None:
        """The recorded wave of a DEM run; None where the springs themselves have made it."""
        found = self.recorded
        if found is None or found.producer != "linear":
            return found
        self.notes.append(
            f"{self.path('signals')}: a linear wave, no run; its network's own is made anew, with "
            "the same motion of the source"
        )
        return None

    @cached_property
    def shear(self) -> list[Signals]:
        """S-waves, YADE's first: of each producer one, that of the first of `SHEAR`."""
        found: dict[str, Signals] = {}
        for record in map(self._recorded, SHEAR):
            if record is not None and record.direction != "z":
                found.setdefault(record.producer, record)
        return list(found.values())

    def _recorded(self, kind: str) -> Signals | None:
        if not self.has(kind):
            return None
        signals = read_signals(self.product(kind))
        if signals.chain_displacement.shape[0] < 50 or signals.chain_displacement.shape[1] < 10:
            raise InputError(f"{self.path(kind)}: fewer than 50 times or 10 particles; record more")
        books = signals.balance
        if books is not None and not books.kept:
            self.notes.append(
                f"{self.path(kind)}: the energy drifts by {books.drift:.1e}, limit "
                f"{books.limit:.1e}, and {books.gap:.1e} of the source wall's work is not "
                "accounted for; do not trust this run"
            )
        if signals.chain_particle.max() >= self.network.n_particles:
            raise InputError(f"{self.path(kind)}: its chain leaves the network; run it again")
        if self.is_crystal:
            layers = layer_distance(signals) / self.lattice.distance
            if abs(layers - 1) > UNEVEN:
                raise InputError(
                    f"{self.path(kind)}: its chain has a particle in every {layers:.3g} layers of "
                    "the crystal, of which neither band nor wavelength can be read; record one in "
                    "each"
                )
        return signals

    @cached_property
    def structure(self) -> StructureFactor | None:
        """Dynamic structure factor, as `measure --keep` makes it."""
        return read_structure(self.product("structure")) if self.has("structure") else None

    @cached_property
    def density(self) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Frequency (Hz), modes per Hz and modes below, of the whole spectrum; zero modes in it."""
        return read_density(self.product("density")) if self.has("density") else None

    @cached_property
    def response(self) -> Response | None:
        """Gain over frequency, from `python -m modal response`, of elastic contacts and P-waves."""
        if not self.has("response"):
            return None
        found = read_response(self.product("response"))
        if found.damping or found.direction != "z":
            raise InputError(
                f"{self.path('response')}: of viscous contacts or of an S-wave, which the report's "
                "gain is not; leave it out, or make it without --damping and --direction"
            )
        return found

    @cached_property
    def moduli(self) -> ElasticModuli | None:
        """Elastic moduli, from `python -m modal moduli`."""
        return read_moduli(self.product("moduli")) if self.has("moduli") else None

    @cached_property
    def passage(self) -> float:
        """Time from wall to wall, s, of a wave that strains the packing evenly: none is faster."""
        return self.network.length / of_contacts(self.network).velocity

    @property
    def interval(self) -> float:
        """Between records of the linear wave, s, by `INTERVAL`.

        Or a little less: a whole number of the run's intervals, so that the two share their times.
        """
        wanted = INTERVAL / affine_frequency(self.network)
        if self.recorded is None:
            return wanted
        own = float(self.recorded.time[1] - self.recorded.time[0])
        return own * max(1, int(wanted / own))

    @cached_property
    def wave(self) -> Signals:
        """The linear wave of the springs, every particle recorded, from wall to wall and back."""
        return self.linear_wave(particles=True)

    def linear_wave(self, *, particles: bool) -> Signals:
        """That wave, on request on every particle, of the source's `motion`.

        Every particle takes half of the time.
        """
        return propagate(
            self.network,
            RECORD * self.passage,
            motion=self.motion,
            interval=self.interval,
            particles=particles,
        ).signals

    @property
    def record(self) -> Signals:
        """What YADE recorded, or the linear wave where it has not run."""
        return self.signals or self.wave

    def record_of(self, frequency: float) -> Signals:
        """The run of a pulse of this frequency, Hz, where there is one; else the case's record."""
        kind = f"{frequency / 1e3:g}kHz.signals"
        return read_signals(self.product(kind)) if self.has(kind) else self.record

    @cached_property
    def motion(self) -> Motion:
        """How the source wall moves: as recorded, else by the packing's own pulse."""
        if self.recorded is not None:
            return recorded_motion(self.recorded)
        return own_pulse(self.network)

    def linear(self, pre_stress: str = "none") -> Signals:
        """The linear wave of the network at the times of the recorded wave.

        Where there is no record, ten times a period of the pulse for one passage. Like everything
        called linear here it is that of the springs alone; `pre_stress`
        (`modal.system.contacts`) adds what the contacts' forces do.
        """
        recorded, motion, interval = self.recorded, self.motion, 0.1 / self.motion.frequency
        if recorded is not None:
            duration = float(recorded.time[-1])
            interval = float(recorded.time[1] - recorded.time[0])
        else:
            duration = self.passage
        wave = propagate(
            self.network, duration, motion=motion, interval=interval, pre_stress=pre_stress
        )
        return wave.signals


def find(text: str, folder: str | Path) -> Case:
    """The products of a case in a folder."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; run the cases first, or give --products DIR")
    return Case(case_name(text), folder)
