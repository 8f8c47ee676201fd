"""V_P by every rule in one table, the known bias of each, and its powers of stress and void ratio.

The bias is that of the rule on the exact planar wave of the FCC crystal, whose V_P is Eq. 6's; of
rules that read no signal it follows from the exact lattice of 200 layers. A random packing has no
exact answer: there the springs under a steady push are what the others can be held against.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from analysis.estimators.coherent import coherent_wave, longest_waves
from analysis.estimators.damped_transform import mode_dispersion
from analysis.estimators.effective_medium import of_contacts, of_means
from analysis.estimators.layer_lattice import LayerLattice, lattice_signals
from analysis.estimators.own_wave import RECORD
from analysis.estimators.resonances import long_wave_velocity
from analysis.estimators.transfer import at_frequency, wall_velocity
from analysis.estimators.travel_time import first_peak_velocity
from analysis.measures.long_waves import LOW_ORDER
from analysis.rows import Row, groups_of, law_of
from analysis.study.frictions import powers
from analysis.table import Table
from modal.elasticity.static_velocity import static_velocity
from modal.packing.crystal import fcc
from modal.packing.state import contacts_per_particle, void_ratio
from modal.theory.fcc import FccLattice

RULES = {
    "v_p_first_peaks_yade_m_per_s": "first peaks, YADE",
    "v_p_first_peaks_linear_m_per_s": "first peaks, linear wave",
    "v_p_first_peaks_columns_m_per_s": "first peaks, all columns",
    "v_p_long_waves_yade_m_per_s": "long waves, YADE",
    "v_p_long_waves_linear_m_per_s": "long waves, linear wave",
    "v_p_modes_first_m_per_s": "modes, 2 L f_1 (Eq. 4)",
    "v_p_modes_eq_4_m_per_s": "modes, r = 2-10, kappa of Eq. 4",
    "v_p_modes_fitted_m_per_s": "modes, fitted wave numbers",
    "v_p_walls_phase_m_per_s": "phase between the walls, lambda = L/5",
    "v_p_static_m_per_s": "static, springs",
    "v_p_emt_contacts_m_per_s": "effective medium, its contacts",
    "v_p_emt_means_m_per_s": "effective medium, means of e and Z",
}
"""Columns of table1.csv, and what they are called here."""
WHY = {
    "first peaks": "the peak broadens and falls behind as it travels (dispersion)",
    "long waves": "extrapolated to zero frequency; of a crystal by the damped transform, unbiased",
    "2 L f_1": "walls give way: the column swings as a longer one",
    "Eq. 4": "the same, and the bend of the dispersion, which the fit takes off",
    "fitted": "wave number and phase of each shape are fitted",
    "walls": "phase velocity at a finite wavelength; the walls' contacts add delay",
    "static": "no wave; the springs of the state at rest",
    "its contacts": "exact for the crystal; an upper bound for random packings",
    "means": "the same, of e and Z alone",
}
"""Part of a rule's name: where its bias comes from."""


@cache
def exact_biases(layers: int = 200) -> dict[str, float]:
    """Relative error of the rules on the exact lattice at 100 kPa, by their column."""
    lattice = LayerLattice.of_crystal(FccLattice(1e5), layers)
    length = (lattice.layers - 1) * lattice.distance + 2 * lattice.wall_gap
    record = lattice_signals(lattice, np.arange(0, length / lattice.velocity, 4e-7))
    omega, shape = lattice.eigenmodes()
    f = omega / (2 * np.pi)
    kappa = np.pi * np.arange(1, len(f) + 1) / length
    peaks = first_peak_velocity(record, 0.0, length)[0]
    coherent = longest_waves(coherent_wave(record, length))[0]
    longer = lattice_signals(lattice, np.arange(0, RECORD * length / lattice.velocity, 4e-7))
    walls, low = wall_velocity(longer, length), LOW_ORDER * lattice.velocity / (2 * length)
    network = fcc(1e5, (1, 1, layers))
    contacts = float(contacts_per_particle(network).mean())
    means = of_means(void_ratio(network), contacts, 1e5, float(network.radius[0]))
    found = {
        "v_p_first_peaks_linear_m_per_s": peaks,
        "v_p_first_peaks_yade_m_per_s": peaks,
        "v_p_first_peaks_columns_m_per_s": peaks,
        "v_p_long_waves_linear_m_per_s": coherent,
        "v_p_long_waves_yade_m_per_s": coherent,
        "v_p_modes_first_m_per_s": 2 * length * f[0],
        "v_p_modes_eq_4_m_per_s": long_wave_velocity(f, kappa)[0],
        "v_p_modes_fitted_m_per_s": mode_dispersion(f, shape.T, lattice.distance).velocity,
        "v_p_walls_phase_m_per_s": at_frequency(walls[0], walls[1], low),
        "v_p_static_m_per_s": static_velocity(network)[0],
        "v_p_emt_contacts_m_per_s": of_contacts(network).velocity,
        "v_p_emt_means_m_per_s": means.velocity,
    }
    return {name: value / lattice.velocity - 1 for name, value in found.items()}


