"""The keys a mapping of the problem file may have, and what a key that is none was meant to be.

Who comes from another program writes its words: `min`, `tf`, `objective`. They are held in one
table, by place; for all other words the nearest known key is suggested.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple, TypeVar, get_origin

from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import suggest

Path = tuple[str | int, ...]
Place = tuple[str, ...]
"""Keys down to a mapping of the file; a star stands for any name or place in a list."""
Row = TypeVar("Row")
_DERIVATIVE: Final = re.compile(
    r"d\(?(\w+?)\)?/dt|d/dt\(?(\w+?)\)?|(?:der|dot|diff|ddt|d)\((\w+?)(?:,t)?\)"
    r"|(\w+?)(?:_?dot|'|_prime|_t|\.)|d_?(\w+?)(?:_?dt)?"
)
"""The ways to write the derivative of a state in plain text."""


class Alias(NamedTuple):
    """What a foreign word is here: the key it stands for, where there is one, and what to say."""

    key: str = ""
    advice: str = ""

    def hint(self) -> str:
        """Return the end of a message about the word."""
        return f"; {self.advice or f'did you mean {self.key!r}?'}"


def _words(words: str, key: str = "", advice: str = "") -> dict[str, Alias]:
    return dict.fromkeys(words.split(), Alias(key, advice))


_BOUNDS: Final = {
    **_words("min minimum lb low", "lower"),
    **_words("max maximum ub high", "upper"),
    **_words("bounds bound range limits", advice="write `lower` and `upper`"),
}
_VARIABLE: Final = {
    **_BOUNDS,
    **_words("units", "unit"),
    **_words("initial_guess start_value", "guess"),
    **_words("dim dimension length", "size"),
    **_words("label name title", "description"),
}
_NO_ENDS: Final = "has no initial and final value: write `guess`, or bounds"
_ENDS: Final = "initial initial_value init final final_value start end"
_GOAL: Final = "what is minimised stands under `cost:`, as `lagrange` or `mayer`"
_EACH: Final = "to each state or control, such as"

ALIASES: Final[Mapping[Place, Mapping[str, Alias]]] = {
    (): {
        **_words("objective obj minimize minimise", "cost", _GOAL),
        **_words("maximize maximise", "cost", f"{_GOAL}, and `sense: maximize` turns it round"),
        **_words(
            "guess guesses initial_guess", advice=f"guesses belong {_EACH} x: {{guess: 1 - t}}"
        ),
        **_words("bounds bound", advice=f"bounds belong {_EACH} u: {{lower: -1, upper: 1}}"),
        **_words(
            "initial final initial_conditions boundary_conditions",
            advice="end values belong to each state, such as x: {initial: 0, final: 1}",
        ),
        **_words("obstacles", advice="an obstacle is a path constraint; `plots:` draws it"),
        **_words(
            "params",
            advice="numbers stand under `constants:`, unknowns that are found under `parameters:`",
        ),
        **_words("name", "title"),
        **_words("horizon", "time"),
        **_words("variables", "states"),
        **_words("inputs", "controls"),
        **_words("ode odes equations derivatives", "dynamics"),
        **_words("data", "tables"),
        **_words("N steps", advice="it belongs under `options:`, such as options: {steps: 100}"),
    },
    ("time",): {
        **_words("t0 start begin from", "initial"),
        **_words("tf T end stop to", "final"),
        **_words("N steps", advice="it belongs under `options:`, such as options: {steps: 100}"),
    },
    ("time", "*"): {**_BOUNDS, **_words("initial init", "guess")},
    ("states", "*"): {
        **_VARIABLE,
        **_words("start begin init x0 initial_value", "initial"),
        **_words("end end_value stop xf final_value terminal", "final"),
    },
    ("states", "*", "initial"): _BOUNDS,
    ("states", "*", "final"): _BOUNDS,
    ("controls", "*"): {**_VARIABLE, **_words(_ENDS, advice=f"a control {_NO_ENDS}")},
    ("parameters", "*"): {
        **_VARIABLE,
        **_words(_ENDS, advice=f"a parameter {_NO_ENDS}"),
        **_words("value", advice="a number that is known stands under `constants:`"),
    },
    ("tables", "*"): {
        **_words("t time times", "x", "the argument is called x"),
        **_words("values value", "y", "the values are called y"),
        **_words("kind type interpolation", "method"),
    },
    ("cost",): {
        **_words("integral integrand running running_cost stage path L l", "lagrange"),
        **_words("terminal terminal_cost final end endpoint phi M m", "mayer"),
    },
    ("constraints",): {
        **_words("state control mixed inequality inequalities", "path"),
        **_words("ends end endpoint terminal", "boundary"),
        **_words(
            "initial final",
            advice="end values belong to each state, such as x: {initial: 0, final: 1}; "
            "relations between them stand under `boundary`",
        ),
    },
    ("constraints", "point", "*"): {
        **_words("t time when", "at"),
        **_words("that constraint condition", "holds"),
    },
    ("plots", "*"): {**_words("lines paths trajectories", "curves")},
    ("reference",): {**_words("optimum value objective", "cost")},
    ("options",): {
        **_words("N n cells intervals nodes", "steps"),
        **_words("D", "variance"),
        **_words("grid refinement adaptive", "mesh"),
        **_words("mesh_tol refinement_tolerance", "mesh_tolerance"),
        **_words("mesh_iter max_mesh_iterations refinements", "mesh_iterations"),
        **_words("polished exact indirect", "polish"),
        **_words("order polynomial_degree collocation_points", "degree"),
        **_words("tol", "tolerance"),
        **_words("max_iter maxiter iterations", "max_iterations"),
        **_words("method scheme integrator", "discretization"),
        **_words("guess", advice="an earlier result is given beside the file: --guess RESULT.h5"),
    },
}
"""Words of other programs, by the place where they are written."""


def at_place(table: Mapping[Place, Row], path: Path) -> Row | None:
    """Return the row of a table that is kept by place; names count before stars."""
    for place, row in table.items():
        if len(place) == len(path) and all(
            step in ("*", str(given)) for step, given in zip(place, path, strict=True)
        ):
            return row
    return None


def known_keys(path: Path, root: Any = Problem) -> list[str]:
    """Return the keys that the mapping holding `path` may have, in a file of the model `root`."""
    model = root
    named = False  # the step before led to a mapping by name: this one is no key of ours
    for step in path[:-1]:
        if not named and isinstance(step, str) and step in model.model_fields:
            annotation = model.model_fields[step].annotation
            inner = _models_in(annotation)
            model = inner[0] if inner else model
            named = get_origin(annotation) is dict
        else:
            named = False
    return list(model.model_fields)


def _models_in(annotation: Any) -> list[Any]:
    """Return the pydantic models that a field's type speaks of, mappings of them included."""
    if hasattr(annotation, "model_fields"):
        return [annotation]
    found: list[Any] = []
    for argument in getattr(annotation, "__args__", ()):
        found += _models_in(argument)
    return found


