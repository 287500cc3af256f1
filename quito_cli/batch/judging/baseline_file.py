"""Baseline <-> YAML that reads well in a pull request: sorted, a figure a line, read strictly.

    format: 1
    tolerances:
      cost: {absolute: 1.0e-09, relative: 1.0e-06}
      solve_time: ignore
    exceptions:
      "van_der_pol[steps=50]":
        iterations: {absolute: 10, relative: 0}
    cases:
      bang_bang:
        cost: 1
        iterations: 12

The same baseline is the same text. Comments of a person's are not kept; that is said on top.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from quito_cli.batch.judging.baseline import Baseline, Figures, Tolerances
from quito_cli.batch.judging.rules import RULES, Tolerance
from quito_cli.batch.suite.case import Figure
from quito_cli.errors import UsageError
from quito_cli.problem.text.complaints import Complaint, ProblemError, suggest
from quito_cli.problem.text.complaints import Path as Place
from quito_cli.problem.text.source import Source
from quito_cli.problem.text.strict_yaml import read as read_yaml
from quito_cli.solution.store import write_content

FORMAT: Final = 1
IGNORE: Final = "ignore"
"""In the place of a tolerance: the figure is not looked at."""
_SECTIONS: Final = ("format", "tolerances", "exceptions", "cases")
_LONGEST_NAME: Final = 1000
"""Characters of a key that YAML reads on one line."""
_WHOLE: Final = 1e15
"""Below this a whole number is written without its point."""
_PLAIN: Final = re.compile(r"[A-Za-z][A-Za-z0-9_./-]*")
_WORDS: Final = ("null", "true", "false", "yes", "no", "on", "off", "y", "n")
"""That are no text to one YAML or another."""
_HEADER: Final = """\
# Baseline of `quito batch`: the figures of a run, which later runs are held against.
# `--update-baseline` writes the cases; tolerances and exceptions are for people to change. A
# figure is the same within the larger of absolute and relative tolerance; `ignore` leaves it out.
# Times are in calibration solves. Comments are not kept.
"""


def read(path: Path) -> Baseline:
    """Read a baseline.

    Raises:
        UsageError: there is no such file, or it is no text.
        ProblemError: it has mistakes; all of them are told.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise UsageError(f"{path} is not text in UTF-8; is it a baseline?") from None
    except FileNotFoundError:
        raise UsageError(
            f"there is no baseline {path}: --update-baseline makes one of this run"
        ) from None
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from None
    return parse(text, str(path))


def parse(text: str, name: str) -> Baseline:
    """Return the baseline in a text; `name` stands in messages.

    Raises:
        ProblemError: it has mistakes; all of them are told.
    """
    source = read_yaml(text, name)
    reader = _Reader(source)
    baseline = reader.baseline()
    if reader.complaints:
        raise ProblemError(reader.complaints, source)
    return baseline


