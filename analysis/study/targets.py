"""Each number that the paper states and this study can meet: ours, the rule, met or not, and why.

`targets` takes the rows of the cases at hand. Where a target speaks of several cases, `value` is
the one that is furthest from it, and `why` names the others' range. A case that is not there makes
no number: the target is then not met, and `why` says what is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from analysis.rows import Row
from analysis.study.low_pass_targets import dem_edge, slopes, wavelengths
from analysis.study.target_rules import (
    CRYSTALS,
    RANDOM,
    Finding,
    all_within,
    chi_high,
    coordination,
    crystal_exponent,
    gain,
    highest_apart,
    near,
    paper,
    random_exponents,
    rounds,
)
from analysis.table import Table

HEADER = ("id", "value", "error", "target", "rule", "met", "why")


@dataclass(frozen=True)
class Target:
    """A stated number: its id, as the paper has it, our rule in words, and the rule."""

    id: str
    stated: str
    rule: str
    find: Callable[[dict[int, Row]], Finding]


CHAIN = "one chain, {} % of the maximum of the whole map, at 50-60 % of the length, on a plateau"
TARGETS = (
    Target(
        "fcc_f_min",
        "0.7534 kHz, within 0.1 %",
        "lowest of all modes",
        near(2, "f_min_khz", paper("f_min", 2), 1e-3),
    ),
    Target(
        "fcc_f_max",
        "211.2 kHz, within 0.1 %",
        "highest mode",
        near(2, "f_max_khz", paper("f_max", 2), 1e-3),
    ),
    Target(
        "fcc_f_1",
        "1.06 kHz, rounds to it",
        "first pure P mode",
        rounds(2, "f_1_khz", paper("f_1", 2), 2),
    ),
    Target(
        "fcc_f_200",
        "137.6 kHz, within 0.1 %",
        "200th pure P mode",
        near(2, "f_200_khz", paper("f_200", 2), 1e-3),
    ),
    Target("fcc_n_modes", "200", "number of pure P modes", near(2, "resonances", 200, 0)),
    Target(
        "fcc_flow_theory",
        "137.7 kHz, within 0.1 %",
        "Eq. 10",
        near(2, "band_edge_theory_khz", paper("f_low_pass", 2), 1e-3),
    ),
    Target(
        "fcc_flow_modal",
        "137.6 kHz, within 0.1 %",
        "band edge of the modes' dispersion",
        near(2, "band_edge_modes_khz", paper("f_low_pass_modal", 2), 1e-3),
    ),
    Target(
        "fcc_flow_dem",
        "138.1 kHz, within 1.5 % (rule) and 0.5 % (unbiased)",
        "one chain, 2 % of the maximum of the whole map, at 5-15 % of the length; damped transform",
        dem_edge,
    ),
    Target(
        "fcc_e",
        "0.353, rounds to it",
        "wall to wall",
        rounds(2, "void_ratio", paper("void_ratio", 2), 3),
    ),
    Target(
        "fcc_lambda",
        "1.4142, within 1 %",
        "wavelength where the record's waves turn round",
        all_within(CRYSTALS, "lambda_edge_yade_over_d", 0.99 * 2**0.5, 1.01 * 2**0.5),
    ),
    Target("fcc_b", "1/6, within 0.002", "V_P by first peaks over stress", crystal_exponent),
    Target(
        "fcc_trans_only",
        "1, within 0.5 %",
        "highest mode without rotations over Eq. 10",
        near(2, "translations_only_over_edge", 1.0, 5e-3),
    ),
    Target(
        "rnd_n", "35201", "particles of the packing", all_within(RANDOM, "particles", 35201, 35201)
    ),
    Target("rnd_length", "141-146", "length / D", all_within(RANDOM, "length_over_d", 141, 146)),
    *(
        Target(
            f"rnd_e_{n}",
            f"{paper('void_ratio', n)}, within {off}",
            "wall to wall",
            near(n, "void_ratio", paper("void_ratio", n), off, relative=False),
        )
        for n, off in ((6, 0.01), (7, 0.01), (8, 0.01), (22, 0.01), (30, 0.015))
    ),
    Target(
        "rnd_fmax_6",
        "216.1 kHz, within 2 %",
        "highest mode",
        near(6, "f_max_khz", paper("f_max", 6), 0.02),
    ),
    Target(
        "rnd_fmax_30",
        "214.1 kHz, within 2 %",
        "highest mode",
        near(30, "f_max_khz", paper("f_max", 30), 0.02),
    ),
    Target(
        "fmax_spread",
        "below 3 %",
        "largest over smallest of FCC, friction 0 and 0.4 at one stress",
        highest_apart,
    ),
    Target(
        "rnd_flow_6",
        "21.9 kHz, within 10 %",
        CHAIN.format(2),
        near(6, "f_low_pass_2_khz", paper("threshold_2", 6), 0.1, plateau="2"),
    ),
    Target(
        "rnd_b",
        "above 1/6, grows with e at 1 kPa",
        "V_P by first peaks over stress, each friction; b over e at 1 kPa has a slope of more than "
        "twice its standard error",
        random_exponents,
    ),
    Target(
        "rnd_chi_low",
        "above 0.9",
        "largest of the chain below 0.05 f_max, where the paper has 10 kHz",
        all_within([6], "chi_z_low", 0.9, np.inf),
    ),
    Target(
        "rnd_chi_high",
        "about 0.33",
        "largest of the chain above 0.07 f_max, where the paper has 15 kHz",
        chi_high,
    ),
    Target(
        "rnd_lambda_2",
        "7-18",
        CHAIN.format(2) + ", wave number of the same record",
        wavelengths("2"),
    ),
    Target(
        "rnd_lambda_1",
        "5-12",
        CHAIN.format(1) + ", wave number of the same record",
        wavelengths("1"),
    ),
    Target(
        "rnd_slope", "1.2-1.4", "slope of log f_low-pass (2 %) over log V_P, each friction", slopes
    ),
    Target("gain_peak", "above 1", "largest receiver over source stress", gain),
)


AT_1_KPA = (
    ("rnd_cn_dense", "5.91, within 0.1", 0.0, 0.1),
    ("rnd_cn_loose", "3.84, within 0.2", 0.4, 0.2),
)
"""Id, as the paper has it, friction, how near: of states that are no case."""


@dataclass(frozen=True)
class Answer:
    """What was found of a target: its id, the paper's words, our rule, the finding."""

    id: str
    stated: str
    rule: str
    finding: Finding

    @property
    def met(self) -> str:
        """In a word."""
        return "yes" if self.finding.met else "no"


