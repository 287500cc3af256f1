"""The console that commands print to."""

from __future__ import annotations

import sys

from rich.console import Console

_UNWRAPPED = 200


def console() -> Console:
    """Return a console as wide as the terminal, and wide enough for any line elsewhere."""
    width = None if sys.stdout.isatty() else _UNWRAPPED
    return Console(highlight=False, soft_wrap=True, width=width)
