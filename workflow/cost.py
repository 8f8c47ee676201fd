"""What the rules' jobs cost: as in cost.tsv, and as measured on this machine where they ran.

    python workflow/cost.py PRODUCTS      prints the core-hours of each rule

Snakemake notes seconds and memory of each job in PRODUCTS/cost/RULE/CASE.tsv (`benchmark:`).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

Key = tuple[str, str]
"""A rule, and the kind of its case: crystal or random."""
STARTED = 3.0
"""Seconds of a job that does next to nothing: programs are loaded."""


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


def measured(folder: Path, kind: Callable[[str], str]) -> dict[Key, Cost]:
    """Costs of the jobs whose products are in a folder, by rule and by the `kind` of a case."""
    jobs: dict[Key, list[tuple[float, float, float]]] = {}
    for path in sorted((folder / "cost").glob("*/*.tsv")):
        if path.stat().st_size:
            key = path.parent.name, kind(path.name.split(".")[0])
            jobs.setdefault(key, []).append(job(path))
    found = {}
    for key, all_of_it in jobs.items():
        seconds, memory, busy = zip(*all_of_it, strict=True)
        n = len(seconds)
        found[key] = Cost(n, sum(seconds) / n, max(seconds), max(memory), sum(busy) / n)
    return found


def listed(sizes: Mapping[str, float]) -> dict[Key, Cost]:
    """Cost of one job as cost.tsv has it; `sizes` by kind are over those of the full study."""
    found = {}
    lines = Path(__file__).with_suffix(".tsv").read_text().splitlines()
    _, *rows = (line.split() for line in lines if line[0] != "#")
    for rule, kind, *numbers in rows:
        typical, longest, power, loaded, memory = map(float, numbers)
        seconds, longest = (STARTED + s * sizes[kind] ** power for s in (typical, longest))
        found[rule, kind] = Cost(0, seconds, longest, loaded + memory * sizes[kind])
    return found


def expected(
    folder: Path, sizes: Mapping[str, float], kind: Callable[[str], str]
) -> dict[Key, Cost]:
    """Cost of one job: seconds as measured, where jobs of this rule and kind ran, else as listed.

    The longest and the largest job are still to be expected, also where small ones ran.
    """
    here = measured(folder, kind)
    return {
        key: replace(
            own := here.get(key, row),
            longest=max(own.longest, row.longest),
            memory=max(own.memory, row.memory),
        )
        for key, row in listed(sizes).items()
    }


def resources(cost: Callable[[Any], Cost]) -> dict[str, Callable[[Any, int], int]]:
    """What a rule asks for, memory, MB, and run time, minutes: both times the number of the try.

    `cost` is that of a job, by its wildcards.
    """
    return {
        "mem_mb": lambda wildcards, attempt: attempt * int(1.5 * cost(wildcards).memory),
        "runtime": lambda wildcards, attempt: attempt * int(10 + cost(wildcards).longest / 30),
    }


def table(folder: Path) -> str:
    """Core-hours of each rule and of all, by the clock and by what processors were busy."""
    costs = {rule: cost for (rule, _), cost in measured(folder, lambda case: "").items()}
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
