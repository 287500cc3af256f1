"""What a plot of the file's own shows: curves, and shapes that stand for obstacles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True)
class Ball:
    """A circle in a plane, a sphere in space."""

    centre: tuple[float, ...]
    radius: float


@dataclass(frozen=True)
class Block:
    """A rectangle in a plane, a box in space."""

    centre: tuple[float, ...]
    half: tuple[float, ...]
    """Half the length of its edges."""


@dataclass(frozen=True, eq=False)
class View:
    """A plot that the file asks for: quantities against each other, among obstacles."""

    name: str
    title: str
    labels: tuple[str, ...]
    """Of its two or three axes."""
    curves: dict[str, ca.Function]
    """By name for the legend: (x, u, p, t) ↦ coordinates."""
    balls: tuple[Ball, ...]
    blocks: tuple[Block, ...]
