"""Measure run time against error: all benchmarks of the project by one command.

    python -m benchmarks [--quick] [NAME ...] [-o DIR]

Each job prints its page and writes NAME.md, its tables as CSV and its figures to DIR; README.md
there lists them. Without names all jobs run but `other_codes`, `questions`, whole commands on one
core and on all, `importing`, `multigrid_steps`, and `large` and `cubes`, which need 16 GB: three
minutes with --quick, 25 without.
The name `defaults` measures nothing: it prints what the rows in DIR say of the programs' defaults.
"""

import argparse
import importlib
import sys
import tempfile
import time
from pathlib import Path

from benchmarks import defaults
from benchmarks.harness import machine
from benchmarks.harness.measure import Job
from modal.tools.errors import InputError

JOBS = ("wave", "modes", "density", "time_step", "preparation", "contact_loop", "scaling")
NAMED = (*JOBS, "other_codes", "questions", "importing", "large", "cubes", "multigrid_steps")
"""Those that are not in `JOBS` run only when they are named."""


def write_index(folder: Path, quick: bool) -> None:
    """Write README.md with a list of the pages and, unless sizes are small, the defaults."""
    lines = [
        "# Run time against error",
        "",
        "Made by `python -m benchmarks` (`--quick` in three minutes; names pick some). Each page "
        "says on what machine. Seconds are processor time of one thread, of several the time by "
        "the clock; medians of three runs. Tasks of five seconds and more, and those of `--quick`, "
        "run once. Each task has a process of its own, whose peak memory is given.",
        "",
    ]
    pages = [path for path in sorted(folder.glob("*.md")) if path.name != "README.md"]
    lines += [f"- [{page.read_text().splitlines()[0].lstrip('# ')}]({page.name})" for page in pages]
    if not quick:
        lines += ["", defaults.table(folder)]
    (folder / "README.md").write_text("\n".join(lines) + "\n")


def run_job(name: str, quick: bool, folder: Path) -> bool:
    """Run one job and write its page; return False, after one line, if it failed."""
    start = time.perf_counter()
    try:
        with tempfile.TemporaryDirectory() as scratch:
            page = importlib.import_module(f"benchmarks.{name}").run(Job(quick, Path(scratch)))
    except Exception as error:  # the other jobs, which take half an hour, go on
        reason = str(error)
        if not isinstance(error, InputError):
            reason = f"{type(error).__name__}: {error}"
        print(f"error: {name}: {reason}", file=sys.stderr, flush=True)
        return False
    option = "--quick " if quick else ""
    page.notes.append(
        f"Made by `python -m benchmarks {option}{name}` in "
        f"{time.perf_counter() - start:.0f} s. {machine.description()}. "
        f"Programs that wanted a core meanwhile: {machine.load():.1f} (this one included)."
    )
    page.write(name, folder)
    print(page.markdown() + "\n", flush=True)
    write_index(folder, quick)
    return True


def main(argv: list[str] | None = None) -> int:
    """Run the jobs and return the exit status, 2 if a job failed."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__.splitlines()[0]
    )
    known = (*NAMED, "defaults")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(known))
    parser.add_argument("--quick", action="store_true", help="small sizes, three minutes")
    parser.add_argument("-o", "--output", default="products/benchmarks", metavar="DIR")
    options = parser.parse_args(argv)
    folder = Path(options.output)
    if options.names == ["defaults"]:
        print(defaults.table(folder))
        return 0
    unknown = [name for name in options.names if name not in NAMED]
    if unknown:
        parser.error(f"{unknown[0]!r} is not a job; choose from {', '.join(known)}")
    folder.mkdir(parents=True, exist_ok=True)
    jobs = dict.fromkeys(options.names or JOBS)
    successes = [run_job(job, options.quick, folder) for job in jobs]
    return 0 if all(successes) else 2


if __name__ == "__main__":
    sys.exit(main())
