"""The comparison of a crystal: each quantity by theory, eigenmodes, linear wave and YADE.

Theory, modes and the linear wave are those of the springs, without the pre-stress of the contacts;
what that changes of V_P has a row of its own. The linear wave is cut where the run ends. What a
rule reads of a record, theory has where the rule reads the exact lattice's signals.
"""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.estimators import damped_transform as disp
from analysis.estimators import low_pass
from analysis.estimators.layer_lattice import exact_twin
from analysis.estimators.travel_time import arrival_times, travelled
from analysis.packing_data import PackingData
from analysis.quantities.spectrum import modal_dispersion
from analysis.quantities.velocity import chain
from analysis.rows import CaseResult, row_of
from analysis.table import cell

COLUMNS = ("theory", "modal", "linear", "yade")
TABLE = Path(__file__).with_name("comparison.csv")
"""A row a line: id, quantity, unit, the names of its numbers by theory, modes and a record's wave,
and a note."""
BY_RULE = "v_p_first_peaks_yade", "f_low_pass_2_yade", "f_low_pass_1_yade"
"""Quantities that rules read of a record."""
Numbers = dict[str, float]


def compare(m: PackingData) -> list[list[str]]:
    """Rows for one crystal: id, quantity, unit, what `COLUMNS` has, as far as it is known; note."""
    known = {name: cell.value for name, cell in row_of(m).columns.items()}
    own = {"theory": _theory(m), "modal": _modes(m), "linear": _of_wave(m, "linear")}
    own |= {"yade": _of_wave(m, "yade")} if m.yade else {}
    values = {name: known | numbers for name, numbers in own.items()}
    stretch = "at {:g}-{:g} % of the length".format(*(100 * p for p in low_pass.CRYSTAL_STRETCH))
    lines = []
    for line in csv.DictReader(TABLE.read_text().splitlines()):
        names = [line.get(name, line["wave"]).format(record=name) for name in COLUMNS]
        places = zip(COLUMNS, names, strict=True)
        cells = [cell(values.get(column, {}).get(name), ".6g") for column, name in places]
        text = line["quantity"].format(stretch=stretch)
        lines += [[line["id"], text, line["unit"], *cells, line["note"]]] if any(cells) else []
    return lines


def _theory(m: PackingData) -> Numbers:
    """Of the lattice, and by the rules on its exact signals at the times of the record."""
    lattice, (omega, _) = m.lattice, m.lattice.eigenmodes()
    twin, wall = exact_twin(m.yade or m.cut("linear"), lattice), float(m.network.wall_position[0])
    signals = replace(twin, chain_position=wall + twin.chain_position)
    exact = PackingData(m.network, [signals], linear_record=m.linear)
    read = CaseResult.of(exact)
    read.add(exact, BY_RULE)
    # Eq. 7
    edge = 2 * lattice.velocity / (np.pi * lattice.low_pass_frequency) / m.diameter
    return {name: cell.value for name, cell in read.columns.items()} | {
        "f_first": omega[0] / 2e3 / np.pi,
        "f_last": omega[-1] / 2e3 / np.pi,
        "layers": lattice.layers,
        "lambda_edge": edge,
        "arrival": _arrival(exact, "yade"),
    }


def _modes(m: PackingData) -> Numbers:
    modes = m.case.read("modes")
    if modes is None or modes.resonance_frequency is None:
        return {}
    kappa = np.arccos(disp.mode_cosine(modes.resonance_shape)[-1]) / m.lattice.distance
    return {
        "lambda_edge": 2 * np.pi / float(kappa) / m.diameter,
        "f_last": modes.resonance_frequency[-1] / 1e3,
        "off_theory": _off_theory(m, modal_dispersion(m)),
    }


def _of_wave(m: PackingData, key: str) -> Numbers:
    found = {"arrival": _arrival(m, key), "off_theory": _off_theory(m, chain(m, key))}
    if key == "linear":
        full = m.linear_wave(particles=False, pre_stress="full")
        found["with_pre_stress"] = disp.chain_dispersion(full).velocity
    return found


def _off_theory(m: PackingData, measured: disp.Dispersion) -> float:
    """Deviation of a dispersion relation from Eq. 9, %."""
    return 100 * disp.rms_deviation(measured, m.lattice.velocity, m.lattice.low_pass_frequency)


def _arrival(m: PackingData, key: str) -> float:
    return travelled(m.cut(key), m.network.wall_position, arrival_times)[0]
