"""Remove Snakemake's limit of jobs a second.

For each job that has ended, the limit sets a timer after which Snakemake looks at all jobs once
more. In a study of thousands of short jobs this happens hundreds of times a second in the end. No
option removes the limit: with a longer interval Snakemake still sets the timers, and waits for
them. The study's jobs need no such limit, which protects the scheduler of a cluster from thousands
of submissions a second.
"""

from typing import Any

LIMITER = "job_rate_limiter"
"""Attribute of Snakemake's scheduler that holds the limit; None means no limit."""


def remove_job_rate_limit(scheduler: Any) -> None:
    """Remove the limit from a scheduler of Snakemake.

    Raises AttributeError if the limit has another name in this version of Snakemake.
    """
    getattr(scheduler, LIMITER)
    setattr(scheduler, LIMITER, None)
