"""What is written instead of what other programs call a function, a unit or a number.

The parser knows no names, so that it says what a mistake is `About`; whoever knows what is declared
where can then say more: see `advice`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from quito_cli.problem.language.functions import FUNCTIONS

_RENAMED: Final = {
    **{f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "tan2")},
    "ln": "log",
    "tg": "tan",
    "sgn": "sign",
    "signum": "sign",
    "fabs": "abs",
    "Abs": "abs",
    "maximum": "max",
    "fmax": "max",
    "minimum": "min",
    "fmin": "min",
    "interp": "interpolate",
    "interp1": "interpolate",
    "interp1d": "interpolate",
    "lookup": "interpolate",
}
_DIFFERENT: Final = {
    **dict.fromkeys(("heaviside", "Heaviside", "step", "unitstep"), "if_else({a} >= 0, 1, 0)"),
    **dict.fromkeys(("where", "piecewise", "ifelse", "if_then_else"), "if_else(condition, a, b)"),
    **dict.fromkeys(("deg2rad", "radians"), "{b}*pi/180"),
    **dict.fromkeys(("rad2deg", "degrees"), "{b}*180/pi"),
    **dict.fromkeys(("pow", "power"), "a^b"),
    **dict.fromkeys(("clip", "clamp", "saturate", "sat"), "min(max({a}, low), high)"),
    "log10": "log({a})/log(10)",
    "log2": "log({a})/log(2)",
    "sind": "sin({b}*pi/180)",
    "cosd": "cos({b}*pi/180)",
    "tand": "tan({b}*pi/180)",
    "cot": "1/tan({a})",
    "sec": "1/cos({a})",
    "csc": "1/sin({a})",
    "hypot": "sqrt(a^2 + b^2)",
    "square": "{b}^2",
    "cbrt": "{b}^(1/3)",
}
_EXPLAINED: Final = {
    **dict.fromkeys(
        ("integral", "integrate", "int", "quad"),
        ": `lagrange` and the constraints of kind `integral` are integrated as they stand",
    ),
    **dict.fromkeys(
        ("der", "diff", "ddt", "derivative"),
        ": a derivative is written out; give it a name under `expressions:`",
    ),
    **dict.fromkeys(
        ("floor", "ceil", "round", "mod"),
        ": there is no rounding, for an optimiser needs what is smooth",
    ),
}
_MODULES: Final = frozenset(
    {"np", "numpy", "math", "ca", "cs", "casadi", "sp", "sympy", "torch", "jnp", "Math"}
)
_DEGREES: Final = frozenset({"deg", "degree", "degrees"})
_INFINITE: Final = ("inf", "Inf", "infinity")
_ALSO_INFINITE: Final = frozenset({"oo", "infty", "Infinity", "INF"})
_FREE: Final = frozenset({"free", "none", "None", "any", "open", "unbounded"})
_FINAL_TIME: Final = frozenset(
    {"tf", "t_f", "tF", "T", "tend", "t_end", "end", "tfinal", "t_final"}
)
_INITIAL_TIME: Final = frozenset({"t0", "t_0", "tstart", "t_start", "start"})
_END_OF: Final = re.compile(r"(\w+?)_?(?:(f|final|end)|(0|i|initial|start))")
_LONGEST: Final = 20  # characters of an argument that is repeated in a message

IN_A_FORMULA: Final = "infinity has no place in a formula: write a large number, such as 1e3"
DOTTED_INFINITY: Final = (
    "infinity stands alone, and only in bounds: write a large number instead, such as 1e3"
)
LISTED: Final = "; README.md lists the functions, under Expressions"


@dataclass(frozen=True)
class About:
    """What a mistake is about: a `call` of no function, an unknown `name`, or a `unit`."""

    kind: str
    name: str
    beside: str = ""
    """The argument of the call, or the number before the unit."""


@dataclass(frozen=True)
class Place:
    """What is known where a formula stands."""

    declared: Mapping[str, str]
    """Every name of the file, and what it is: a `state`, a `table`."""
    ends: bool
    """initial() and final() have a meaning here."""
    key: str
    """The key of a bound or an end value; `time` for an end of the horizon; or nothing."""


def function_hint(name: str, argument: str) -> str:
    """Return the end of a message about a function that goes by another name here, or nothing."""
    if name in _RENAMED:
        return f"; write {_RENAMED[name]}(...)"
    if name in _DIFFERENT:
        short = argument if 0 < len(argument) <= _LONGEST else "..."
        atom = short if short.replace(".", "").isalnum() else f"({short})"
        return f"; write {_DIFFERENT[name].format(a=short, b=atom)}"
    return _EXPLAINED.get(name, "")


def attribute_message(module: str, name: str) -> str | None:
    """Say what `np.sin` is here; None where the name before the dot is no module of functions."""
    if module not in _MODULES:
        return None
    known = _RENAMED.get(name, name)
    called = f"{known}(...)" if known in FUNCTIONS else known
    return f"names have no attributes here: write {called} without '{module}.'"


def infinity(tree: ast.expr, alone: str) -> dict[str, str]:
    """Return what is said of infinity in a formula, which may be nothing else than that."""
    while isinstance(tree, ast.UnaryOp):
        tree = tree.operand
    return dict.fromkeys(_INFINITE, alone if isinstance(tree, ast.Name) else IN_A_FORMULA)


def degrees(number: str) -> str:
    """Say how an angle in degrees is written."""
    return f"angles are in radians: write {number or '...'}*pi/180"


def advice(about: About, place: Place) -> str | None:
    """Return a message that knows what is declared, or None where the parser's is as good."""
    return {"call": _call, "name": _name, "unit": _unit}[about.kind](about, place)


