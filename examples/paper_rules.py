"""
Estimators written a second time
================================

V_P by first peaks and the low-pass frequency by the 2 % rule, by functions that were written from
the paper's words alone (`_paper_rules.py`), beside the project's numbers in
`results/study/table1.csv`. Both read linear waves: of the crystal at 100 kPa, and of the committed
samples without friction and with friction 0.4. What the paper leaves open is decided twice: by
these functions themselves, and as the project does (`docs/results.md`), which leaves the code alone
to differ.

`python examples/paper_rules.py FOLDER` writes the table into a folder.
"""

import sys

import numpy as np
import pandas as pd
from _committed import RESULTS, write
from _paper_rules import first_peaks_velocity, low_pass_frequency, stable_region

import modal
from modal.motions import Pulse

CRYSTAL = 2
RANDOM = (5, 6, 7, 8, 29, 30, 31, 32)
PASSAGES = 1.2
"""Length of the records in passages of the wave: first peaks need a little more than one."""
PROJECT_PASSAGES = 0.95
"""Length of the record of the project's low-pass frequency, in passages."""
PROJECT_REGIONS = {True: (0.05, 0.15), False: (0.5, 0.6)}
"""Part of the length that it counts, of a crystal and of a random packing."""
table1 = pd.read_csv(RESULTS / "study/table1.csv").set_index("case")
OURS = {
    "v_p": "v_p_first_peaks_linear_m_per_s",
    "low_pass": "f_low_pass_2_linear_khz",
}


def read_packing(case):
    """Return the network of the crystal, or of a committed sample."""
    if case == CRYSTAL:
        return modal.fcc()
    return modal.read(RESULTS / f"samples/case{case:02}.sample.h5")


def measure_case(case):
    """Return a row: both numbers of a case by the paper's words, the project's, differences."""
    packing = read_packing(case)
    duration = PASSAGES * packing.length / table1.loc[case, "v_p_static_m_per_s"]
    pulse = Pulse(amplitude=2.5e-9, frequency=1e5)
    signals = modal.propagate(packing, duration, motion=pulse).signals
    position = signals.chain_position - packing.wall_position[0]
    record = signals.time, position, signals.chain_displacement, packing.length
    velocity = first_peaks_velocity(*record)
    crystal = case == CRYSTAL
    region = stable_region(packing.length, crystal=crystal)
    low_pass, spread = low_pass_frequency(*record, region)
    region = np.multiply(PROJECT_REGIONS[crystal], packing.length)
    same_choices, _ = low_pass_frequency(*record, region, passages=PROJECT_PASSAGES)
    row = {"case": case, "v_p": velocity, "low_pass": low_pass / 1e3}
    row |= {"low_pass_spread": spread / 1e3, "low_pass_same_choices": same_choices / 1e3}
    for name, column in OURS.items():
        row[f"{name}_ours"] = table1.loc[case, column]
        row[f"{name}_ours_error"] = table1.loc[case, f"{column}_error"]
        row[f"{name}_difference"] = row[name] / row[f"{name}_ours"] - 1
    row["same_choices_difference"] = row["low_pass_same_choices"] / row["low_pass_ours"] - 1
    return row


if __name__ == "__main__" and len(sys.argv) == 2:
    rows = pd.DataFrame([measure_case(case) for case in (CRYSTAL, *RANDOM)])
    print(rows.to_string(index=False, float_format="%.4g"))
    write(sys.argv[1], {}, {"paper_rules": rows}, float_format="%.5g")
