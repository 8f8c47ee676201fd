"""What quantities are measured from: a packing, its waves and spectra, each made when asked for.

All settings follow from the packing, without units of their own: the pulse from V / D, lines of
spectra from the highest frequency. Spheres ten times smaller hear the same of a pulse ten times
shorter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from analysis.case import SHEAR, Case
from analysis.estimators.coherent import PASSAGES
from analysis.estimators.damped_transform import UNEVEN, layer_distance
from analysis.estimators.effective_medium import of_contacts
from analysis.estimators.layer_lattice import LayerLattice, is_fcc
from analysis.estimators.settled import MARK, why_unsettled
from analysis.estimators.source_motion import as_of_pulse, recorded_motion
from analysis.estimators.travel_time import cut
from modal.elasticity.moduli import ElasticModuli, elastic_moduli
from modal.exchange.registry import read_remarked
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.plausibility import CRYSTALLINE
from modal.packing.sample import Sample
from modal.packing.state import FORCES, profile, stress_tensor
from modal.packing.summary import crystalline_shares
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.signals import Signals
from modal.waves.source import Motion, Pulse

FREQUENCY = 0.33
"""Of the pulse, in V / D of the affine wave: 100 kHz in the crystal of glass at 100 kPa. A
crystal's band ends at 0.45, a random packing's long before."""
AMPLITUDE = 1e-6
"""Of the pulse, mean diameters: 2.5 nm in the study."""
INTERVAL = 0.4
"""Between records, in D / V: two samples at 1.25 V / D, above all modes."""
RECORD = 1.5 * PASSAGES
"""Length of the record, in passages from wall to wall of the affine wave."""
SLOWER = 0.5
"""Least V_S over V_P for which an S-wave's record is long enough."""
LINE = 0.005
"""Width of a line of the structure factor and of the density of states, in parts of the highest
frequency: 1 kHz in the study's packings under 100 kPa."""
NARROW = 10.0
"""Diameters: a narrower packing guides its waves at low frequency already."""
FEWEST = 50, 10
"""Times and particles of a record that is read."""
Found = TypeVar("Found", bound=Callable[..., Any])


def once(of: Found) -> Found:
    """What a function finds of a packing, and of further names, is found once."""

    @wraps(of)
    def found(m: Measuring, *given: Any) -> Any:
        if (of, *given) not in m.found:
            m.found[of, *given] = of(m, *given)
        return m.found[of, *given]

    return cast(Found, found)


