"""Measure a packing in one call: quantities by name, each with its error and caveats."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, Unpack

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
from modal.formats.tables import html_table, load_optional
from modal.packing.network import Network
from modal.packing.sample import Sample, read_sample
from modal.tools.arguments import checked
from modal.tools.display import table
from modal.tools.errors import InputError, refuse_unknown
from modal.waves.motions import Motion
from modal.waves.signals import Signals, read_signals

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


class Measurement(dict[str, Value]):
    """Quantities of a packing by name.

    Attributes
    ----------
    state : mapping
        Properties that all samples of the same state have in common (`analysis.same_state`).
    """

    def __init__(self, values: Mapping[str, Value], state: State | None = None) -> None:
        super().__init__(values)
        self.state = state or {}

    @property
    def known(self) -> bool:
        """Tell whether any quantity has a number."""
        return any(value.known for value in self.values())

    def as_json(self) -> dict[str, dict[str, Any]]:
        """Return `Value.as_json` of each quantity by its name."""
        return {name: value.as_json() for name, value in self.items()}

    def to_pandas(self) -> "pd.DataFrame":
        """Return value, error, unit and caveats of each quantity as a pandas DataFrame.

        Values at several frequencies are an array in one cell.
        """
        pandas = load_optional("pandas", "tables")
        rows = []
        for value in self.values():
            row = {"value": value.value, "error": value.error, "unit": value.unit}
            rows.append(row | {"caveats": "; ".join(map(str, value.caveats))})
        frame: pd.DataFrame = pandas.DataFrame(rows, index=[*self])
        return frame

    def to_xarray(self) -> "xr.Dataset":
        """Return the values as an xarray Dataset, with error, unit and caveats in `attrs`.

        Values at several frequencies have their own dimension.
        """
        xarray = load_optional("xarray", "labelled arrays")
        variables = {}
        coordinates = {}
        for name, value in self.items():
            attributes = {
                "units": value.unit,
                "error": value.error,
                "caveats": "; ".join(map(str, value.caveats)),
            }
            dimensions: tuple[str, ...] = ()
            if value.at is not None:
                dimensions = (f"frequency of {name}",)
                coordinates[dimensions[0]] = (dimensions, value.at, {"units": "Hz"})
            variables[name] = (dimensions, value.value, attributes)
        dataset: xr.Dataset = xarray.Dataset(variables, coordinates)
        return dataset

    def _repr_html_(self) -> str:
        """Return the quantities as a table, for a notebook."""
        rows = []
        for name, value in self.items():
            rows.append([name, value.text(), "; ".join(map(str, value.caveats))])
        return html_table(["quantity", "value", "caveats"], rows)

    def __str__(self) -> str:
        lines = []
        if self:
            lines.append(table([(name, value.text()) for name, value in self.items()]))
        names_by_caveat: dict[Caveat, list[str]] = {}
        for name, value in self.items():
            for caveat in value.caveats:
                names_by_caveat.setdefault(caveat, []).append(name)
        for caveat, names in names_by_caveat.items():
            lines.append(f"- {', '.join(names)}: {caveat}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<Measurement of {', '.join(self)}>"


class MeasureOptions(TypedDict, total=False):
    """Keyword arguments of `measure`."""

    quantities: str | Sequence[str] | None
    source: Motion | None
    keep: str | Path | None
    amplitudes: Sequence[float]


@checked
def measure(
    packing: Network | Sample | Case | str | Path,
    *records: Signals | str | Path,
    quantities: str | Sequence[str] | None = None,
    source: Motion | None = None,
    keep: str | Path | None = None,
    amplitudes: Sequence[float] = (),
) -> Measurement:
    """Measure a packing: its state, and velocity, attenuation and frequency limits of its waves.

    Parameters
    ----------
    packing : Network, Sample, Case, str or Path
        A network, a sample, or a file with one of them; a case may have further files.
    *records : Signals, str or Path
        Waves that were recorded in the packing; without any, the linear wave is computed.
    quantities : str or sequence of str, optional
        Names of `analysis.quantities.QUANTITIES`, by default all except those that are measured
        only on request; `QUICK` are those that take one wave or less.
    source : Motion, optional
        Motion of the wall that sends the computed wave, m; by default a pulse of 0.33 V / D.
    keep : str or Path, optional
        A folder in which costly spectra are stored, and from which a later call reads them.
    amplitudes : sequence of float, optional
        Amplitudes of pulses through a sample, m, over which the quantities of `AMPLITUDE` are
        measured. Without `quantities` only these are measured.

    Returns
    -------
    Measurement
        A `Value` by name: `value` and `error` in SI units, `unit`, and `caveats`, the limits of the
        number. If a quantity cannot be measured, its value is NaN and a caveat says why.

    Raises
    ------
    InputError
        If a name or a file is not known, or a record was made in another packing.

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
    sample = None
    if isinstance(packing, Case):
        case = packing
        for record in records:
            if not isinstance(record, Signals):
                owner_of(Path(record), [case])
        network = read_remarked(case.packing_path, case.notes.append)
        if is_sample(case.packing_path):
            sample = read_sample(case.packing_path)
    elif isinstance(packing, Sample):
        sample = packing
        network = sample.network()
    else:
        network = packing
    if len(amplitudes) and sample is None:
        raise InputError(
            "no_sample", "waves of finite amplitude are those of a sample, with its friction"
        )
    if not all(0 < amplitude < np.inf for amplitude in amplitudes):
        raise InputError(
            "amplitudes", f"amplitudes {list(amplitudes)}", remedy="give positive ones, in m"
        )
    waves = [_read_record(record) for record in records]
    data = PackingData(
        network,
        waves,
        source,
        case=case,
        keep=keep,
        sample=sample,
        amplitudes=amplitudes,
    )
    values = {}
    for name in _requested_names(quantities, amplitudes):
        values[name] = QUANTITIES[name].measured(data)
    return Measurement(values, state_of(network))


