"""What a row of the table of solvers says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from quito_cli.solvers.outcome import Status


@dataclass(frozen=True)
class Backend:
    """A row of the table."""

    name: str
    title: str
    takes: Literal["NLP", "QP"]
    engine: Literal["nlpsol", "conic", "scipy"]
    plugin: str
    """Its name to the engine."""
    algebra: str
    """Its linear algebra."""
    provides: str
    """What provides it where it is missing."""
    accuracy: float = 0.0
    """The residual it attains: it is asked for no less, and judged at no less."""
    sharper: float = 1.0
    """What its tolerance is of ours, where its measure is the milder one."""
    group: str | None = None
    """The option under which its own options stand; None where they are the plug-in's."""
    tolerances: tuple[str, ...] = ()
    """Its options that are the tolerance."""
    iterations: str | None = None
    """Its option that is the iteration limit."""
    outside: tuple[str, ...] = ()
    """Those of the last two that stand beside the group, among the plug-in's."""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    """Options of its own that are always set: quiet, exact, no early stop."""
    plugin_options: Mapping[str, Any] = field(default_factory=dict)
    """Options of the plug-in around it that are always set."""
    known: tuple[str, ...] = ()
    """Its options, where it takes any name without a word."""
    derivatives: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Its functions of derivatives and what each returns: see `Program.derivatives`."""
    statuses: Mapping[str, Status] = field(default_factory=dict)
    """Its words; what is not here is taken from CasADi's four kinds of ending."""
    counters: tuple[str, ...] = ("iter_count",)
    """Statistics whose sum is the number of iterations."""
    callback: bool = False
    """Whether it tells of its iterations, and stops when asked to."""
    warm: Mapping[str, Any] | None = None
    """Options of its own for a warm start; None where it does not take multipliers."""
    only_free: bool = False
    """Whether fixed unknowns are taken out of its program."""
    isolated: bool = False
    """Whether it runs in a process of its own: it can take one down, or prints past Python."""
    most_unknowns: int | None = None
    """The largest program that it is worth asking with."""


WITH_CASADI = "CasADi's wheel (pip install casadi)"
QRQP_QUIET = {"print_iter": False, "print_header": False, "print_info": False}