class Measuring:
    """One packing with what was recorded of it; what is missing is made from its contacts.

    `records` are waves; None means those among the files of `case`, which has further files of the
    packing. `keep` is a folder in which costly spectra are kept, and found again. `sample` and
    `amplitudes`, m, are for waves of finite amplitude. `stated` are lower and upper ends of what a
    study states of it, by quantity: figures show it.
    """

    def __init__(
        self,
        network: Network,
        records: Sequence[Signals] | None = (),
        source: Motion | None = None,
        case: Case | None = None,
        keep: str | Path | None = None,
        sample: Sample | None = None,
        amplitudes: Sequence[float] = (),
    ) -> None:
        self.sample, self.amplitudes = sample, amplitudes
        self.network, self.source = network, source
        self.case = case or Case("packing", Path(), {})
        self.stated: dict[str, tuple[float, float]] = {}
        self.found: dict[Any, Any] = {}
        self.keep = keep
        if records is not None:
            self.records = list(records)

    @classmethod
    def of(cls, case: Case) -> Measuring:
        """A case with the records among its files."""
        return cls(read_remarked(case.packing_path, case.notes.append), None, None, case)

    # What the packing is.

    @cached_property
    def crystal(self) -> bool:
        """Whether it is an FCC crystal between walls, of which theory knows the waves."""
        return self.walls and is_fcc(self.network)

    @cached_property
    def lattice(self) -> LayerLattice:
        """The lattice of layers that the theory of a crystal reduces to."""
        if not self.crystal:
            raise InputError(
                f"{self.case.name}: no FCC crystal between two walls, so it has no theory to "
                "compare with; take another packing"
            )
        return LayerLattice.of_network(self.network)

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

    @property
    def mu_comp(self) -> float:
        """Friction of the compression; the wave's is 0.1 more (section 2). NaN if unknown."""
        study = self.network.study
        friction = study.get("mu_comp", float(study.get("mu_wave", np.nan)) - 0.1)
        return round(float(friction), 6)

    @property
    def stated_stress(self) -> float:
        """Stress, Pa, that the packing was made for, as its network says; NaN if it does not."""
        return float(self.network.study.get("stress", np.nan))

    @property
    def stress(self) -> float:
        """The same; where it is not said the mean that the contacts bear, to three digits.

        NaN without contact forces.
        """
        stated = self.stated_stress
        if np.isfinite(stated) or any(getattr(self.network, name) is None for name in FORCES):
            return stated
        return float(f"{np.trace(stress_tensor(self.network)) / 3:.3g}")

    @cached_property
    def unsettled(self) -> str:
        """Why its state does not count as settled; empty where it does.

        Three stresses that differ, as of a triaxial compression, are no fault.
        """
        equal = not self.crystal and not {"stress_ratio", "oedometric"} & set(self.network.study)
        return why_unsettled(self.network, self.stated_stress if equal else np.nan)

    @cached_property
    def label(self) -> str:
        """Short name for legends: what it is, and under which stress."""
        kind, mark = "FCC" if self.crystal else "random", f", {MARK}" if self.unsettled else ""
        under = f", {self.stress / 1e3:g} kPa" if np.isfinite(self.stress) else ""
        return f"{kind}{under} ({self.case.short}{mark})"

    # Waves: `yade` and `linear`, or the one that is to be measured, `wave`; `shear_...` likewise.

    @cached_property
    def records(self) -> list[Signals]:
        """Recorded waves, each checked: S-waves by YADE first."""
        return [self._checked(kind) for kind in SHEAR if self.case.has(kind)]

    def _checked(self, kind: str) -> Signals:
        record, path = self.case.read(kind), self.case.path(kind)
        if (np.array(record.chain_displacement.shape) < FEWEST).any():
            raise InputError(f"{path}: fewer than 50 times or 10 particles; record more")
        books = record.balance
        if books is not None and not books.kept:
            self.case.notes.append(
                f"{path}: the energy drifts by {books.drift:.1e}, limit "
                f"{books.limit:.1e}, and {books.gap:.1e} of the source wall's work is not "
                "accounted for; do not trust this run"
            )
        if record.chain_particle.max() >= self.network.n_particles:
            raise InputError(f"{path}: its chain leaves the network; run it again")
        if self.crystal:
            layers = layer_distance(record) / self.lattice.distance
            if abs(layers - 1) > UNEVEN:
                raise InputError(
                    f"{path}: its chain has a particle in every {layers:.3g} layers of "
                    "the crystal, of which neither band nor wavelength can be read; record one in "
                    "each"
                )
        return record

    @cached_property
    def recorded(self) -> Signals | None:
        """The first record of a P-wave."""
        return next((record for record in self.records if record.direction == "z"), None)

    @cached_property
    def yade(self) -> Signals | None:
        """The P-wave of a DEM run; None where the springs themselves have made it."""
        if self.recorded is None or self.recorded.producer != "linear":
            return self.recorded
        self.case.notes.append(
            f"{self.case.path('signals')}: a linear wave, shown as it is; what is measured "
            "beside it is of the network's own, with the same motion of the source"
        )
        return None

    @cached_property
    def affine_passage(self) -> float:
        """Time from wall to wall, s, of a wave that strains the packing evenly: none is faster."""
        return self.network.length / of_contacts(self.network).velocity

    @cached_property
    def affine_frequency(self) -> float:
        """V / D, Hz: V of that wave, D the mean diameter."""
        return of_contacts(self.network).velocity / self.diameter

    @property
    def pulse(self) -> Pulse:
        """The pulse of a packing that no run has one for."""
        return Pulse(AMPLITUDE * self.diameter, FREQUENCY * self.affine_frequency)

    def own_wave(
        self,
        motion: Motion | None = None,
        direction: str = "z",
        *,
        interval: float | None = None,
        particles: bool = True,
    ) -> Signals:
        """The linear wave of the packing's own pulse, or another motion, along `direction`.

        P-waves are recorded on every particle, S-waves for longer, as they are slower. `interval`
        between records, s, by default `INTERVAL`.
        """
        duration = RECORD * self.network.length / self.diameter / self.affine_frequency
        return propagate(
            self.network,
            duration if direction == "z" else duration / SLOWER,
            motion=self.pulse if motion is None else motion,
            interval=interval or INTERVAL / self.affine_frequency,
            particles=particles and direction == "z",
            direction=direction,
        ).signals

    @cached_property
    def linear(self) -> Signals:
        """The P-wave of the springs, on every particle, from wall to wall and back."""
        return self.linear_wave(particles=True)

    def linear_wave(self, *, particles: bool) -> Signals:
        """That wave, of the source's `motion`; on every particle it takes twice the time."""
        self.require_walls()
        return self.own_wave(self.motion, interval=self.interval, particles=particles)

    @cached_property
    def motion(self) -> Motion:
        """How the source wall moves: as recorded, else as given, else by the packing's pulse."""
        if self.recorded is not None:
            return recorded_motion(self.recorded)
        return self.source or self.pulse

    @property
    def interval(self) -> float:
        """Between records of the linear wave, s, by `INTERVAL`.

        Or a little less: a whole number of the run's intervals, so that the two share their times.
        """
        wanted = INTERVAL / self.affine_frequency
        if self.recorded is None:
            return wanted
        own = float(self.recorded.time[1] - self.recorded.time[0])
        return own * max(1, int(wanted / own))

    @cached_property
    def wave(self) -> Signals:
        """The P-wave to be measured: as a record has it, or that of the springs."""
        self.require_walls()
        return self._of_pulse(self.linear if self.recorded is None else self.recorded)

    @cached_property
    def shear_wave(self) -> Signals:
        """The same of a wall that slides, along x where it is not recorded."""
        self.require_walls()
        slid = next((record for record in self.records if record.direction != "z"), None)
        return self._of_pulse(self.own_wave(self.source, "x") if slid is None else slid)

    def _of_pulse(self, record: Signals) -> Signals:
        """A record as it would be of a pulse, which rules on amplitudes are made for."""
        motion = recorded_motion(record)
        if isinstance(motion, Pulse) and motion.cycles == 1:
            return record
        return as_of_pulse(record, self.pulse)

    @cached_property
    def shear(self) -> dict[str, Signals]:
        """Recorded S-waves: the first of each producer, by its name."""
        found: dict[str, Signals] = {}
        for record in self.records:
            if record.direction != "z":
                found.setdefault(record.producer, record)
        return found

    def record(self, key: str) -> Signals | None:
        """A wave: wave, yade, linear, beside, shear_wave, shear_yade or shear_linear."""
        if key.startswith("shear_") and key != "shear_wave":
            return self.shear.get(key.removeprefix("shear_"))
        return getattr(self, key)

    def linear_at(self, pre_stress: str) -> Signals:
        """The linear wave of the network at the times of the recorded wave.

        Where there is no record, ten times a period of the pulse for one passage. Like everything
        called linear here it is that of the springs alone; `pre_stress`
        (`modal.system.contacts`) adds what the contacts' forces do.
        """
        if self.recorded is None:
            interval, duration = 0.1 / self.motion.frequency, self.affine_passage
        else:
            time = self.recorded.time
            interval, duration = float(time[1] - time[0]), float(time[-1])
        given = {"motion": self.motion, "interval": interval, "pre_stress": pre_stress}
        return propagate(self.network, duration, **given).signals

    @cached_property
    def beside(self) -> Signals:
        """That of the springs alone."""
        return self.linear_at("none")

    @property
    def shown(self) -> Signals:
        """The P-wave that was recorded, or the linear wave where none was."""
        return self.linear if self.recorded is None else self.recorded

    def record_of(self, frequency: float) -> Signals:
        """The run of a pulse of this frequency, Hz, where there is one; else what is shown."""
        kind = f"{frequency / 1e3:g}kHz.signals"
        return self.case.read(kind) or self.shown

    @once
    def cut(self, key: str) -> Signals:
        """A P-wave up to when the affine one has come a third of the way back.

        The linear wave as far as a run's record goes; a run as it is.
        """
        record, run = self.record(key), self.yade
        assert record is not None
        if key == "yade":
            return record
        as_run = key == "linear" and run is not None
        return cut(record, float(run.time[-1]) if as_run else PASSAGES * self.affine_passage)

    # What several quantities share.

    @cached_property
    def line(self) -> float:
        """`LINE` of the highest frequency, Hz, to three digits: an iteration bounds it."""
        top = LinearSystem.of(self.network).top
        return float(f"{LINE * np.sqrt(top) / (2 * np.pi):.3g}")

    @cached_property
    def moduli(self) -> ElasticModuli:
        """Elastic moduli by the springs' static response."""
        return self.case.read("moduli") or elastic_moduli(self.network)

    # What to know of a quantity.

    @cached_property
    def of_one_sample(self) -> tuple[str, ...]:
        """What to know of every quantity of this one packing."""
        if self.crystal:
            return ()
        caveats = ["one sample: how samples differ is not in the error; measure further seeds"]
        if self.unsettled:
            caveats.append(f"not in equilibrium: {self.unsettled}")
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