def _read_record(record: Signals | str | Path) -> Signals:
    """Return a wave, read from its file if a path is given."""
    if isinstance(record, Signals):
        return record
    return read_signals(record, of_any_source=True)


def _requested_names(
    quantities: str | Sequence[str] | None, amplitudes: Sequence[float]
) -> list[str]:
    """Return the names of the quantities to measure; raise InputError for an unknown one."""
    if isinstance(quantities, str):
        quantities = [quantities]
    if quantities:
        names = list(quantities)
    elif len(amplitudes):
        names = list(AMPLITUDE)
    else:
        names = [each.name for each in QUANTITIES.values() if not each.on_request]
    for name in names:
        refuse_unknown("quantity", name, QUANTITIES)
    return names


class MeasuredFiles(NamedTuple):
    """The measurements of several files, and their mean.

    found: measurement of each file that could be measured, by path. mean: mean over them; None for
    a single packing. differences: properties that show that the packings are not samples of the
    same state; if there are any, all numbers of the mean are unknown. refused: why a file could not
    be measured, by its path.
    """

    found: dict[str, Measurement]
    mean: Measurement | None
    differences: list[Difference]
    refused: dict[str, InputError]

    def as_json(self) -> dict[str, Any]:
        """Return the measurements by file, and `mean`; for one file only its quantities."""
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


def measure_files(
    paths: Sequence[str], say: Callable[[str], object], **options: Unpack[MeasureOptions]
) -> MeasuredFiles:
    """Measure each packing among the files, and their mean if there are several.

    Files with recorded waves replace the linear waves of their packing. Files with the density of
    states, the structure factor or the moduli are used if they are in the packing's folder and have
    the packing's name. If a file cannot be measured, the others are still measured.

    Parameters
    ----------
    paths : sequence of str
        Packings and recorded waves.
    say : callable
        Function that is called with each note for the user.
    **options
        Keyword arguments of `measure`.

    Raises
    ------
    InputError
        If no file can be measured.
    """
    kinds, refused = _kinds_of(paths)
    waves = [path for path, kind in kinds.items() if kind in (*WAVES, "other.signals")]
    cases = cases_of_files([path for path in kinds if path not in waves])
    owner = {path: owner_of(Path(path), cases) for path in waves}
    measured = dict[str, Measurement]()
    for case in cases:
        records = [path for path in waves if owner[path] is case]
        path = next((text for text in paths if Path(text) == case.packing_path), "")
        try:
            measured[path] = measure(case, *records, **options)
        except InputError as error:
            if len(cases) == 1:
                raise
            refused[path] = error
        for note in case.notes:
            say(note)
    if not measured:
        raise next(iter(refused.values()))
    if len(measured) == 1:
        return MeasuredFiles(measured, None, [], refused)
    measurements = list(measured.values())
    apart = differences([measurement.state for measurement in measurements])
    if apart:
        return MeasuredFiles(measured, no_mean(measurements, apart), apart, refused)
    return MeasuredFiles(measured, mean_of(measurements), [], refused)


def _kinds_of(paths: Sequence[str]) -> tuple[dict[str, str], dict[str, InputError]]:
    """Return the kind of each file of a known kind, and why each other file has none.

    Raise the InputError of the first file if no file has a known kind.
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
    """Return the mean of each quantity over samples of the same state.

    A quantity that is known for one packing only keeps its value and its error.
    """
    values = dict(measurements[0])
    for name, first in measurements[0].items():
        known = [measurement[name] for measurement in measurements if measurement[name].known]
        if not known:
            continue
        caveats = list(chain.from_iterable(value.caveats for value in known))
        if len(known) > 1:
            caveats = [caveat for caveat in caveats if caveat.code != "one_sample"]
        caveats.append(Caveat("mean", {"known": len(known), "packings": len(measurements)}))
        if np.ndim(first.value):
            caveats.append(Caveat("common_frequencies"))
        values[name] = mean_of_values(known).with_caveats(*caveats)
    return Measurement(values)


def no_mean(measurements: Sequence[Measurement], apart: Sequence[Difference]) -> Measurement:
    """Return values that are not known, because the packings are samples of different states.

    The caveats name the properties in `apart`, in which the packings differ.
    """
    caveat = Caveat("unlike", {"properties": "; ".join(map(str, apart))})
    values = {name: unknown(value.unit, caveat) for name, value in measurements[0].items()}
    return Measurement(values)
