"""Remove Snakemake's limit of jobs a second.

For each job that has ended, the limit sets a timer after which Snakemake looks at all jobs once
more. In a study of thousands of short jobs these are hundreds of looks a second in the end. No
option removes the limit: a longer span keeps the timers, and makes Snakemake wait for them. The
study's jobs need no such limit, which protects the scheduler of a cluster from thousands of
submissions a second.
"""

from typing import Any

LIMITER = "job_rate_limiter"
"""Attribute of Snakemake's scheduler that holds the limit; None means no limit."""


def remove_job_rate_limit(scheduler: Any) -> None:
    """Remove the limit from a scheduler of Snakemake.

    Raises AttributeError if the scheduler of another version of Snakemake calls the limit
    otherwise.
    """
    getattr(scheduler, LIMITER)
    setattr(scheduler, LIMITER, None)
