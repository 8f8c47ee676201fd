"""What a packing is like, in one call: quantities by name, each with error and caveats."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.case import WAVES, Case, cases_of_files, kind_of, owner_of
from analysis.measuring import Measuring
from analysis.quantities import QUANTITIES
from analysis.quantities.amplitude import AMPLITUDE
from analysis.value import Value
from modal.exchange.programs.own import is_sample
from modal.exchange.registry import read_remarked
from modal.packing.network import Network
from modal.packing.sample import Sample, read_sample
from modal.tools.arguments import checked
from modal.tools.arrays import Array, Floats
from modal.tools.display import table
from modal.tools.errors import InputError, refuse_unknown
from modal.waves.signals import Signals, read_signals
from modal.waves.source import Motion

SAME_STATE = ("mu_comp", "mu_wave", "stress")
"""What the study of samples of one state has in common."""


class Measurement(dict[str, Value]):
    """Quantities of a packing by name; `state` is what samples of one state have in common."""

    def __init__(self, values: Mapping[str, Value], state: tuple[str, ...] = ()) -> None:
        super().__init__(values)
        self.state = state

    def as_json(self) -> dict[str, dict[str, Any]]:
        """{quantity: {value, error, unit, caveats}}; what is not known is None."""
        return {name: value.as_json() for name, value in self.items()}

    def __str__(self) -> str:
        """A line a quantity, then what to know, with the quantities that it is about."""
        lines = [table([(name, value.text()) for name, value in self.items()])] if self else []
        about: dict[str, list[str]] = {}
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
    case, sample = None, packing if isinstance(packing, Sample) else None
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
    m = Measuring(network, waves, source, case, keep, sample, amplitudes)
    usual = [q.name for q in QUANTITIES.values() if not q.asked]
    asked = [quantities] if isinstance(quantities, str) else quantities
    names = list(asked or (AMPLITUDE if len(amplitudes) else usual))
    for name in names:
        refuse_unknown("quantity", name, QUANTITIES)
    state = tuple(str(network.study.get(key)) for key in SAME_STATE)
    return Measurement({name: QUANTITIES[name].measured(m) for name in names}, state)


def measure_files(
    paths: Sequence[str], say: Callable[[str], object], **how: Any
) -> tuple[dict[str, Measurement], Measurement | None]:
    """A measurement for each packing among the files, and their mean where there are several.

    Waves that were recorded in a packing take the place of its own where their files are given;
    `how` has what `measure` takes by name. Densities, structure factors and moduli are used, too,
    where they lie beside under its name. `say` is told what a reader should know of the packings.
    """
    waves = [path for path in paths if kind_of(path) in WAVES]
    cases = cases_of_files([path for path in paths if path not in waves])
    owner = {path: owner_of(Path(path), cases) for path in waves}
    found = {}
    for case in cases:
        records = [path for path in waves if owner[path] is case]
        path = next((text for text in paths if Path(text) == case.packing_path), "")
        found[path] = measure(case, *records, **how)
        for note in case.notes:
            say(note)
    mean = mean_of(list(found.values()), same=one_state(found)) if len(found) > 1 else None
    return found, mean


def one_state(found: Mapping[str, Measurement]) -> bool:
    """Whether packings have the same friction and stress, so that their mean says something."""
    return len({each.state for each in found.values()}) == 1


def mean_of(measurements: Sequence[Measurement], *, same: bool) -> Measurement:
    """Mean of each quantity over packings, its standard error and their scatter.

    Of arrays at the frequencies of the first, NaN outside of their own. What one packing alone has
    keeps its error. `same` says that they are samples of one state.
    """
    values = dict(measurements[0])
    unlike = "the packings differ in friction or stress: not samples of one state"
    for name, first in measurements[0].items():
        each = [m[name] for m in measurements if m[name].known]
        if not each:
            continue
        at, shape = each[0].at, np.shape(each[0].value)
        # A list without frequencies has the first, second ... of each packing.
        places = [np.arange(np.size(v.value)) if v.at is None else v.at for v in each]
        rows = _at_first(places, [v.value for v in each]).reshape(len(each), *shape)
        scatter = rows.std(axis=0, ddof=1) if len(rows) > 1 else np.nan * rows[0]
        one = len(each) == 1
        caveats = [c for v in each for c in v.caveats if one or not c.startswith("one sample")]
        caveats += [f"mean of {len(each)} of {len(measurements)} packings", *[unlike] * (not same)]
        caveats += ["known where all of the packings have it"] * bool(shape)
        # Samples may agree by chance: the mean is not surer than what each of them is known to.
        own = _at_first(places, [v.error**2 - v.parts.get("length", 0.0) ** 2 for v in each])
        told = {"fit": np.sqrt(own.sum(axis=0)).reshape(shape) / len(rows)}
        told["samples"] = scatter / np.sqrt(len(rows))
        # That they are short is common to all: no mean makes it less.
        if common := [v.parts["length"] for v in each if "length" in v.parts]:
            told["length"] = max(common)
        mean = Value(rows.mean(axis=0), first.unit, told, (), at, scatter)
        values[name] = mean.with_caveats(*caveats)
    return Measurement(values)


def _at_first(places: Sequence[Array], numbers: Sequence[Any]) -> Floats:
    """Shape (k, n): those of k packings at the places (n,) of the first, NaN outside of theirs."""
    own = zip(places, map(np.atleast_1d, numbers), strict=True)
    return np.array([np.interp(places[0], x, y, np.nan, np.nan) for x, y in own])