def answers(rows: Iterable[Row], states: dict[float, Row] | None = None) -> list[Answer]:
    """Of every target; `states` are the packings at 1 kPa by their friction."""
    numbered = {row.number: row for row in rows if row.number is not None}
    found = [Answer(t.id, t.stated, t.rule, t.find(numbered)) for t in TARGETS]
    after = 1 + next(k for k, target in enumerate(TARGETS) if target.id == "rnd_e_30")
    for key, stated, friction, within in reversed(AT_1_KPA):
        finding = coordination(friction, within, states or {}, numbered.values())
        rule = "contacts a particle of the state at 1 kPa"
        found.insert(after, Answer(key, stated, rule, finding))
    return found


def targets(found: list[Answer]) -> Table:
    """The table of targets, for files."""
    cells = [[a.id, *_value(a), a.stated, a.rule, a.met, a.finding.why] for a in found]
    return Table("The paper's numbers as targets", HEADER, cells)


def targets_seen(found: list[Answer]) -> Table:
    """The same for readers, with how far each is from what the paper has."""
    header = ["target", "here", "±", "the paper", "deviation", "rule", "met", "why"]
    cells = [
        [a.id, *_value(a), a.stated, a.finding.off, a.rule, a.met, a.finding.why] for a in found
    ]
    return Table("Targets", header, cells)


def _value(answer: Answer) -> tuple[str, str]:
    return _text(answer.finding.value), _text(answer.finding.error, 2)


def _text(value: float, digits: int = 6) -> str:
    return f"{value:.{digits}g}" if np.isfinite(value) else ""
