"""Compare a crystal's quantities by theory, eigenmodes, linear wave and YADE.

Theory, modes and the linear wave use the springs, without the pre-stress of the contacts; the
effect of pre-stress on V_P has its own row. The linear wave is cut at the end of the run. If a rule
reads a quantity from a record, the same rule is applied to the exact lattice's signals for the
column of theory.
"""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.case_measurement import add_quantities, empty_result, measure_result
from analysis.case_result import CaseResult
from analysis.estimators import damped_transform, low_pass
from analysis.estimators.layer_lattice import exact_twin
from analysis.estimators.travel_time import arrival_times, travelled
from analysis.packing_data import PackingData
from analysis.quantities.passband import Producer
from analysis.quantities.spectrum import modal_dispersion
from analysis.quantities.velocity import chain
from analysis.table import cell
from modal.packing.network import Network
from modal.theory.fcc import frequency_of_equal_turns

COLUMNS = ("theory", "modal", "linear", "yade")
TABLE = Path(__file__).with_name("comparison.csv")
"""Table of compared quantities. Each line has an id, a quantity, its unit, the names of its numbers
by theory, by modes and by the wave of a record, a note, and how the row is `shown` on a terminal,
if it is, with the cause of a difference (`because`)."""
DEVIATION_ROW = "rms"
"""Id of the row whose numbers are deviations from theory."""
RULE_QUANTITIES = "v_p_first_peaks_yade", "f_low_pass_2_yade", "f_low_pass_1_yade"
"""Quantities that a rule reads from a record: first peaks and thresholds of the amplitude."""
Numbers = dict[str, float]
"""Numbers of a crystal, by the names that `TABLE` gives them and in the units of `TABLE`."""


def compare(packing: PackingData) -> list[list[str]]:
    """Return the rows of a crystal's table: ID, quantity, unit, the cells of `COLUMNS`, note.

    Rows without any number are left out.
    """
    measured = _numbers_of(measure_result(packing))
    values = {
        "theory": measured | _by_theory(packing),
        "modal": measured | _by_modes(packing),
        "linear": measured | _by_wave(packing, "linear"),
    }
    if packing.yade:
        values["yade"] = measured | _by_wave(packing, "yade")
    low, high = (100 * place for place in low_pass.CRYSTAL_STRETCH)
    stretch = f"at {low:g}-{high:g} % of the length"
    rows = []
    for line in table_lines():
        cells = []
        for column in COLUMNS:
            name = line.get(column, line["wave"]).format(record=column)
            cells.append(cell(values.get(column, {}).get(name), ".6g"))
        if any(cells):
            text = line["quantity"].format(stretch=stretch)
            rows.append([line["id"], text, line["unit"], *cells, line["note"]])
    return rows


def table_lines() -> list[dict[str, str]]:
    """Return the lines of `TABLE`, each by the names of its columns."""
    return list(csv.DictReader(TABLE.read_text().splitlines()))


def _numbers_of(row: CaseResult) -> Numbers:
    """Return the numbers of a result by their columns."""
    return {name: each.value for name, each in row.columns.items()}


def _by_theory(packing: PackingData) -> Numbers:
    """Return the numbers of the lattice, and those that rules read from its exact signals."""
    lattice = packing.lattice
    omega, _ = lattice.eigenmodes()
    exact_record = exact_twin(packing.yade or packing.cut("linear"), lattice)
    wall = float(packing.network.wall_position[0])
    signals = replace(exact_record, chain_position=wall + exact_record.chain_position)
    exact = PackingData(packing.network, [signals], linear_record=packing.linear)
    by_rules = empty_result(exact)
    add_quantities(by_rules, exact, RULE_QUANTITIES)
    # Eq. 7
    edge = 2 * lattice.velocity / (np.pi * lattice.low_pass_frequency) / packing.diameter
    return _numbers_of(by_rules) | {
        "f_first": omega[0] / 2e3 / np.pi,
        "f_last": omega[-1] / 2e3 / np.pi,
        "f_top": _highest_frequency(packing.network) / 1e3,
        "layers": lattice.layers,
        "lambda_edge": edge,
        "arrival": _arrival_velocity(exact, "yade"),
    }


def _highest_frequency(network: Network) -> float:
    """Return the highest natural frequency of the endless crystal, Hz, from its springs."""
    pair = ~network.with_wall
    tangential = float(np.median(network.stiffness_tangential[pair]))
    lever = float(np.median(np.linalg.norm(network.branch[pair], axis=1))) / 2
    return frequency_of_equal_turns(tangential, lever, float(network.inertia.mean()))


def _by_modes(packing: PackingData) -> Numbers:
    """Return the numbers of a file with modes; none without resonances."""
    modes = packing.case.read("modes")
    if modes is None or modes.resonance_frequency is None:
        return {}
    cosine = damped_transform.mode_cosine(modes.resonance_shape)[-1]
    kappa = np.arccos(cosine) / packing.lattice.distance
    return {
        "lambda_edge": 2 * np.pi / float(kappa) / packing.diameter,
        "f_last": modes.resonance_frequency[-1] / 1e3,
        "off_theory": _deviation_from_theory(packing, modal_dispersion(packing)),
    }


def _by_wave(packing: PackingData, key: Producer) -> Numbers:
    """Return the numbers of `TABLE` that follow from a recorded wave."""
    numbers = {
        "arrival": _arrival_velocity(packing, key),
        "off_theory": _deviation_from_theory(packing, chain(packing, key)),
    }
    if key == "linear":
        with_pre_stress = packing.linear_wave(particles=False, pre_stress="full")
        dispersion = damped_transform.chain_dispersion(with_pre_stress)
        numbers["with_pre_stress"] = dispersion.velocity
    return numbers


def _deviation_from_theory(packing: PackingData, measured: damped_transform.Dispersion) -> float:
    """Return the deviation of a dispersion relation from Eq. 9, %."""
    lattice = packing.lattice
    return 100 * damped_transform.rms_deviation(
        measured, lattice.velocity, lattice.low_pass_frequency
    )


def _arrival_velocity(packing: PackingData, key: str) -> float:
    """Return the velocity, m/s, of first arrivals along the chain."""
    return travelled(packing.cut(key), packing.network.wall_position, arrival_times)[0]
