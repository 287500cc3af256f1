"""What a search is made of: attempts at structures, what they came to, and what is known."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from quito_cli.optimality.polish.equations.structure import Phase, Structure
from quito_cli.optimality.polish.faults.dense import Dense
from quito_cli.optimality.polish.reading.direct import Direct
from quito_cli.optimality.polish.reading.told import told
from quito_cli.optimality.polish.solving.newton import Solved
from quito_cli.solution.polishing import Action, PolishStatus, PolishStep


@dataclass
class Log:
    """What was done so far."""

    steps: list[PolishStep] = field(default_factory=list)

    def tell(self, action: Action, sentence: str, residuals: tuple[float, ...] = ()) -> None:
        """Add a step."""
        self.steps.append(PolishStep(action, sentence, residuals))

    @property
    def newton(self) -> int:
        """Newton steps in all."""
        return sum(max(len(step.residuals) - 1, 0) for step in self.steps)


@dataclass(frozen=True, eq=False)
class Ending:
    """How a search ended, and with what."""

    status: PolishStatus
    reason: str = ""
    """Why there is no extremal; empty where there is one."""
    extremal: Dense | None = None
    residual: float = np.nan
    """To which the equations of the extremal hold."""

    @property
    def settles(self) -> bool:
        """Whether nothing else is to be tried."""
        return self.status in (PolishStatus.POLISHED, PolishStatus.DEGENERATE)


@dataclass(frozen=True, eq=False)
class Attempt:
    """A structure solved, as far as it could be."""

    dense: Dense
    solved: Solved

    @property
    def structure(self) -> Structure:
        """The structure at the times that were found."""
        return self.dense.system.structure.at(self.dense.times)


@dataclass(frozen=True, eq=False)
class Following:
    """What to try next."""

    structure: Structure
    reason: str
    """What spoke against the structure before it."""
    start: Attempt | None
    """What to start it from; None is what the one before it was started from."""


@dataclass(eq=False)
class Going:
    """What is known while searching."""

    direct: Direct
    log: Log
    deadline: float
    """By `time.thread_time`: what else the machine does takes nothing from the search."""
    known: set[tuple[Phase, ...]] = field(default_factory=set)
    """Structures that were tried."""
    others: list[tuple[Structure, Attempt | None]] = field(default_factory=list)
    """Structures to try where all else fails, with what to start them from."""

    @property
    def late(self) -> bool:
        """Whether it has taken as long as it may."""
        return time.thread_time() > self.deadline

    def assume(self, structure: Structure) -> None:
        """Say what is tried."""
        self.log.tell("assume", told(self.direct.setting, structure))
