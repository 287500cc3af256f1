"""How many cases are solved at once."""

from __future__ import annotations

import os
from typing import Final

from quito_cli.errors import UsageError

MOST_JOBS: Final = 1000
"""Processes at once: more is a slip of the finger, and stops the machine."""


def available() -> int:
    """Return the processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def workers_of(jobs: int | None, cluster: str | None) -> int:
    """Return how many cases are solved at once here.

    Args:
        jobs: as asked for; None: as many as there are processors.
        cluster: address of a scheduler, whose workers are counted there.

    Raises:
        UsageError: the number is none, or it is said of a cluster.
    """
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise UsageError(f"jobs: a number from 1 to {MOST_JOBS} is expected, got {jobs}")
    if cluster is not None and jobs is not None:
        raise UsageError("jobs is of this machine, and a cluster has its own: leave it out")
    return jobs or available()
