"""What quantities are measured from: a packing and its waves, each made when asked for.

All settings follow from the packing, without units of their own: the pulse from V / D, lines of
spectra from the highest frequency. Spheres ten times smaller hear the same of a pulse ten times
shorter.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from analysis.case import WAVES, AbsentError, Case
from analysis.caveats import Caveat
from analysis.estimators.coherent import PASSAGES
from analysis.estimators.damped_transform import UNEVEN, layer_distance
from analysis.estimators.effective_medium import velocity_of_contacts
from analysis.estimators.layer_lattice import LayerLattice, is_fcc
from analysis.estimators.source_motion import as_of_pulse, cut, recorded_motion
from analysis.same_state import note
from modal.elasticity.moduli import ElasticModuli, elastic_moduli
from modal.exchange.registry import read_remarked
from modal.packing import state
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.plausibility import (
    BALANCED,
    CRYSTALLINE,
    WIDE,
    differing_thirds,
)
from modal.packing.sample import Sample
from modal.packing.summary import crystalline_shares
from modal.preparation.protocol import SETTLED
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError, UnavailableError
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
FEWEST = 50, 10
"""Times and particles of a record that is read."""
LINE = 0.005
"""Width of a line of the structure factor and of the density of states, in parts of the highest
frequency: 1 kHz in the study's packings under 100 kPa."""
MARK = "not settled"
P = ParamSpec("P")
R = TypeVar("R")


