"""An entry of a suite -> its cases: defaults laid under it, its matrix and its sweep spelled out.

Of an option or a constant that is said several times, the matrix and the sweep count, then the
entry, then the defaults of the suite. `null` takes an option or an expectation of the defaults
back.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

from pydantic import ValidationError

from quito_cli.batch.axes import Axis, Known
from quito_cli.batch.axes import axis as axis_of
from quito_cli.batch.case import Case, Expectation, Scalar
from quito_cli.batch.limits import Limits
from quito_cli.batch.schema_expect import Expect
from quito_cli.batch.schema_suite import MAX_CASES, Entry, Shared
from quito_cli.batch.sweep import points
from quito_cli.errors import UsageError
from quito_cli.problem.load import SETTABLE
from quito_cli.problem.options import FileOptions
from quito_cli.problem.text.complaints import Complaint, Path, suggest
from quito_cli.problem.wording import expected

OPTIONS = tuple(name for name in FileOptions.model_fields if name != "solver_options")
"""Options that may be axes of a matrix."""


@dataclass(frozen=True)
class Draft:
    """A case, what it may take, and where the suite asks for it."""

    case: Case
    limits: Limits
    place: Path


def expanded(
    name: str,
    problem: str,
    entry: Entry,
    defaults: Shared,
    place: Path,
    content: Mapping[str, Any] | None,
) -> tuple[Iterator[Draft], list[Complaint]]:
    """Return a case for every combination of an entry's matrix, and what is wrong with it.

    Args:
        name: of the case; those of a matrix add their place in it.
        problem: as `Case` has it.
        entry: of the suite.
        defaults: of the suite.
        place: of the entry in the file.
        content: data of the problem file; None where they cannot be read.
    """
    wrong = [*_wrong_axes(entry, place), *_wrong_names(entry, place, content)]
    over, wrong_over = _over(entry, place, content)
    wrong += [*wrong_over, *_too_many(entry, over, place)]
    limits = entry.limits.over(defaults.limits.over(Limits(None, None)))
    options = _options(defaults) | _options(entry)
    options = {key: value for key, value in options.items() if value is not None}
    constants = {**defaults.set, **entry.set}
    expectations = tuple(_expectations(defaults.expect, entry.expect))

    def cases() -> Iterator[Draft]:
        for axes, point in product(combinations(entry.matrix), points(over, warm=entry.warm)):
            chosen = {key: value for key, value in axes.items() if key in OPTIONS}
            others = {key: value for key, value in axes.items() if key not in chosen}
            before = None if point.before is None else name + in_brackets({**axes, **point.before})
            case = Case(
                name + in_brackets({**axes, **point.labels}),
                problem,
                options | chosen | point.options,
                constants | others | point.constants,
                expectations,
                axes | point.values,
                before,
            )
            yield Draft(case, limits, place)

    return cases(), wrong


def _too_many(entry: Entry, over: Sequence[Axis], place: Path) -> Iterator[Complaint]:
    """Yield a complaint where an entry comes to more cases than a suite may have."""
    count = prod([len(values) for values in entry.matrix.values()] + [len(a.values) for a in over])
    if count > MAX_CASES:
        what, key = ("this sweep", "over") if over else ("this matrix", "matrix")
        more = " and more" if len(over) < len(entry.over) else ""
        message = f"{what} has {count:,} combinations{more}, and {MAX_CASES:,} are the most"
        yield Complaint((*place, key), message, key=True)


def _over(
    entry: Entry, place: Path, content: Mapping[str, Any] | None
) -> tuple[tuple[Axis, ...], list[Complaint]]:
    """Return the axes of an entry's sweep, and what is wrong with them."""
    axes: list[Axis] = []
    wrong = []
    for key, values in entry.over.items():
        at = (*place, "over", key)
        try:
            if key in entry.matrix:
                raise UsageError(f"{key} is in the matrix, too: say it in one of the two")
            if content is not None:  # what cannot be read is refused when it is solved
                axes.append(axis_of(key, values, _known(content)))
        except UsageError as error:
            wrong.append(Complaint(at, str(error), length=len(key), key=True))
        if prod(len(axis.values) for axis in axes) > MAX_CASES:
            break  # that is told, and the other axes would take their time
    if entry.warm and not entry.over:
        message = "continuation goes along the axes of a sweep: add `over`"
        wrong.append(Complaint((*place, "warm"), message, length=len("warm"), key=True))
    return tuple(axes), wrong


def _known(content: Mapping[str, Any]) -> Known:
    """Return what there is to go over in the data of a problem file."""

    def names(section: str) -> tuple[str, ...]:
        found = content.get(section)
        return tuple(map(str, found)) if isinstance(found, dict) else ()

    variables = {section: names(section) for section in ("states", "controls", "parameters")}
    return Known(names("constants"), variables, FileOptions)


def combinations(matrix: Mapping[str, Sequence[Scalar]]) -> Iterator[dict[str, Scalar]]:
    """Yield every combination of the values of several axes, the last one changing first."""
    for values in product(*matrix.values()):
        yield dict(zip(matrix, values, strict=True))


def in_brackets(axes: Mapping[str, Scalar]) -> str:
    """Return a place in a matrix, as a part of the name of a case: `[steps=50,mu=0.1]`."""
    if not axes:
        return ""
    return f"[{','.join(f'{key}={_short(value)}' for key, value in axes.items())}]"


def _short(value: Scalar) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def _options(shared: Shared) -> dict[str, Any]:
    return shared.options.model_dump(exclude_unset=True)


def _expectations(defaults: Expect, own: Expect) -> Iterator[Expectation]:
    said = {
        key: getattr(one, key) for one in (defaults, own) for key in sorted(one.model_fields_set)
    }
    yield from Expect.model_construct(**said).expectations()


def _wrong_axes(entry: Entry, place: Path) -> Iterator[Complaint]:
    """Yield what is wrong with the values of axes that are options."""
    for axis, values in entry.matrix.items():
        seen = set()
        for i, value in enumerate(values):
            at = (*place, "matrix", axis, i)
            if value in seen:
                yield Complaint(at, f"{axis} takes this value already")
            seen.add(value)
            if axis in OPTIONS:
                try:
                    FileOptions.model_validate({axis: value})
                except ValidationError as error:
                    yield Complaint(at, expected(error.errors()[0], ("options", axis)))


def _wrong_names(
    entry: Entry, place: Path, content: Mapping[str, Any] | None
) -> Iterator[Complaint]:
    """Yield names that the problem has no constant of, nor a solve an option."""
    if content is None:
        return
    there = content.get("constants")
    constants = list(there) if isinstance(there, dict) else []
    for section in ("set", "matrix"):
        for key in getattr(entry, section):
            at = (*place, section, key)
            if key in constants or (section == "matrix" and key in OPTIONS):
                continue
            if "." in key and key.split(".")[0] in SETTABLE:
                continue
            known = [*constants, *(OPTIONS if section == "matrix" else ())]
            hint = suggest(key, known)
            if section == "set" and key in OPTIONS:
                hint = "; that is an option: it belongs under `options:`"
            what = "constant" if section == "set" else "constant or option"
            paths = "; other values are set by their path, such as states.x1.upper"
            message = f"the problem has no {what} {key!r}{hint or paths}"
            yield Complaint(at, message, length=len(key), key=True)
