"""What a packing is like, in one call: quantities by name, each with error and caveats."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.belonging import WAVES, cases_of_files, kind_of, owner_of
from analysis.measuring import Measuring
from analysis.quantities import QUANTITIES
from analysis.value import Value
from modal.packing.network import Network
from modal.packing.sample import Sample
from modal.tools.display import table
from modal.tools.errors import InputError
from modal.waves.signals import Signals, read_signals
from modal.waves.source import Motion

SAME_STATE = ("mu_comp", "mu_wave", "stress")
"""What the study of samples of one state has in common."""


class Measurement(Mapping[str, Value]):
    """Quantities of a packing by name."""

    def __init__(self, values: dict[str, Value]) -> None:
        self._values = values

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

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


def measure(
    packing: Network | Sample | str | Path,
    *records: Signals | str | Path,
    quantities: Sequence[str] | None = None,
    source: Motion | None = None,
) -> Measurement:
    """Measure a packing: what it is, how fast, how far and up to which frequency waves go.

    `packing` is a network, a sample or a file of either. `records` are waves that were recorded in
    it (`Signals` or files); without any the linear wave of its contacts is computed, from a wall
    that moves by `source`, by default a pulse of 0.33 V / D. `quantities` are names of
    `analysis.quantities.QUANTITIES`, by default all; `QUICK` has those that take one wave or less.

    The result maps each name to a `Value`: `value` and `error` in SI units, `unit`, and `caveats`,
    sentences on what the number leaves open. What cannot be measured is NaN, and a caveat says why.
    InputError where a name or a file is not known, or a record is of another packing.

    >>> import modal
    >>> crystal = modal.fcc(cells=(2, 2, 40))
    >>> found = measure(crystal, quantities=["v_p", "low_pass_unbiased"])
    >>> print(f"{found['v_p'].value:.0f} {found['v_p'].unit}")
    776 m/s
    """
    names = list(QUANTITIES) if quantities is None else list(quantities)
    for name in names:
        if name not in QUANTITIES:
            raise InputError(f"quantity {name!r}: unknown; choose from {', '.join(QUANTITIES)}")
    measuring = _measuring(packing, records, source)
    return Measurement({name: QUANTITIES[name].measured(measuring) for name in names})


def _measuring(
    packing: Network | Sample | str | Path,
    records: Sequence[Signals | str | Path],
    source: Motion | None,
) -> Measuring:
    case = None
    if isinstance(packing, str | Path):
        (case,) = cases_of_files([packing])
        for record in records:
            if not isinstance(record, Signals):
                owner_of(Path(record), [case])
        network = case.network
    else:
        network = packing.network() if isinstance(packing, Sample) else packing
    waves = [r if isinstance(r, Signals) else read_signals(r) for r in records]
    for wave in waves:
        if wave.chain_particle.max() >= network.n_particles:
            raise InputError("a record's chain leaves the packing; give the packing it is of")
    return Measuring(network, waves, source, case)


def measure_files(
    paths: Sequence[str], quantities: Sequence[str] | None = None
) -> tuple[dict[str, Measurement], Measurement | None]:
    """A measurement for each packing among the files, and their mean where there are several.

    Waves that were recorded in a packing take the place of its own where their files are given.
    Densities, structure factors and moduli are used, too, where they lie beside under its name.
    """
    waves = [path for path in paths if kind_of(path) in WAVES]
    cases = cases_of_files([path for path in paths if path not in waves])
    owner = {path: owner_of(Path(path), cases) for path in waves}
    found, states = {}, []
    for case in cases:
        records = [read_signals(path) for path in waves if owner[path] is case]
        measuring = Measuring(case.network, records, None, case)
        names = list(QUANTITIES) if quantities is None else quantities
        values = {name: QUANTITIES[name].measured(measuring) for name in names}
        found[_as_given(case.packing_path, paths)] = Measurement(values)
        states.append(tuple(str(case.network.study.get(key)) for key in SAME_STATE))
    if len(found) < 2:
        return found, None
    return found, _mean(list(found.values()), same=len(set(states)) == 1)


def _as_given(path: Path, paths: Sequence[str]) -> str:
    return next((text for text in paths if Path(text) == path), str(path))


def _mean(measurements: list[Measurement], *, same: bool) -> Measurement:
    """Mean of each quantity over packings, and its standard error from their scatter.

    Of arrays at the frequencies of the first. `same` says that they are samples of one state.
    """
    values = {}
    for name, first in measurements[0].items():
        each = [m[name] for m in measurements if m[name].known]
        if first.at is not None:
            each = [value for value in each if value.at is not None]
        if not each:
            values[name] = first
            continue
        at = each[0].at
        rows = np.array([v.value if at is None else _at(v, at) for v in each], float)
        scatter = rows.std(axis=0, ddof=1) if len(rows) > 1 else np.nan * rows[0]
        parts = {"samples": scatter / np.sqrt(len(rows))}
        caveats = [c for v in each for c in v.caveats if not c.startswith("one sample")]
        caveats.append(f"mean of {len(each)} of {len(measurements)} packings")
        if not same:
            caveats.append("the packings differ in friction or stress: not samples of one state")
        mean = Value(rows.mean(axis=0) if at is not None else float(rows.mean()), first.unit, parts)
        values[name] = Value(mean.value, first.unit, parts, (), at).with_caveats(*caveats)
    return Measurement(values)


def _at(value: Value, at: Any) -> np.ndarray:
    """An array quantity at other frequencies (nf,), Hz; NaN outside of its own."""
    return np.interp(at, np.asarray(value.at), np.asarray(value.value), np.nan, np.nan)