def cached_on_packing(
    function: Callable[Concatenate[PackingData, P], R],
) -> Callable[Concatenate[PackingData, P], R]:
    """Compute a result once for each packing and set of arguments, and keep it on the packing.

    The decorated function has the signature of the function. The key of a result is the function
    with its arguments by name, defaults included: it does not matter how they are passed. Arguments
    must be hashable.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def cached(packing: PackingData, /, *args: P.args, **kwargs: P.kwargs) -> R:
        bound = signature.bind(packing, *args, **kwargs)
        bound.apply_defaults()
        _, *arguments = bound.arguments.items()
        key = (function, tuple(arguments))
        if key not in packing._results:
            packing._results[key] = function(packing, *args, **kwargs)
        result: R = packing._results[key]
        return result

    return cached


@dataclass(eq=False)
class PackingData:
    """One packing with what was recorded of it; what is missing is made from its contacts.

    `given` are waves; None means those among the files of `case`, which has further files of the
    packing. `keep` is a folder in which costly spectra are kept, and found again. `sample` and
    `amplitudes`, m, are for waves of finite amplitude. `stated` are lower and upper ends of what a
    study states of it, by quantity: figures show it. `not_kept` says why a spectrum could not be
    kept. `linear_record` is the linear wave, where it is computed already; else it is computed,
    with the motion of every particle unless `every_particle` is False.
    """

    network: Network
    given: Sequence[Signals] | None = ()
    source: Motion | None = None
    case: Case = field(default_factory=lambda: Case("packing", Path(), {}))
    keep: str | Path | None = None
    sample: Sample | None = None
    amplitudes: Sequence[float] = ()
    stated: dict[str, tuple[float, float]] = field(default_factory=dict)
    not_kept: list[Caveat] = field(default_factory=list)
    linear_record: Signals | None = None
    every_particle: bool = True
    _results: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Refuse damaged waves at once."""
        for record in self.given or ():
            self._checked(record, "a record")

    @classmethod
    def of(cls, case: Case, every_particle: bool = True) -> PackingData:
        """A case with the records among its files."""
        network = read_remarked(case.packing_path, case.notes.append)
        return cls(network, None, case=case, every_particle=every_particle)

    @cached_property
    def crystal(self) -> bool:
        """Whether it is an FCC crystal between walls, of which theory knows the waves."""
        return self.walls and is_fcc(self.network)

    @cached_property
    def lattice(self) -> LayerLattice:
        """The lattice of layers that the theory of a crystal reduces to."""
        self.require_crystal()
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
            raise UnavailableError(
                "the cell has no two walls along z, from one to the other of which a wave here "
                "goes; `modal wave --plane Z` sends one through a cell without walls",
                code="no_walls",
            )

    def require_crystal(self) -> None:
        """`AbsentError` for other packings."""
        if not self.crystal:
            raise AbsentError(
                f"{self.case.name}: no FCC crystal between two walls, so it has no theory to "
                "compare with; take another packing"
            )

    @property
    def mu_comp(self) -> float:
        """Friction of the compression; the wave's is 0.1 more (section 2). NaN if unknown."""
        friction = note(self.network, "mu_comp")
        if np.isnan(friction):
            friction = note(self.network, "mu_wave") - 0.1
        return round(friction, 6)

    @property
    def stress(self) -> float:
        """Stress, Pa, that it was made for, as its network says.

        Else the mean that the contacts bear, to three digits; NaN without contact forces.
        """
        stated = note(self.network, "stress")
        if np.isfinite(stated) or not state.has_forces(self.network):
            return stated
        return float(f"{np.trace(state.stress_tensor(self.network)) / 3:.3g}")

    @cached_property
    def unsettled(self) -> str:
        """Why its state does not count as settled; empty where it does.

        Three stresses that differ, as of a triaxial compression, are no fault.
        """
        study = self.network.study
        equal = not self.crystal and not {"stress_ratio", "oedometric"} & set(study)
        return why_unsettled(self.network, note(self.network, "stress") if equal else np.nan)

    @cached_property
    def label(self) -> str:
        """Short name for legends: what it is, and under which stress."""
        kind, mark = "FCC" if self.crystal else "random", f", {MARK}" if self.unsettled else ""
        under = f", {self.stress / 1e3:g} kPa" if np.isfinite(self.stress) else ""
        return f"{kind}{under} ({self.case.short}{mark})"

    @cached_property
    def affine_velocity(self) -> float:
        """Velocity, m/s, of a P-wave that strains the packing evenly: none is faster."""
        return velocity_of_contacts(self.network)

    @property
    def affine_passage(self) -> float:
        """Time from wall to wall, s, of that wave."""
        return self.network.length / self.affine_velocity

    @property
    def affine_frequency(self) -> float:
        """V / D, Hz: V of that wave, D the mean diameter."""
        return self.affine_velocity / self.diameter

    @cached_property
    def line(self) -> float:
        """`LINE` of the highest frequency, Hz, to three digits: an iteration bounds it."""
        top = LinearSystem.of(self.network).spectral_bound
        if not top > 0:
            raise UnavailableError("the network has no stiffness", code="no_stiffness")
        return float(f"{LINE * np.sqrt(top) / (2 * np.pi):.3g}")

    @cached_property
    def moduli(self) -> ElasticModuli:
        """Elastic moduli by the springs' static response."""
        return self.case.read("moduli") or elastic_moduli(self.network)

    @cached_property
    def crystalline(self) -> dict[str, float]:
        """Share of spheres in crystalline surroundings, of all and of the bulk; empty if untold."""
        return crystalline_shares(self.network)

    @cached_property
    def of_one_sample(self) -> tuple[Caveat, ...]:
        """What to know of every quantity of this one packing."""
        if self.crystal:
            return ()
        caveats = [Caveat("one_sample")]
        if self.unsettled:
            caveats.append(Caveat("unsettled", {"excess": self.unsettled}))
        own = self.crystalline
        share = own.get("crystalline_share_of_bulk", own.get("crystalline_share", 0.0))
        if share > CRYSTALLINE:
            caveats.append(Caveat("crystalline", {"share": share}))
        for unusual, text in differing_thirds(self.network):
            if unusual:
                caveats.append(Caveat("uneven", {"text": text}))
        return tuple(caveats)

    @cached_property
    def of_waves(self) -> tuple[Caveat, ...]:
        """The same of what is read from waves, which a narrow packing guides."""
        if self.crystal or self.width >= WIDE:
            return self.of_one_sample
        return (*self.of_one_sample, Caveat("narrow", {"width": self.width}))

    @cached_property
    def records(self) -> list[Signals]:
        """Recorded waves, each checked: S-waves by YADE first."""
        if self.given is not None:
            return list(self.given)
        kinds = filter(self.case.has, WAVES)
        return [self._checked(self.case.read(kind), self.case.path(kind)) for kind in kinds]

    def _checked(self, record: Signals, path: Path | str) -> Signals:
        if (np.array(record.chain_displacement.shape) < FEWEST).any():
            raise InputError(f"{path}: fewer than 50 times or 10 particles; record more")
        if not np.isfinite(record.chain_displacement).all():
            raise InputError(f"{path}: displacements that are no numbers; record it again")
        books = record.balance
        if books is not None and not books.closes:
            self.case.notes.append(
                f"{path}: the energy drifts by {books.drift:.1e}, limit "
                f"{books.limit:.1e}, and {books.gap:.1e} of the source wall's work is not "
                "accounted for; do not trust this run"
            )
        if record.chain_particle.max() >= self.network.n_particles:
            raise InputError(f"{path}: its chain leaves the packing; give the packing it is of")
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
    def shear(self) -> dict[str, Signals]:
        """Recorded S-waves: the first of each producer, by its name."""
        slid = [record for record in self.records if record.direction != "z"]
        return {record.producer: record for record in reversed(slid)}

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

    @property
    def pulse(self) -> Pulse:
        """The pulse of a packing that no run has one for."""
        return Pulse(AMPLITUDE * self.diameter, FREQUENCY * self.affine_frequency)

    @cached_property
    def motion(self) -> Motion:
        """How the source wall moves: as recorded, else as given, else by the packing's pulse."""
        if self.recorded is not None:
            return recorded_motion(self.recorded)
        return self.source or self.pulse

    @cached_property
    def linear(self) -> Signals:
        """The P-wave of the springs, from wall to wall and back."""
        if self.linear_record is not None:
            return self.linear_record
        return self.linear_wave(particles=self.every_particle)

    def linear_wave(
        self, direction: str = "z", *, particles: bool = True, pre_stress: str = "none"
    ) -> Signals:
        """The wave of the springs; P-waves on every `particles`, which takes twice the time.

        Of the source's `motion` and, beside a run, recorded a little more often: the two share the
        times of whole intervals. S-waves are recorded for longer, as they are slower, of the motion
        that was given. `pre_stress` (`modal.system.contacts`) adds what the contacts' forces do.
        """
        self.require_walls()
        interval, slid = INTERVAL / self.affine_frequency, direction != "z"
        if self.recorded is not None and not slid:
            own = float(self.recorded.time[1] - self.recorded.time[0])
            interval = own * max(1, int(interval / own))
        return propagate(
            self.network,
            RECORD * self.affine_passage / (SLOWER if slid else 1.0),
            motion=(self.source or self.pulse) if slid else self.motion,
            interval=interval,
            particles=particles and not slid,
            direction=direction,
            pre_stress=pre_stress,
        ).signals

    @cached_property
    def wave(self) -> Signals:
        """The P-wave to be measured: as a record has it, or that of the springs."""
        return self._of_pulse(self.shown)

    @cached_property
    def shear_wave(self) -> Signals:
        """The same of a wall that slides, along x where it is not recorded."""
        slid = next((record for record in self.records if record.direction != "z"), None)
        return self._of_pulse(self.linear_wave("x") if slid is None else slid)

    def _of_pulse(self, record: Signals) -> Signals:
        """A record as it would be of a pulse, which rules on amplitudes are made for.

        As long as the own wave: what was not yet seen when a record ends grows towards its end.
        """
        self.require_walls()
        motion = recorded_motion(record)
        if isinstance(motion, Pulse) and motion.cycles == 1:
            return record
        longest = RECORD * self.affine_passage / (1.0 if record.direction == "z" else SLOWER)
        return cut(as_of_pulse(record, self.pulse), longest)

    @property
    def shown(self) -> Signals:
        """The P-wave that was recorded, or the linear wave where none was."""
        return self.linear if self.recorded is None else self.recorded

    def record(self, key: str) -> Signals:
        """A wave: wave, yade, linear, shear_wave, shear_yade or shear_linear."""
        slid = key.startswith("shear_") and key != "shear_wave"
        found = self.shear.get(key.removeprefix("shear_")) if slid else getattr(self, key)
        if found is None:
            raise AbsentError
        return found

    @cached_on_packing
    def cut(self, key: str) -> Signals:
        """A P-wave up to when the affine one has come a third of the way back.

        The linear wave as far as a run's record goes; a run as it is.
        """
        record, run = self.record(key), self.yade
        if key == "yade":
            return record
        as_run = key == "linear" and run is not None
        return cut(record, float(run.time[-1]) if as_run else PASSAGES * self.affine_passage)


