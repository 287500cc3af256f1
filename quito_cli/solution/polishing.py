"""What a polish did: step by step what was assumed, inserted and dropped, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

Action = Literal[
    "assume", "solve", "drop", "insert", "release", "refine", "check", "accept", "refuse"
]


class PolishStatus(Enum):
    """How a polish ended; the values are sentences."""

    POLISHED = "Pontryagin's conditions are solved with this structure, and every sign holds."
    NO_ANSWER = "There is no answer to polish."
    NOT_DERIVED = "Pontryagin's system of this problem cannot be derived."
    UNSUPPORTED = "The structure has arcs that cannot be polished."
    DEGENERATE = "The conditions do not determine the structure: it is degenerate."
    NOT_CONVERGED = "No extremal of this structure was found."
    REFUSED = "An extremal was found that violates a condition."
    NO_BETTER = "The certificate would not improve."
    INTERRUPTED = "The polish was interrupted."


@dataclass(frozen=True)
class PolishStep:
    """One step, for a reader."""

    action: Action
    sentence: str
    """What was done, and why: `u: lower until 1.3667, singular from there on`."""
    residuals: tuple[float, ...] = ()
    """Of a solve: norm of the scaled residuals before each Newton step, and after the last."""


@dataclass(frozen=True)
class Polishing:
    """The account of a polish."""

    status: PolishStatus
    reason: str
    """Of what did not come to an end: which condition refuses, where, by how much. Empty where it
    did."""
    steps: tuple[PolishStep, ...]
    residual: float
    """Norm of the scaled residuals at the end; NaN where none was solved."""
    seconds: float
    cost_before: float
    """Of the direct answer, in the file's sense."""
    segments: int
    """Of the polished answer; 0 where there is none."""
    newton_steps: int
    """In all."""

    @property
    def polished(self) -> bool:
        """Whether the answer is the polished one; else the direct answer stands."""
        return self.status is PolishStatus.POLISHED

    @property
    def interrupted(self) -> bool:
        """Whether the user stopped it."""
        return self.status is PolishStatus.INTERRUPTED

    @property
    def outcome(self) -> str:
        """How it ended, and of what did not come to an end, why; without the full stop."""
        said = self.status.value.removesuffix(".")
        return f"{said}: {self.reason.removesuffix('.')}" if self.reason else said

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of an answer must know that was to be polished and is not."""
        if self.polished:
            return ()
        return (f"the answer is not polished, the direct one stands: {self.outcome}",)
