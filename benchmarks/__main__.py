"""Run time against error: every benchmark of the project with one command.

    python -m benchmarks [--quick] [NAME ...] [-o DIR]

Each job prints a Markdown table and writes NAME.md, NAME.csv and its figures to DIR; README.md
there lists them. Without names all jobs run: three minutes with --quick, forty without.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import tempfile
import time
from pathlib import Path

from benchmarks import machine, report
from modal.storage import InputError

JOBS = (
    "fcc_time_step",
    "random_time_step",
    "wave",
    "eigensolvers",
    "density",
    "preparation",
    "shortcuts",
    "scaling",
)


LONG = ("modes", "modes_scaling", "protocol", "agreement")
"""Tables of 35,201 spheres and more, and of whole chains; run only when named."""


def result(name: str, quick: bool, scratch: Path) -> report.Finding:
    """Run one job."""
    job = importlib.import_module(f"benchmarks.{name}")
    if name == "modes":
        return report.Finding(job.__doc__.splitlines()[0], "", job.run(quick))
    return job.run(quick, scratch)


def index(folder: Path) -> None:
    """README.md: the sections that are there."""
    lines = [
        "# Run time against error",
        "",
        "Made by `python -m benchmarks` (`--quick` in three minutes; names pick some). Each page "
        "says on what machine. Seconds are processor time of one thread, medians of three runs; "
        "tasks of about ten seconds and more, and those of `--quick`, run once. Each task has a "
        "process of its own, whose peak memory is given.",
        "",
    ]
    for name in (*JOBS, *LONG):
        page = folder / f"{name}.md"
        if page.exists():
            title = page.read_text().splitlines()[0].lstrip("# ")
            lines.append(f"- [{title}]({name}.md)")
    (folder / "README.md").write_text("\n".join(lines) + "\n")


def main(argv: list[str] | None = None) -> int:
    """Run the jobs; returns the exit status, 2 if a job could not be done."""
    known = (*JOBS, *LONG)
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__.splitlines()[0]
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(known))
    parser.add_argument("--quick", action="store_true", help="small sizes, three minutes")
    parser.add_argument("-o", "--output", default="products/benchmarks", metavar="DIR")
    options = parser.parse_args(argv)
    unknown = [name for name in options.names if name not in known]
    if unknown:
        parser.error(f"{unknown[0]!r} is not a job; choose from {', '.join(known)}")
    folder, status = Path(options.output), 0
    folder.mkdir(parents=True, exist_ok=True)
    where = machine.description()
    for name in options.names or JOBS:
        start = time.perf_counter()
        try:
            with tempfile.TemporaryDirectory() as scratch:
                finding = result(name, options.quick, Path(scratch))
        except Exception as error:  # the others are half an hour's work: none is lost to this one
            kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
            print(f"error: {name}: {kind}{error}", file=sys.stderr, flush=True)
            status = 2
            continue
        finding.notes += [
            f"Made by `python -m benchmarks {'--quick ' * options.quick}{name}` in "
            f"{time.perf_counter() - start:.0f} s. " + "; ".join(where) + ". "
            f"Programs that wanted a core meanwhile: {machine.load():.1f} (this one included).",
        ]
        print(report.write(finding, name, folder) + "\n", flush=True)
        index(folder)
    return status


if __name__ == "__main__":
    sys.exit(main())
