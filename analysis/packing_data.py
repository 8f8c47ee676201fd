"""Hold a packing with its waves; results that several quantities use are computed once.

All settings scale with the packing: the frequency of the pulse with V / D, the width of lines in
spectra with the highest frequency. If spheres are ten times smaller, the pulse is ten times
shorter, and all dimensionless results are the same.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

from analysis.case import WAVES, AbsentError, Case
from analysis.caveats import Caveat
from analysis.estimators.coherent import PASSAGES
from analysis.estimators.source_motion import as_of_pulse, cut, recorded_motion
from analysis.record_rules import (
    check_layers,
    check_record,
    record_interval,
    record_length,
)
from analysis.static_packing import StaticPacking
from modal.exchange.registry import read_remarked
from modal.packing.sample import Sample
from modal.system.contacts import PreStress
from modal.waves.defaults import PULSE_AMPLITUDE_IN_D, PULSE_FREQUENCY_IN_V_PER_D
from modal.waves.motions import Motion, Pulse
from modal.waves.propagate import propagate
from modal.waves.signals import Direction, Signals

P = ParamSpec("P")
R = TypeVar("R")


def cached_on_packing(
    function: Callable[Concatenate[PackingData, P], R],
) -> Callable[Concatenate[PackingData, P], R]:
    """Compute a result once for each packing and set of arguments, and keep it on the packing.

    The decorated function has the signature of the function. The key of a result is the function
    with its arguments by name, defaults included: passing them by position or by name makes no
    difference. Arguments must be hashable.
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
class PackingData(StaticPacking):
    """One packing with its recorded waves; missing waves are computed from the contacts.

    Attributes
    ----------
    network, case
        As in `StaticPacking`.
    given : sequence of Signals, or None
        Recorded waves, of any source; None for those among the files of `case`.
    source : Motion, optional
        Motion of the wall that sends computed waves; by default `pulse`.
    keep : str or Path, optional
        Folder in which costly spectra are kept, and from which they are read again.
    sample : Sample, optional
        The spheres with their friction, for waves of finite amplitude.
    amplitudes : sequence of float, m
        Amplitudes of these waves.
    stated : dict
        Lower and upper published value of a quantity that a study states, by name; figures show
        them.
    not_kept : dict of str to Caveat
        Why a spectrum could not be written into `keep`, by its kind.
    linear_record : Signals, optional
        The linear wave, if it is computed already.
    every_particle : bool
        Whether the linear wave has the motion of every particle, which takes twice the time.
    """

    given: Sequence[Signals] | None = ()
    source: Motion | None = None
    keep: str | Path | None = None
    sample: Sample | None = None
    amplitudes: Sequence[float] = ()
    stated: dict[str, tuple[float, float]] = field(default_factory=dict)
    not_kept: dict[str, Caveat] = field(default_factory=dict)
    linear_record: Signals | None = None
    every_particle: bool = True
    _results: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Refuse damaged records when the packing is created."""
        for record in self.given or ():
            if record.from_wall_to_wall:
                self._check(record, "a record")

    @classmethod
    def of(cls, case: Case, every_particle: bool = True) -> PackingData:
        """Return the packing of a case, with the recorded waves among the case's files."""
        network = read_remarked(case.packing_path, case.notes.append)
        return cls(network, None, case=case, every_particle=every_particle)

    @cached_property
    def records(self) -> list[Signals]:
        """Return the recorded waves, each of them checked; S-waves by YADE come first.

        Remarks on the files are added to the notes of the case.
        """
        if self.given is not None:
            return [record for record in self.given if record.from_wall_to_wall]
        records = []
        for kind in filter(self.case.has, WAVES):
            record = self.case.read(kind)
            self._check(record, self.case.path(kind))
            records.append(record)
            if kind == "signals" and record.producer == "linear":
                self.case.notes.append(
                    f"{self.case.path(kind)}: a linear wave, shown as it is; what is measured "
                    "beside it is of the network's own, with the same motion of the source"
                )
        return records

    @cached_property
    def of_other_source(self) -> Signals | None:
        """Return the first recorded wave that does not go from wall to wall; None without one."""
        if self.given is None:
            record: Signals | None = self.case.read("other.signals")
            return record
        return next((record for record in self.given if not record.from_wall_to_wall), None)

    def _check(self, record: Signals, path: Path | str) -> None:
        """Refuse a record that cannot be read; note where its energy does not balance."""
        check_record(record, path, self.network)
        balance = record.balance
        if balance is not None and not balance.closes:
            self.case.notes.append(
                f"{path}: the energy drifts by {balance.drift:.1e}, limit "
                f"{balance.limit:.1e}, and {balance.gap:.1e} of the source wall's work is not "
                "accounted for; do not trust this run"
            )
        if self.crystal:
            check_layers(record, path, self.lattice)

    @cached_property
    def recorded(self) -> Signals | None:
        """Return the first record of a P-wave; None without one."""
        return next((record for record in self.records if record.direction == "z"), None)

    @cached_property
    def _first_recorded_shear(self) -> Signals | None:
        """Return the first record of an S-wave; None without one."""
        return next((record for record in self.records if record.direction != "z"), None)

    @cached_property
    def shear(self) -> dict[str, Signals]:
        """Return the first recorded S-wave of each program, by the program's name."""
        records: dict[str, Signals] = {}
        for record in self.records:
            if record.direction != "z":
                records.setdefault(record.producer, record)
        return records

    @cached_property
    def yade(self) -> Signals | None:
        """Return the recorded P-wave if a DEM run made it; None otherwise."""
        if self.recorded is not None and self.recorded.producer == "linear":
            return None
        return self.recorded

    @property
    def pulse(self) -> Pulse:
        """Return the default motion of the source wall, which scales with the packing."""
        amplitude = PULSE_AMPLITUDE_IN_D * self.diameter
        return Pulse(amplitude, PULSE_FREQUENCY_IN_V_PER_D * self.affine_frequency)

    @cached_property
    def motion(self) -> Motion:
        """Return the source wall's motion: that of a record, else `source`, else `pulse`."""
        if self.recorded is not None:
            return recorded_motion(self.recorded)
        return self.source or self.pulse

    @cached_property
    def linear(self) -> Signals:
        """Return the linear P-wave of the contacts, from wall to wall and back."""
        if self.linear_record is not None:
            return self.linear_record
        return self.linear_wave(particles=self.every_particle)

    def linear_wave(
        self, direction: Direction = "z", *, particles: bool = True, pre_stress: PreStress = "none"
    ) -> Signals:
        """Compute the linear wave of the contacts.

        If there is a record, a computed P-wave has its source motion and its times, or every
        second, third ... of these. An S-wave is recorded for longer, because it is slower.

        Parameters
        ----------
        direction : str
            Direction in which the wall moves: "z" for P-waves, "x" or "y" for S-waves.
        particles : bool
            Whether to record the motion of every particle, which takes twice the time; S-waves
            never have it.
        pre_stress : str
            Which effects of the contact forces are included (`modal.system.contacts`).
        """
        self.require_walls()
        shear = direction != "z"
        if shear:
            motion = self.source or self.pulse
            interval = record_interval(self.affine_frequency, None)
        else:
            motion = self.motion
            interval = record_interval(self.affine_frequency, self.recorded)
        return propagate(
            self.network,
            record_length(self.affine_passage, direction),
            motion=motion,
            interval=interval,
            particles=particles and not shear,
            direction=direction,
            pre_stress=pre_stress,
        ).signals

    @cached_property
    def wave(self) -> Signals:
        """Return the P-wave to be measured: the recorded one, else the linear one."""
        return self._answer_to_pulse(self.shown)

    @cached_property
    def shear_wave(self) -> Signals:
        """Return the S-wave to be measured: the recorded one, else the linear one along x."""
        if self._first_recorded_shear is not None:
            return self._answer_to_pulse(self._first_recorded_shear)
        return self._answer_to_pulse(self.linear_wave("x"))

    def _answer_to_pulse(self, record: Signals) -> Signals:
        """Return the record that a pulse of the source would give, for rules that use amplitudes.

        Its length is at most that of a computed wave, because the truncation error grows towards
        the end.
        """
        self.require_walls()
        motion = recorded_motion(record)
        if isinstance(motion, Pulse) and motion.cycles == 1:
            return record
        longest = record_length(self.affine_passage, record.direction)
        return cut(as_of_pulse(record, self.pulse), longest)

    @property
    def shown(self) -> Signals:
        """Return the P-wave that figures show: the recorded one, else the linear one."""
        if self.recorded is None:
            return self.linear
        return self.recorded

    def record(self, key: str) -> Signals:
        """Return a wave by name; `AbsentError` if there is none.

        `key` is wave, yade, linear, shear_wave, shear_yade or shear_linear.
        """
        if key.startswith("shear_") and key != "shear_wave":
            record = self.shear.get(key.removeprefix("shear_"))
        else:
            record = getattr(self, key)
        if record is None:
            raise AbsentError
        return record

    @cached_on_packing
    def cut(self, key: str) -> Signals:
        """Return a P-wave, cut when the reflected affine wave has come a third of the way back.

        The record of a run is returned in full; the linear wave of the same packing is cut where
        the run ends.
        """
        record = self.record(key)
        run = self.yade
        if key == "yade":
            return record
        if key == "linear" and run is not None:
            return cut(record, float(run.time[-1]))
        return cut(record, PASSAGES * self.affine_passage)
