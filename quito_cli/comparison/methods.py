"""The methods that ours is compared with: a name is a row of options for a solve.

What a row does not say is as in ours: the number of cells, the tolerance, the solver, and for
methods of the same kind the variance and the integrator. Where a method counts otherwise, it gets
as many points of the control as ours has cells.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, get_args

from quito_cli.errors import UsageError
from quito_cli.options import QUASI_INTERPOLANT_ONLY, Options
from quito_cli.problem.options import GeneratingFunctionName
from quito_cli.problem.text.complaints import suggest

Settings = Mapping[str, Any]
"""Resolved options of our solve."""

SELF: Final = "self"
"""Asks for a finer solve as the truth; no method."""
_OF_ANY: Final = ("tolerance", "max_iterations", "solver", "solver_options", "objective_scale")
"""Options of ours that every method takes over."""
_OF_SHOOTING: Final = (*_OF_ANY, "steps", "discretization", "substeps", "path_points")
_CLASSICAL: Final[Mapping[str, Settings]] = {
    "hermite-simpson": {
        "discretization": "hermite-simpson",
        "control": "piecewise-linear",
        "substeps": 1,
    },
    "piecewise-constant": {"control": "piecewise-constant"},
}
_ADAPTIVE: Final = "adaptive"
_POLISHED: Final = "polished"
_LGR_DEGREE: Final = 4
_LGR = re.compile(r"lgr:(?P<intervals>[1-9][0-9]{0,6})x(?P<degree>[1-9][0-9]{0,3})")
_QUASI_INTERPOLANT: Final = "quasi-interpolant:"


@dataclass(frozen=True)
class Method:
    """A way to solve the problem."""

    name: str
    """As it was asked for."""
    options: Callable[[Settings], dict[str, Any]]
    """Options of our solve ↦ options of this one."""


METHODS: Final = (
    "lgr",
    "lgr:KxD",
    _ADAPTIVE,
    _POLISHED,
    "hermite-simpson",
    "piecewise-constant",
    *get_args(GeneratingFunctionName),
)
"""What may be asked for. `quasi-interpolant:` may stand before a generating function."""


def parse(asked: Iterable[str]) -> tuple[tuple[Method, ...], bool]:
    """Return the methods of texts such as "lgr, gaussian", each once, and whether `self` is asked.

    Raises:
        UsageError: there is no such method; the message lists them.
    """
    found: dict[str, Method] = {}
    against_self = False
    for name in (part.strip() for text in asked for part in text.split(",")):
        if name == SELF:
            against_self = True
        elif name:
            found.setdefault(plain_name(name), method(name))
    return tuple(found.values()), against_self


def plain_name(name: str) -> str:
    """Return the name that a row of ours would have."""
    return f"{_QUASI_INTERPOLANT}{name}" if name in get_args(GeneratingFunctionName) else name


def method(name: str) -> Method:
    """Return the method of that name.

    Raises:
        UsageError: there is none; the message lists them.
    """
    function = name.removeprefix(_QUASI_INTERPOLANT)
    if function in get_args(GeneratingFunctionName):
        own = {"control": "quasi-interpolant", "generating_function": function}
        return Method(name, lambda ours: _shooting(ours, (*_OF_SHOOTING, "variance")) | own)
    if name in (_ADAPTIVE, _POLISHED):
        names = tuple(set(_OF_SHOOTING) - {"steps"}) + QUASI_INTERPOLANT_ONLY
        meshed: Settings = {"mesh": "adaptive", "polish": name == _POLISHED}
        return Method(name, lambda ours: _shooting(ours, names) | dict(meshed))
    if name == "lgr":
        share = _LGR_DEGREE
        return Method(name, lambda ours: _lgr(ours, control_points(ours) // share, share))
    if match := _LGR.fullmatch(name):
        intervals, degree = int(match["intervals"]), int(match["degree"])
        return Method(name, lambda ours: _lgr(ours, intervals, degree))
    if name in _CLASSICAL:
        classical = _CLASSICAL[name]
        return Method(name, lambda ours: _shooting(ours, _OF_SHOOTING) | dict(classical))
    known = list(METHODS)
    raise UsageError(
        f"there is no method '{name}'{suggest(name, [*known, SELF])}; there are "
        f"{', '.join(known)}; and {SELF}, a finer solve as the truth"
    )


def control_points(ours: Settings) -> int:
    """Return how many points the control of a solve with these options has: N, for shooting."""
    cells, degree = int(ours["steps"]), ours.get("degree")
    return cells * int(degree) if ours["discretization"] == "lgr" and degree else cells


def again(ours: Settings) -> dict[str, Any]:
    """Return the options of a solve like ours, to be asked for by name.

    Of a polished answer that is polished too: what is not would be no truth to hold it against.
    """
    polish = {"polish": bool(ours.get("polish"))}
    if ours["discretization"] == "lgr":
        return _lgr(ours, int(ours["steps"]), int(ours["degree"])) | polish
    own = QUASI_INTERPOLANT_ONLY if ours["control"] == "quasi-interpolant" else ()
    return _like(ours, (*_OF_SHOOTING, "control", *own)) | polish


def name_of(ours: Settings) -> str:
    """Return what a solve with these options is called in a table."""
    if ours.get("polish"):
        return _POLISHED
    if ours["discretization"] == "lgr":
        return f"lgr:{ours['steps']}x{ours['degree']}"
    if ours.get("mesh") == "adaptive" and ours["control"] == "quasi-interpolant":
        return _ADAPTIVE
    if ours["control"] == "quasi-interpolant":
        printed = "" if ours["normalised"] else ", as printed"
        return f"{_QUASI_INTERPOLANT}{ours['generating_function']}{printed}"
    if ours["control"] == "piecewise-linear" and ours["discretization"] == "hermite-simpson":
        return "hermite-simpson"
    return str(ours["control"])


def _lgr(ours: Settings, intervals: int, degree: int) -> dict[str, Any]:
    own = {"discretization": "lgr", "steps": max(1, intervals), "degree": degree}
    return _like(ours, _OF_ANY) | own


def _shooting(ours: Settings, names: tuple[str, ...]) -> dict[str, Any]:
    """Return those of our options that hold for shooting, the integrator's by default of lgr."""
    if ours["discretization"] != "lgr":
        return _like(ours, names)
    steps = {"steps": control_points(ours), "discretization": Options.discretization}
    return _like(ours, tuple(set(names) & {*_OF_ANY, "variance"})) | steps


def _like(ours: Settings, names: tuple[str, ...]) -> dict[str, Any]:
    """Return those of our options, where they say something, for equal cells."""
    said = {name: ours[name] for name in names if ours.get(name) not in (None, {})}
    return said | {"mesh": "uniform", "polish": False}
