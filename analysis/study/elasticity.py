"""S-waves and moduli in the study: numbers of cases whose products are there, and their table."""

from __future__ import annotations

import numpy as np

from analysis.case_tables import number
from analysis.measures import Measures
from analysis.measures.estimate import Estimate
from analysis.measures.shear_wave import velocities_of
from analysis.rows import Row
from analysis.table import Table

COLUMNS = {
    "K, MPa": "bulk_modulus_mpa",
    "G, MPa": "shear_modulus_mpa",
    "Poisson's ratio": "poisson",
    "V_P moduli, m/s": "v_p_moduli_m_per_s",
    "V_P long waves, linear wave, m/s": "v_p_long_waves_linear_m_per_s",
    "V_P long waves, YADE, m/s": "v_p_long_waves_yade_m_per_s",
    "V_S moduli, m/s": "v_s_moduli_m_per_s",
    "V_S long waves, linear wave, m/s": "v_s_long_waves_linear_m_per_s",
    "V_S long waves, YADE, m/s": "v_s_long_waves_yade_m_per_s",
    "V_S first peaks, YADE, m/s": "v_s_first_peaks_yade_m_per_s",
    "S-wave's f_low-pass 2 %, linear wave, kHz": "f_low_pass_2_shear_linear_khz",
    "S-wave's f_low-pass 2 %, YADE, kHz": "f_low_pass_2_shear_yade_khz",
}
"""Heading, and the value of a row."""


def add_elasticity(row: Row, m: Measures) -> None:
    """Moduli and S-waves of a case, as far as their files are there, to its row."""
    moduli = m.case.moduli
    if moduli is not None:
        v_p, v_s = velocities_of(moduli)
        for name, value in (
            ("bulk_modulus_mpa", moduli.bulk_modulus / 1e6),
            ("shear_modulus_mpa", moduli.shear_modulus / 1e6),
            ("poisson", moduli.poisson),
            ("v_p_moduli_m_per_s", v_p),
            ("v_s_moduli_m_per_s", v_s),
        ):
            row.values[name] = Estimate(value)
    for wave in m.shear:
        producer, edge = wave.record.producer, wave.low_pass
        row.values[f"v_s_long_waves_{producer}_m_per_s"] = wave.long_wave
        row.values[f"v_s_first_peaks_{producer}_m_per_s"] = wave.first_peak
        row.values[f"f_low_pass_2_shear_{producer}_khz"] = Estimate(
            edge.value / 1e3, edge.error / 1e3
        )


def table_of_elasticity(rows: list[Row]) -> Table:
    """One row a case that has moduli or an S-wave; columns that no case has are left out."""
    own = ("v_s_moduli_m_per_s", "v_s_long_waves_linear_m_per_s", "v_s_long_waves_yade_m_per_s")
    found = [row for row in rows if any(name in row.values for name in own)]
    shown = {
        head: name
        for head, name in COLUMNS.items()
        if any(np.isfinite(row.value(name)) for row in found)
    }
    header = ["case", "mu_comp", "stress, kPa", "Z of force-bearing", *shown]
    lines = [
        [
            str(row.number or row.name),
            f"{row.mu_comp:g}",
            f"{row.stress / 1e3:g}",
            number(row.value("coordination_number_bearing")),
            *(number(row.values.get(name, np.nan)) for name in shown.values()),
        ]
        for row in found
    ]
    return Table("S-waves and elastic moduli", header, lines)
