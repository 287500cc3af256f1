"""Resident memory of a process and of all that it has started.

From `/proc` where there is one, at some microseconds a process; elsewhere `ps` is asked.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

_PROC = Path("/proc")
QUICK = (_PROC / "self" / "task" / str(os.getpid()) / "children").exists()
"""Whether asking costs next to nothing."""
_KILO = 1024


def resident(process: int) -> int:
    """Return the bytes that a process and its descendants hold; 0 where it is gone, or nobody
    knows."""
    return _from_proc(process) if QUICK else _from_ps(process)


def _from_proc(process: int) -> int:
    total, pending, page = 0, [process], os.sysconf("SC_PAGE_SIZE")
    while pending:
        home = _PROC / str(pending.pop())
        try:
            total += int((home / "statm").read_text().split()[1]) * page
            for task in (home / "task").iterdir():
                pending += map(int, (task / "children").read_text().split())
        except (OSError, ValueError, IndexError):  # it has ended in the meantime
            continue
    return total


def _from_ps(process: int) -> int:
    try:
        listed = subprocess.run(
            ["ps", "-A", "-o", "pid=,ppid=,rss="], capture_output=True, text=True, check=True
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        return 0
    size: dict[int, int] = {}
    children: dict[int, list[int]] = {}
    for line in listed.splitlines():
        own, parent, kilobytes = map(int, line.split())
        size[own] = kilobytes * _KILO
        children.setdefault(parent, []).append(own)
    total, pending = 0, [process]
    while pending:
        own = pending.pop()
        total += size.get(own, 0)
        pending += children.get(own, [])
    return total


def in_words(size: int) -> str:
    """Return bytes as a person writes them: `1.5 GB`, `200 MB`."""
    for unit, factor in (("GB", 10**9), ("MB", 10**6), ("kB", 10**3)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size} bytes"