def meant(path: Path, present: Iterable[str]) -> str | None:
    """Return the one key, not yet there, that an unknown key stands for or is near to."""
    there = set(present)
    alias = _alias(path)
    if alias:
        return alias.key if alias.key and alias.key not in there else None
    candidates = [key for key in known_keys(path) if key not in there]
    hint = suggest(str(path[-1]), candidates)
    return next((key for key in candidates if f"'{key}'" in hint), None)


def unknown_key(path: Path) -> str:
    """Return what is said of an unknown key."""
    alias, known = _alias(path), known_keys(path)
    hint = alias.hint() if alias else suggest(str(path[-1]), known)
    hint = hint or f"; known here: {', '.join(known)}"
    return f"unknown key '{path[-1]}'{hint}"


def _alias(path: Path) -> Alias | None:
    rows = at_place(ALIASES, path[:-1]) or {}
    return rows.get(str(path[-1]))


def derived_state(key: str, states: Iterable[str]) -> str | None:
    """Return the state whose derivative a key of the dynamics spells, as `xdot` does that of x."""
    found = _DERIVATIVE.fullmatch(key.replace(" ", ""))
    name = next((part for part in found.groups() if part), None) if found else None
    return name if name in set(states) else None


def option_hint(name: str, known: Iterable[str]) -> str:
    """Return the end of a message about an option of a call that there is none of."""
    alias = ALIASES[("options",)].get(name)
    return alias.hint() if alias and alias.key else suggest(name, known)
