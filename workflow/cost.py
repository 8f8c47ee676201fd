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
    """Jobs of a rule: how many, seconds of one and of the longest, memory of the largest, MB.

    `busy`: seconds of a processor that one took, less than `seconds` where others ran beside it.
    """

    jobs: int
    seconds: float
    longest: float
    memory: float
    busy: float = float("nan")


def job(path: Path) -> tuple[float, float, float]:
    """Seconds, memory, MB, and processor's seconds of a job; memory is 0 if it was short."""
    header, *rows = (line.split("\t") for line in path.read_text().splitlines())
    row = dict(zip(header, rows[-1], strict=True))
    memory, busy = row["max_rss"], row.get("cpu_time", "-")
    busy = float(busy) if busy not in ("NA", "-") else float(row["s"])
    return float(row["s"]), float(memory) if memory not in ("NA", "-") else 0.0, busy


def measured(folder: Path) -> dict[str, Cost]:
    """Costs by rule, of the jobs whose products are in a folder."""
    found = {}
    for rule in sorted((folder / "cost").glob("*/")):
        jobs = [job(path) for path in rule.glob("*.tsv") if path.stat().st_size]
        if jobs:
            seconds, memory, busy = zip(*jobs, strict=True)
            mean = sum(seconds) / len(jobs)
            own = sum(busy) / len(jobs)
            found[rule.name] = Cost(len(jobs), mean, max(seconds), max(memory), own)
    return found


def expected(folder: Path, size: float) -> dict[str, Cost]:
    """Cost of one job of each rule; `size` is the number of spheres over that of the study."""
    found = {}
    for line in Path(__file__).with_suffix(".tsv").read_text().splitlines():
        if line.strip() and line[0] != "#":
            rule, text, memory = line.split()
            seconds = STARTED + float(text) * size**GROWTH
            found[rule] = Cost(0, seconds, seconds, float(memory) * size)
    return found | measured(folder)


def table(folder: Path) -> str:
    """Core-hours of each rule and of all, by the clock and by what processors were busy."""
    costs = measured(folder)
    if not costs:
        return f"{folder}: nothing was made yet"
    head = f"{'rule':18}{'jobs':>6}{'core-hours':>12}{'processor, h':>14}"
    lines = [f"{head}{'longest, s':>12}{'most memory, MB':>17}"]
    for rule, cost in costs.items():
        hours, busy = (cost.jobs * one / 3600 for one in (cost.seconds, cost.busy))
        memory = f"{cost.memory:.0f}" if cost.memory else "-"
        line = f"{rule:18}{cost.jobs:6}{hours:12.4f}{busy:14.4f}"
        lines.append(f"{line}{cost.longest:12.1f}{memory:>17}")
    jobs = sum(cost.jobs for cost in costs.values())
    hours, busy = (
        sum(cost.jobs * one for cost, one in zip(costs.values(), each, strict=True)) / 3600
        for each in ([c.seconds for c in costs.values()], [c.busy for c in costs.values()])
    )
    return "\n".join([*lines, f"{'all':18}{jobs:6}{hours:12.4f}{busy:14.4f}"])


if __name__ == "__main__":
    print(table(Path(sys.argv[1])))
