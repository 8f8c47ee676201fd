"""Record which jobs of a run of Snakemake have failed, and why, for run.py to print."""

from pathlib import Path

MENDABLE = "2"
"""Exit status of a run in which the log of each failed job says what the user can do."""
FAILED = "1"
"""Exit status of any other run that fails."""
ERROR_MARK = "error: "
"""Beginning of the line of a log that says what the user can do about a failure."""


def write_failures(folder: Path, started: float) -> None:
    """Write the file .failed in a folder of products: an exit status, and a line for each job.

    `started` is when the run began, in seconds since the epoch; older logs belong to other runs.
    """
    reasons = []
    all_mendable = True
    for log in sorted((folder / "log").glob("*/*.log")):
        if log.stem.endswith(".yade") or not _has_failed(log, started):
            continue
        lines = log.read_text(errors="replace").strip().splitlines() or ["no word"]
        errors = [line.removeprefix(ERROR_MARK) for line in lines if line.startswith(ERROR_MARK)]
        last_line = (errors or lines)[-1]
        reasons.append(f"{log.parent.name} {log.stem}: {last_line} ({log})")
        all_mendable = all_mendable and bool(errors)
    status = MENDABLE if reasons and all_mendable else FAILED
    (folder / ".failed").write_text("\n".join([status, *reasons]))


def _has_failed(log: Path, started: float) -> bool:
    """Tell whether the job of a log has failed in this run.

    A successful job writes its benchmark after its log.
    """
    time_of_log = log.stat().st_mtime
    if time_of_log < started:
        return False
    benchmark = log.parents[2] / "cost" / log.parent.name / f"{log.stem}.tsv"
    return not (benchmark.exists() and benchmark.stat().st_mtime >= time_of_log)