class _Reader:
    """One pass over the data of a file, which notes every mistake."""

    def __init__(self, source: Source) -> None:
        self.data = source.data
        self.complaints: list[Complaint] = []

    def baseline(self) -> Baseline:
        for key in self.data:
            if key not in _SECTIONS:
                what = f"there is no section '{key}'{suggest(key, _SECTIONS)}"
                self.complain((key,), what, key=True)
        version = self.data.get("format")
        if "format" not in self.data:
            self.complain((), f"no baseline: the line `format: {FORMAT}` is missing")
        elif version != FORMAT or isinstance(version, bool):
            what = f"format {version} is unknown; this quito reads {FORMAT}"
            self.complain(("format",), what)
        cases = self.mapping(("cases",))
        exceptions = self.mapping(("exceptions",))
        for name in exceptions.keys() - cases.keys():
            what = f"there is no case '{name}'{suggest(name, cases)}"
            self.complain(("exceptions", name), what, key=True)
        return Baseline(
            {name: self.figures(("cases", name)) for name in cases},
            self.tolerances(("tolerances",)),
            {name: self.tolerances(("exceptions", name)) for name in exceptions},
        )

    def complain(self, place: Place, message: str, *, key: bool = False) -> None:
        length = len(str(place[-1])) if key else 1
        self.complaints.append(Complaint(place, message, key=key, length=length))

    def mapping(self, place: Place) -> dict[str, Any]:
        """Return the mapping at a place, empty where there is none."""
        value: Any = self.data
        for step in place:
            value = value.get(step)
        if isinstance(value, dict):
            return value
        if value is not None:
            self.complain(place, "expected names with what is meant for each, `name: value` lines")
        return {}

    def by_figure(self, place: Place) -> Iterator[tuple[str, Any, Place]]:
        """Yield what is said of each figure at a place; complain of those that do not exist."""
        for name, value in self.mapping(place).items():
            if name in RULES:
                yield name, value, (*place, name)
            else:
                what = f"there is no figure '{name}'{suggest(name, RULES)}"
                self.complain((*place, name), what, key=True)

    def figures(self, place: Place) -> Figures:
        found: dict[str, Figure] = {}
        for name, value, where in self.by_figure(place):
            if isinstance(value, list):
                wrong = [i for i, entry in enumerate(value) if not _is_number(entry)]
                for i in wrong:
                    self.complain((*where, i), "expected a number")
                found[name] = () if wrong else tuple(float(entry) for entry in value)
            elif isinstance(value, dict) or value is None:
                self.complain(where, "expected a number, a word or a list of numbers")
            else:
                found[name] = value
        return found

    def tolerances(self, place: Place) -> Tolerances:
        found: dict[str, Tolerance | None] = {}
        for name, value, where in self.by_figure(place):
            if value == IGNORE:
                found[name] = None
            elif isinstance(value, dict) and value:
                found[name] = self.tolerance(value, where)
            else:
                what = f"expected {{absolute: 1e-6, relative: 0.1}}, one of them, or {IGNORE}"
                self.complain(where, what)
        return found

    def tolerance(self, value: dict[str, Any], place: Place) -> Tolerance:
        amounts = {"absolute": 0.0, "relative": 0.0}
        for key, amount in value.items():
            if key not in amounts:
                what = f"expected absolute or relative{suggest(key, amounts)}"
                self.complain((*place, key), what, key=True)
            elif not _is_number(amount) or not amount >= 0:
                self.complain((*place, key), "expected a number of zero or more")
            else:
                amounts[key] = float(amount)
        return Tolerance(**amounts)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def write(baseline: Baseline, path: Path) -> None:
    """Write a baseline; an older one of that name is replaced only when all is written.

    Raises:
        ResultFileError: the file cannot be written.
        UsageError: a name is too long for a line of YAML.
    """
    write_content(path, text(baseline))


def text(baseline: Baseline) -> str:
    """Return the text of a baseline.

    Raises:
        UsageError: a name is too long for a line of YAML.
    """
    lines = [_HEADER + f"format: {FORMAT}", "tolerances:"]
    lines += _lines(baseline.tolerances, "  ")
    if baseline.exceptions:
        lines.append("exceptions:")
        lines += _sections(baseline.exceptions)
    lines.append("cases:")
    lines += _sections(baseline.cases)
    return "\n".join(lines) + "\n"


def _sections(sections: Mapping[str, Mapping[str, Figure | Tolerance]]) -> Iterator[str]:
    for name in sorted(sections):
        if len(_quoted(name)) > _LONGEST_NAME:
            raise UsageError(
                f"the name of the case {name[:40]}... is too long for a baseline: "
                f"{_LONGEST_NAME} characters at most"
            )
        yield f"  {_quoted(name)}:"
        yield from _lines(sections[name], "    ")


def _lines(values: Mapping[str, Figure | Tolerance], indent: str) -> Iterator[str]:
    for name in sorted(values):
        yield f"{indent}{name}: {_value(values[name])}"


def _value(value: Figure | Tolerance) -> str:
    if value is None:
        return IGNORE
    if isinstance(value, Tolerance):
        return f"{{absolute: {_number(value.absolute)}, relative: {_number(value.relative)}}}"
    if isinstance(value, tuple):
        return f"[{', '.join(map(_number, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return _quoted(value) if isinstance(value, str) else _number(value)


def _number(value: float) -> str:
    """Return a number as YAML reads it, in both of its versions."""
    if isinstance(value, float) and value.is_integer() and abs(value) < _WHOLE:
        value = int(value)
    written = repr(value).replace("inf", ".inf")
    mantissa, power, exponent = written.partition("e")
    return f"{mantissa}{'' if '.' in mantissa or not power else '.0'}{power}{exponent}"


def _quoted(name: str) -> str:
    """Return text as YAML: plain where it is a word, else in double quotes.

    In these, what YAML does not read as it stands is written by its number.
    """
    if _PLAIN.fullmatch(name) and name.lower() not in _WORDS:
        return name
    escaped = (
        character
        if character.isprintable() and character not in '"\\'
        else f"\\U{ord(character):08X}"
        for character in name
    )
    return f'"{"".join(escaped)}"'