def _call(about: About, place: Place) -> str | None:
    name, argument, kind = about.name, about.beside, place.declared.get(about.name)
    if kind is None:
        return None
    if kind == "table":
        told = argument if len(argument) <= _LONGEST else "..."
        return f"'{name}' is a table: write interpolate({told}, {name})"
    if kind in ("constant", "parameter") or not _is_a_time(argument, place):
        remedy = f"; write {name}*(...) for a product"
    elif place.ends and kind == "control":
        remedy = ", and it has no value at a single time"
    elif place.ends:
        remedy = f": write {_end_value(name, argument)}"
    elif argument == "t":
        remedy = f": {name} alone is its value at the time t"
    else:
        at = "..." if argument in _FINAL_TIME | _INITIAL_TIME else argument
        remedy = f": for one time write a point constraint, {{at: {at}, holds: {name} <= 1}}"
        remedy += ", for an end `initial` or `final`" if kind == "state" else ""
    article = "an" if kind[0] in "aeiou" else "a"
    return f"'{name}' is {article} {kind}, not a function{remedy}"


def _end_value(name: str, argument: str) -> str:
    """Return how the value at an end is written, or at either where that cannot be told."""
    if argument in _FINAL_TIME:
        return f"final({name})"
    if argument in _INITIAL_TIME or not argument.strip("0."):
        return f"initial({name})"
    return f"initial({name}) or final({name})"


def _is_a_time(argument: str, place: Place) -> bool:
    """Whether an argument looks like an instant: a number, or the name of an end."""
    if argument in _FINAL_TIME or argument in _INITIAL_TIME or argument == "t":
        return True
    return argument.replace(".", "").isdigit() or place.declared.get(argument) == "constant"


def _name(about: About, place: Place) -> str | None:
    name = about.name
    if name in _ALSO_INFINITE:
        return "infinity is written .inf or -.inf" if place.key else DOTTED_INFINITY
    remedy = ""
    if name == "e":
        remedy = "a power of e is written exp(x)"
    elif place.key == "time" and (name in _FREE or name in _FINAL_TIME):
        remedy = "a time that is free is written {lower: 0.1, upper: 10}"
    elif place.key and name in _FREE:
        remedy = f"where it is free, leave `{place.key}` out"
    elif place.ends:
        remedy = _end_named(name, place)
    return f"unknown name '{name}'; {remedy}" if remedy else None


def _end_named(name: str, place: Place) -> str:
    """Return what an end has been called by a name of its own, such as tf or xf, or nothing."""
    if name in _FINAL_TIME or name in _INITIAL_TIME:
        return f"write {'final' if name in _FINAL_TIME else 'initial'}(t)"
    found = _END_OF.fullmatch(name)
    if found and place.declared.get(found[1]) == "state":
        return f"write {'final' if found[2] else 'initial'}({found[1]})"
    return ""


def _unit(about: About, place: Place) -> str | None:
    if about.name in place.declared or about.name in ("t", "pi") or about.name in FUNCTIONS:
        return None
    if about.name in _DEGREES:
        return degrees(about.beside)
    return (
        f"numbers have no units here: put '{about.name}' into `unit:` or a comment, "
        f"or write {about.beside}*{about.name} for a product"
    )
