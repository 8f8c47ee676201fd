"""What the rules' jobs have cost: measured on this machine where they ran, else as in cost.tsv.

    python workflow/cost.py PRODUCTS      prints the core-hours of each rule

Snakemake notes seconds and memory of each job in PRODUCTS/cost/RULE/CASE.tsv (`benchmark:`).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

STARTED = 3.0
"""Seconds of a job that does next to nothing: programs are loaded."""
GROWTH = 4 / 3
"""A walk's and a wave's steps grow with the length, each with the number of spheres."""


@dataclass(frozen=True)
class Cost:
    """Jobs of a rule: how many, seconds of one and of the longest, memory of the largest, MB."""

    jobs: int
    seconds: float
    longest: float
    memory: float


def job(path: Path) -> tuple[float, float]:
    """Seconds and memory, MB, of the job whose benchmark this is; memory is 0 if it was short."""
    header, *rows = (line.split("\t") for line in path.read_text().splitlines())
    row = dict(zip(header, rows[-1], strict=True))
    memory = row["max_rss"]
    return float(row["s"]), float(memory) if memory not in ("NA", "-") else 0.0


def measured(folder: Path) -> dict[str, Cost]:
    """Costs by rule, of the jobs whose products are in a folder."""
    found = {}
    for rule in sorted((folder / "cost").glob("*/")):
        jobs = [job(path) for path in rule.glob("*.tsv") if path.stat().st_size]
        if jobs:
            seconds, memory = zip(*jobs, strict=True)
            mean = sum(seconds) / len(jobs)
            found[rule.name] = Cost(len(jobs), mean, max(seconds), max(memory))
    return found


def expected(folder: Path, size: float) -> dict[str, Cost]:
    """Cost of one job of each rule; `size` is the number of spheres over that of the study."""
    found = {}
    for line in Path(__file__).with_suffix(".tsv").read_text().splitlines():
        if line[0] != "#":
            rule, text, memory = line.split()
            seconds = STARTED + float(text) * size**GROWTH
            found[rule] = Cost(0, seconds, seconds, float(memory) * size)
    return found | measured(folder)


def table(folder: Path) -> str:
    """Core-hours of each rule, and of all."""
    costs = measured(folder)
    if not costs:
        return f"{folder}: nothing was made yet"
    lines = [f"{'rule':18}{'jobs':>6}{'core-hours':>12}{'longest, s':>12}{'most memory, MB':>17}"]
    for rule, cost in costs.items():
        hours = cost.jobs * cost.seconds / 3600
        memory = f"{cost.memory:.0f}" if cost.memory else "-"
        lines.append(f"{rule:18}{cost.jobs:6}{hours:12.4f}{cost.longest:12.1f}{memory:>17}")
    hours = sum(cost.jobs * cost.seconds for cost in costs.values()) / 3600
    return "\n".join([*lines, f"{'all':18}{sum(c.jobs for c in costs.values()):6}{hours:12.4f}"])


if __name__ == "__main__":
    print(table(Path(sys.argv[1])))