def why_unsettled(network: Network, stress: float = np.nan) -> str:
    """What of a packing's state is beyond `SETTLED`; empty if nothing is, or without forces.

    Stresses may be off by what a preparation allows, net forces by twice that: of a state that was
    reached these are just below its limit, and a little more where forces are made from positions.
    A state that ran out of patience before is marked wherever one of its numbers is shown.

    `stress` is the target of its three stresses, Pa; NaN where it has none or only an axial one, as
    a crystal has. Where anything is beyond, it also says how far the pressures of walls are off.
    """
    if network.n_contacts == 0 or not state.has_forces(network):
        return ""
    if not stress > 0:
        stress = np.nan
    most_off, _ = SETTLED
    residual = state.residual_forces(network).mean()
    off = float(abs(np.diag(state.stress_tensor(network)) / stress - 1).max())
    found = []
    if residual > BALANCED:
        found.append(f"residual {residual:.1e} over {BALANCED:g}")
    if off > most_off:
        found.append(f"stress {100 * off:.2f} % off, over {100 * most_off:g} %")
    if found and np.isfinite(stress) and not network.cell_periodic[2]:
        walls = 100 * (state.wall_stress(network) / stress - 1)
        found.append("walls " + ", ".join(f"{value:+.1f} %" for value in walls))
    return "; ".join(found)