def table_of_biases() -> Table:
    """Each rule, its error on the exact lattice, and where it comes from."""
    known = exact_biases()
    lines = []
    for name, text in RULES.items():
        why = next(reason for part, reason in WHY.items() if part in text)
        bias = f"{100 * known[name]:+.3f}" if name in known else ""
        lines.append([text, bias, why])
    header = ["rule", "bias on the exact crystal's wave, %", "where it comes from"]
    return Table("V_P: the rules and their known bias", header, lines)


def velocities(rows: list[Row]) -> Table:
    """One row a case: V_P by each rule with its error, m/s; the static one stands beside."""
    shown = {name: text for name, text in RULES.items() if _any(rows, name)}
    header = ["case", "mu_comp", "stress, kPa", "e"]
    for text in shown.values():
        header += [f"{text}, m/s", "±"]
    header += ["first peaks over static", "long waves over static"]
    lines = []
    for row in rows:
        line = [str(row.number or row.name), f"{row.mu_comp:g}", f"{row.stress / 1e3:g}"]
        line.append(f"{row.value('void_ratio'):.4f}")
        for name in shown:
            line += [_text(row.value(name), ".1f"), _text(row.spread(name), ".1g")]
        static = row.value("v_p_static_m_per_s")
        for name in ("v_p_first_peaks_m_per_s", "v_p_long_waves_linear_m_per_s"):
            line.append(_text(row.value(name) / static, ".4f"))
        lines.append(line)
    return Table("V_P of each case by each rule", header, lines)


def _any(rows: list[Row], name: str) -> bool:
    return any(np.isfinite(row.value(name)) for row in rows)


def _text(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else ""


def table_of_laws(rows: list[Row], states: dict[float, Row]) -> Table:
    """Exponents of V_P, f_low-pass and f_max over the stresses of each friction, and over e.

    Over void ratio at one stress: the power of V_P over all frictions, at each stress, of the
    random packings. `states` give e at 1 kPa, by which the paper groups.
    """
    lines: list[list[str]] = []
    quantities = [
        *((text, name) for name, text in RULES.items()),
        ("f_low-pass 2 %, YADE", "f_low_pass_2_yade_khz"),
        ("f_low-pass 2 %, linear wave", "f_low_pass_2_linear_khz"),
        ("lambda_low-pass 2 %, linear wave", "lambda_2_linear_over_d"),
        ("Ioffe-Regel frequency", "ioffe_regel_khz"),
        ("f_max", "f_max_khz"),
        ("D / f^2 at a tenth of f_max", "excess_at_a_tenth"),
        ("frequency of the maximum of D / f^2", "excess_peak_khz"),
    ]
    for group, members in groups_of(rows).items():
        state = states.get(members[0].mu_comp)
        e = ""
        if state is not None and not members[0].crystal:
            e = f"{state.value('void_ratio'):.4f}" + " (not settled)" * bool(state.unsettled)
        for text, name in quantities:
            _line(lines, group, e, text, "stress", members, "stress_pa", name)
        for producer in ("yade", "linear"):
            x, y = f"v_p_first_peaks_{producer}_m_per_s", f"f_low_pass_2_{producer}_khz"
            text = f"f_low-pass 2 %, {producer}"
            _line(lines, group, e, text, "V_P by first peaks", members, x, y)
    random = [row for row in rows if not row.crystal]
    for stress in sorted({row.stress for row in random}):
        members = [row for row in random if row.stress == stress]
        if len({row.mu_comp for row in members}) > 1:
            group = f"random, {stress / 1e3:g} kPa"
            for text, name in quantities:
                _line(lines, group, "", text, "void ratio", members, "void_ratio", name)
            for text, name in quantities[-2:]:
                bearing = "coordination_number_bearing"
                _line(
                    lines,
                    group,
                    "",
                    text,
                    "contacts a force-bearing sphere",
                    members,
                    bearing,
                    name,
                )
    for text, name in quantities:
        _trend(lines, random, f"{text}: power over stress", "stress_pa", name)
    for producer in ("yade", "linear"):
        x, y = f"v_p_first_peaks_{producer}_m_per_s", f"f_low_pass_2_{producer}_khz"
        _trend(lines, random, f"f_low-pass 2 %, {producer}: power over V_P", x, y)
    header = ["group", "e at 1 kPa", "quantity", "power of", "exponent", "standard error", "cases"]
    return Table("Powers over stress, V_P and void ratio", header, lines)


def _trend(lines: list[list[str]], random: list[Row], text: str, x: str, y: str) -> None:
    """How the power of the frictions changes with the void ratio: a slope, no power."""
    found = powers(random, x, y)
    if found is not None and len(found.e) > 2:
        slope, error = found.trend
        line = ["random, each friction", "", text, f"{found.which_e} (slope)", f"{slope:.4f}"]
        lines.append([*line, _text(error, ".2g"), str(len(found.e))])


def _line(
    lines: list[list[str]],
    group: str,
    e: str,
    text: str,
    over: str,
    members: list[Row],
    x: str,
    y: str,
) -> None:
    law = law_of(members, x, y)
    if np.isfinite(law.exponent):
        known = sum(np.isfinite(row.value(y)) for row in members)
        error = _text(law.error, ".2g")
        lines.append([group, e, text, over, f"{law.exponent:.4f}", error, str(known)])
