"""What a packing is like, in one call: quantities by name, each with error and caveats."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from analysis.case import WAVES, Case, cases_of_files, kind_of, owner_of
from analysis.caveats import Caveat
from analysis.mean import mean_of_values
from analysis.packing_data import PackingData
from analysis.quantities import QUANTITIES
from analysis.quantities.amplitude import AMPLITUDE
from analysis.same_state import Difference, State, differences, state_of
from analysis.value import Value, unknown
from modal.exchange.programs.own import is_sample
from modal.exchange.registry import read_remarked
from modal.packing.network import Network
from modal.packing.sample import Sample, read_sample
from modal.tools.arguments import checked
from modal.tools.display import table
from modal.tools.errors import InputError, refuse_unknown
from modal.waves.signals import Signals, read_signals
from modal.waves.source import Motion


class Measurement(dict[str, Value]):
    """Quantities of a packing by name; `state` is what samples of one state have in common."""

    def __init__(self, values: Mapping[str, Value], state: State | None = None) -> None:
        super().__init__(values)
        self.state = state or {}

    @property
    def known(self) -> bool:
        """Whether anything was measured."""
        return any(value.known for value in self.values())

    def as_json(self) -> dict[str, dict[str, Any]]:
        """{quantity: {value, error, unit, caveats}}; what is not known is None."""
        return {name: value.as_json() for name, value in self.items()}

    def __str__(self) -> str:
        """A line a quantity, then what to know, with the quantities that it is about."""
        lines = [table([(name, value.text()) for name, value in self.items()])] if self else []
        about: dict[Caveat, list[str]] = {}
        for name, value in self.items():
            for caveat in value.caveats:
                about.setdefault(caveat, []).append(name)
        lines += [f"- {', '.join(names)}: {caveat}" for caveat, names in about.items()]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<Measurement of {', '.join(self)}>"


@checked
def measure(
    packing: Network | Sample | Case | str | Path,
    *records: Signals | str | Path,
    quantities: str | Sequence[str] | None = None,
    source: Motion | None = None,
    keep: str | Path | None = None,
    amplitudes: Sequence[float] = (),
) -> Measurement:
    """Measure a packing: what it is, how fast, how far and up to which frequency waves go.

    Parameters
    ----------
    packing : Network, Sample, Case, str or Path
        A network, a sample, or a file of either; a case has further files.
    *records : Signals, str or Path
        Waves that were recorded in it; without any the linear wave of its contacts is computed.
    quantities : str or sequence of str, optional
        Names of `analysis.quantities.QUANTITIES`, by default all but those that are measured on
        request; `QUICK` has those that take one wave or less.
    source : Motion, optional
        Of the wall that sends the computed wave, m; by default a pulse of 0.33 V / D.
    keep : str or Path, optional
        A folder for costly spectra, which a later call finds there.
    amplitudes : sequence of float, optional
        Of pulses through a sample, m: the quantities of `AMPLITUDE` are measured over these, by
        default they alone.

    Returns
    -------
    Measurement
        Each name with its `Value`: `value` and `error` in SI units, `unit`, and `caveats`,
        sentences on what the number leaves open. What cannot be measured is NaN, and a caveat says
        why.

    Raises
    ------
    InputError
        Where a name or a file is not known, or a record is of another packing.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(2, 2, 40))
    >>> found = measure(crystal, quantities=["v_p", "low_pass_unbiased"])
    >>> print(f"{found['v_p'].value:.0f} {found['v_p'].unit}")
    776 m/s
    """
    if isinstance(packing, str | Path):
        (packing,) = cases_of_files([packing])
    case = Case("packing", Path(), {})
    sample = packing if isinstance(packing, Sample) else None
    if isinstance(packing, Case):
        case, path = packing, packing.packing_path
        for record in records:
            if not isinstance(record, Signals):
                owner_of(Path(record), [case])
        network = read_remarked(path, case.notes.append)
        sample = read_sample(path) if is_sample(path) else None
    else:
        network = packing.network() if isinstance(packing, Sample) else packing
    if len(amplitudes) and sample is None:
        raise InputError("waves of finite amplitude are those of a sample, with its friction")
    if not all(0 < size < np.inf for size in amplitudes):
        raise InputError(f"amplitudes {list(amplitudes)}: give positive ones, in m")
    waves = [r if isinstance(r, Signals) else read_signals(r) for r in records]
    m = PackingData(network, waves, source, case, keep, sample, amplitudes)
    usual = [q.name for q in QUANTITIES.values() if not q.on_request]
    asked = [quantities] if isinstance(quantities, str) else quantities
    names = list(asked or (AMPLITUDE if len(amplitudes) else usual))
    for name in names:
        refuse_unknown("quantity", name, QUANTITIES)
    return Measurement({name: QUANTITIES[name].measured(m) for name in names}, state_of(network))


class MeasuredFiles(NamedTuple):
    """What several files give: a measurement each, their mean, and what stood in the way of both.

    `mean` is None of a single packing. Where packings are no samples of one state `differences`
    say in which properties, and no number of the mean is known. `refused` are the files that could
    not be measured, with the reason.
    """

    found: dict[str, Measurement]
    mean: Measurement | None
    differences: list[Difference]
    refused: dict[str, InputError]

    def as_json(self) -> dict[str, Any]:
        """By file, and `mean`; of one file its quantities alone."""
        by_file: dict[str, Any] = {path: each.as_json() for path, each in self.found.items()}
        if self.mean is None and not self.refused:
            (only,) = by_file.values()
            return only
        if self.mean is not None:
            by_file["mean"] = self.mean.as_json()
        if self.differences:
            by_file["differences"] = [each.as_json() for each in self.differences]
        if self.refused:
            by_file["refused"] = {
                path: {"code": error.code, "reason": str(error)}
                for path, error in self.refused.items()
            }
        return by_file


def measure_files(paths: Sequence[str], say: Callable[[str], object], **how: Any) -> MeasuredFiles:
    """Measure each packing among the files, and their mean where there are several.

    Waves that were recorded in a packing take the place of its own where their files are given;
    `how` has what `measure` takes by name. Densities, structure factors and moduli are used, too,
    where they lie beside under its name. `say` is told what a reader should know of the packings.
    A file that cannot be measured does not keep the others from it; InputError where none can.
    """
    kinds, refused = _kinds_of(paths)
    waves = [path for path, kind in kinds.items() if kind in WAVES]
    cases = cases_of_files([path for path in kinds if path not in waves])
    owner = {path: owner_of(Path(path), cases) for path in waves}
    found = dict[str, Measurement]()
    for case in cases:
        records = [path for path in waves if owner[path] is case]
        path = next((text for text in paths if Path(text) == case.packing_path), "")
        try:
            found[path] = measure(case, *records, **how)
        except InputError as error:
            if len(cases) == 1:
                raise
            refused[path] = error
        for note in case.notes:
            say(note)
    if not found:
        raise next(iter(refused.values()))
    if len(found) == 1:
        return MeasuredFiles(found, None, [], refused)
    each = list(found.values())
    apart = differences([one.state for one in each])
    mean = no_mean(each, apart) if apart else mean_of(each)
    return MeasuredFiles(found, mean, apart, refused)


def _kinds_of(paths: Sequence[str]) -> tuple[dict[str, str], dict[str, InputError]]:
    """Kinds of the files that are of a known one, and why the others are not.

    InputError of the first where there is no other.
    """
    kinds = dict[str, str]()
    refused = dict[str, InputError]()
    for path in paths:
        try:
            kinds[path] = kind_of(path)
        except InputError as error:
            refused[path] = error
    if not kinds:
        raise next(iter(refused.values()))
    return kinds, refused


def mean_of(measurements: Sequence[Measurement]) -> Measurement:
    """Return the mean of each quantity over samples of one state.

    What one packing alone has keeps its error.
    """
    values = dict(measurements[0])
    for name, first in measurements[0].items():
        each = [m[name] for m in measurements if m[name].known]
        if not each:
            continue
        caveats = [caveat for value in each for caveat in value.caveats]
        if len(each) > 1:
            caveats = [caveat for caveat in caveats if caveat.code != "one_sample"]
        caveats.append(Caveat("mean", {"known": len(each), "packings": len(measurements)}))
        if np.ndim(first.value):
            caveats.append(Caveat("common_frequencies"))
        values[name] = mean_of_values(each).with_caveats(*caveats)
    return Measurement(values)


def no_mean(measurements: Sequence[Measurement], apart: Sequence[Difference]) -> Measurement:
    """Return no number for any quantity, but in which properties the packings differ."""
    caveat = Caveat("unlike", {"properties": "; ".join(map(str, apart))})
    return Measurement({name: unknown(v.unit, caveat) for name, v in measurements[0].items()})
