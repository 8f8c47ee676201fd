"""Tables over all cases, on rows of known answer: statements, f_max, D(f) / f^2, trends."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.estimators.excess import UNKNOWN, Excess
from analysis.measures.estimate import Estimate
from analysis.rows import Row
from analysis.study.low_pass_targets import slopes, wavelengths
from analysis.study.statements import statements
from analysis.study.tables import table_1, table_of_density, table_of_highest
from analysis.study.target_rules import coordination, highest_apart
from analysis.study.velocity_rules import table_of_laws


def a_row(number: int, mu: float, stress: float, **values: float | Estimate) -> Row:
    name = f"case{number:02d}"
    row = Row(number, name, name, number < 5, stress, mu, "linear", "")
    row.values = {
        key: value if isinstance(value, Estimate) else Estimate(value)
        for key, value in values.items()
    }
    return row


def of_rule(rule: str, number: int, mu: float, stress: float, f: float, wave: float, **more) -> Row:
    """A case whose rule gives f at 2 %, 1.1 and 0.97 times as much at 1 and 3 %."""
    names = {"2": f, "1": 1.1 * f, "3": 0.97 * f}
    values = {f"f_low_pass_{p}_{rule}linear_khz": value for p, value in names.items()}
    values |= {f"lambda_{p}_{rule}linear_over_d": wave for p in ("1", "2")}
    return a_row(number, mu, stress, **values, **more)


def a_study(power: float, wave: float = 10.0, rule: str = "") -> list[Row]:
    """Frictions 0 to 0.2 over four stresses; f_low-pass is V_P to a power that grows by 0.05."""
    rows = []
    for k, mu in enumerate((0.0, 0.1, 0.2)):
        for s in range(4):
            v = 500 * 10 ** (0.2 * (s - 1))
            f = 21.9 * (v / 500) ** (power + 0.05 * k)
            more = {"v_p_first_peaks_linear_m_per_s": v, "void_ratio": 0.55 + 0.05 * k}
            rows.append(of_rule(rule, 5 + 4 * k + s, mu, 10.0 ** (4 + s), f, wave, **more))
    return rows


def cells(rows: list[Row], rule: int = 0) -> dict[str, str]:
    table = statements(rows)
    return dict(zip(table.header, table.rows[rule], strict=True))


def test_a_rule_that_gives_the_papers_numbers_meets_every_statement():
    crystal = [
        of_rule("", n, 0.0, 10.0 ** (3 + n), 138.1 * n / 2, 1.0, band_edge_theory_khz=138.1 * n / 2)
        for n in (1, 2, 3, 4)
    ]
    found = cells([*crystal, *a_study(1.25)])
    answers = [text for name, text in found.items() if name not in ("rule", "record")][1:]
    assert found["record"] == "linear wave" and found["random cases"] == "12"
    assert len(answers) == 9 and all(text.startswith("yes: ") for text in answers), found
    assert "+0.0 %" in found["case 6: 21.9 kHz, within 10 %"]
    assert "3 of 3 frictions, 1.25 to 1.35" in found["slope over V_P: 1.2-1.4"]


def test_a_rule_that_does_not_is_said_to_fail_where_it_fails():
    found = cells(a_study(1.0, wave=20.0))
    assert found["slope over V_P: 1.2-1.4"].startswith("no: 0 of 3 frictions, 1.00 to 1.10")
    assert found["slope grows with e"].startswith("yes: +1.0")  # 0.05 in 0.05 of e
    assert found["lambda 2 %: 7-18 D"] == "no: 0 of 12, 20 to 20"
    assert found["FCC: 138.1 kHz, within 1.5 %"] == ""  # no crystal, no answer


def test_rules_are_told_apart_and_absent_ones_have_no_row():
    assert [row[0] for row in statements(a_study(1.25)).rows] == [
        "one chain, maximum of the whole map"
    ]
    own = statements(a_study(1.25, rule="own_"))
    assert [row[0] for row in own.rows] == ["one chain, each particle's own maximum"]
    rows = a_study(1.25)
    for row in rows:
        row.values["ioffe_regel_khz"] = Estimate(30.0)
    assert statements(rows).rows[-1][0] == "Ioffe-Regel, no threshold"


def test_a_crystals_wavelength_by_eq_7_is_off_as_the_frequency_is():
    """2 V / pi f: where a rule is 2 % too high, the wavelength is 2 % short of sqrt 2."""
    row = of_rule("", 2, 0.0, 1e5, 1.02 * 137.7, 1.0, band_edge_theory_khz=137.7)
    found = cells([row])["FCC: lambda = sqrt 2 D, within 1 %"]
    assert found == f"no: {2**0.5 / 1.02:.3f} D, the furthest of 1"


def test_spread_of_the_highest_frequency():
    tops = {(2, 0.0): 211.0, (6, 0.0): 215.0, (10, 0.01): 220.0, (30, 0.4): 212.0}
    rows = [a_row(n, mu, 1e5, f_max_khz=top) for (n, mu), top in tops.items()]
    table = table_of_highest(rows)
    row = dict(zip(table.header, table.rows[0], strict=True))
    assert row["stress, kPa"] == "100" and row["FCC, kHz"] == "211.00" and row["packings"] == "4"
    assert row["mu_comp 0.01"] == "220.00"
    assert float(row["FCC, 0 and 0.4 apart, %"]) == pytest.approx(100 * (215 / 211 - 1), abs=5e-3)
    assert float(row["all apart, %"]) == pytest.approx(100 * (220 / 211 - 1), abs=5e-3)


def test_what_decides_the_highest_frequency_is_said_by_its_mode():
    rows = [a_row(n, mu, 1e7, f_max_khz=f) for n, mu, f in ((4, 0.0, 450.0), (8, 0.0, 449.0))]
    rows.append(a_row(32, 0.4, 1e7, f_max_khz=430.0, f_max_spheres=3.0, f_max_contacts=9.0))
    found = highest_apart({row.number: row for row in rows if row.number})
    assert not found.met and "case 32: 3, 9" in found.why


def test_excess_of_debyes_density_is_3_and_a_bump_is_found():
    """D = 3 f^2 / f_D^3 to f_D; modes added at 10 kHz raise the ratio there, by their share."""
    f, top = np.linspace(0, 1e5, 2001), 1e5
    plain = 3 * f**2 / top**3
    excess = Excess.of(f, plain, 1.0, top)
    assert excess.reduced == pytest.approx(3, rel=1e-12) and excess.at_a_tenth == pytest.approx(3)
    bump = plain * (1 + 4 * np.exp(-(((f - 2e4) / 3e3) ** 2)))
    excess = Excess.of(f, bump, 1.0, top)
    assert excess.peak == pytest.approx(15) and excess.peak_frequency == pytest.approx(2e4)
    falling = Excess.of(f, np.where(f > 0, 1e-5, 0), 1.0, top)  # largest at the first that is known
    assert np.isnan(falling.peak) and np.isnan(falling.peak_frequency)
    assert np.isnan(UNKNOWN.at_a_tenth) and np.isnan(UNKNOWN.peak)


def test_table_of_the_density_and_its_law_over_contacts():
    rows = []
    for k, z in enumerate((4.5, 5.0, 6.0)):
        row = a_row(
            6 + 4 * k, 0.1 * k, 1e5, coordination_number_bearing=z, excess_at_a_tenth=9 / z**2
        )
        row.values |= {"void_ratio": Estimate(0.55 + 0.05 * k), "f_max_khz": Estimate(200.0)}
        row.values |= {"excess_peak": Estimate(100.0), "excess_peak_khz": Estimate(20.0)}
        row.curves["excess"] = (np.linspace(0.1, 1, 5), np.ones(5))
        rows.append(row)
    table = table_of_density(rows)
    assert [row[0] for row in table.rows] == ["6", "10", "14"]
    assert table.rows[0][-1] == "0.1"
    laws = {tuple(row[:4]): row for row in table_of_laws(rows, {}).rows}
    law = laws[
        "random, 100 kPa", "", "D / f^2 at a tenth of f_max", "contacts a force-bearing sphere"
    ]
    assert float(law[4]) == pytest.approx(-2, abs=1e-4)


def test_powers_of_the_frictions_over_void_ratio_stand_in_the_laws():
    """The power over V_P grows by 0.05 a friction, which is 0.05 of e apart: a slope of 1."""
    lines = [row for row in table_of_laws(a_study(1.2), {}).rows if "(slope)" in row[3]]
    found = {row[2]: float(row[4]) for row in lines}
    assert found["f_low-pass 2 %, linear: power over V_P"] == pytest.approx(1.0, rel=1e-6)
    assert found["first peaks, linear wave: power over stress"] == pytest.approx(0, abs=1e-9)


def test_void_ratios_of_states_that_have_not_settled_are_marked():
    rows, states = a_study(1.2), {}
    for row in rows:
        states[row.mu_comp] = state = a_row(0, row.mu_comp, 1e3, void_ratio=0.6)
        state.unsettled = "residual 1e-2" if row.mu_comp > 0.05 else ""
        row.values["void_ratio_at_1_kpa"] = Estimate(0.55 + 0.1 * row.mu_comp)
        row.texts["unsettled_at_1_kpa"] = state.unsettled
    lines = table_of_laws(rows, states).rows
    assert {line[1] for line in lines} >= {"0.6000", "0.6000 (not settled)"}
    slope = "e at 1 kPa, 2 of 3 states not settled (slope)"
    assert {line[3] for line in lines if "(slope)" in line[3]} == {slope}


def test_targets_that_fail_say_by_how_much_and_what_other_rules_give():
    rows = {}
    for row in a_study(1.0):
        row.values |= {
            "lambda_2_over_d": Estimate(19.0, 0.6),
            "lambda_2_layers_linear_over_d": Estimate(15.0),
            "f_low_pass_2_own_linear_khz": Estimate(1.3 * row.value("f_low_pass_2_linear_khz")),
        }
        rows[row.number] = row
    rows[5].values["lambda_2_over_d"] = Estimate(30.0, 1.0)
    why = wavelengths("2")(rows).why
    assert "5: 30 ± 1" in why and "11 of them by less than twice their error" in why
    assert "means of layers, maximum of the whole map: 15 to 15, 12 of 12 inside" in why
    assert "by other rules: one chain, each particle's own maximum 1 to 1.1" in slopes(rows).why


def test_a_state_at_1_kpa_that_is_near_but_not_settled():
    state = a_row(0, 0.4, 1e3, coordination_number=3.70)
    assert coordination(0.4, 0.2, {0.4: state}).met
    state.unsettled = "residual 1e-2"
    above = [a_row(29, 0.4, 1e4, coordination_number=3.826), a_row(1, 0.4, 1e4)]
    found = coordination(0.4, 0.2, {0.4: state}, above)
    assert not found.met
    assert "inside, but the state has not settled: residual 1e-2" in found.why
    assert "settled at 10 kPa: 3.826" in found.why


def test_table_1_says_how_many_packings_stand_behind_a_case():
    row = a_row(6, 0.0, 1e5, void_ratio=0.55)
    one = table_1([row])
    assert one.rows[0][one.header.index("packings")] == "1"
    row.packings, row.samples = 3, {"void_ratio": 0.002}
    three = dict(zip(table_1([row]).header, table_1([row]).rows[0], strict=True))
    assert three["packings"] == "3" and float(three["void_ratio_sample_error"]) == 0.002
