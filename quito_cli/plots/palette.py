"""Colours, and text that is only text."""

from __future__ import annotations

from typing import Any

# Okabe and Ito's colours: told apart by colour-blind readers too.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
OURS, KNOWN, BOUND, JUNCTION = COLOURS[0], COLOURS[1], "#666666", COLOURS[2]
OBSTACLE: dict[str, Any] = {"facecolor": "#888888", "alpha": 0.25, "edgecolor": "#666666"}


def plain(text: str) -> str:
    """Return text that matplotlib does not take for mathematics."""
    return text.replace("$", r"\$")
