"""The temporary folder of a server; those of servers that were killed are removed by the next one.

A server has the number of its process in the name of its folder: `quito-gui-1234-x7k2_9vd`.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

_NAMED = re.compile(r"quito-gui-(?P<process>[0-9]+)-\w+")


def new_folder() -> Path:
    """Make a folder that nobody else can read; remove those that nobody needs any more."""
    where = Path(tempfile.gettempdir())
    with suppress(OSError):
        for path in where.iterdir():
            with suppress(OSError):
                if _left_behind(path):
                    shutil.rmtree(path, ignore_errors=True)
    return Path(tempfile.mkdtemp(prefix=f"quito-gui-{os.getpid()}-"))


def _left_behind(path: Path) -> bool:
    """Whether a folder is ours, and its server is gone."""
    named = _NAMED.fullmatch(path.name)
    if named is None or path.is_symlink() or path.stat().st_uid != os.getuid():
        return False
    try:
        os.kill(int(named["process"]), 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):  # somebody else's process, which is alive
        return False
    return False
