"""A sweep: one problem solved at every point of a grid, and what became of it.

The grid has all combinations of the values of its axes; its cases stand in the order of their
names, the last axis running fastest. By continuation each solve starts from the answer of a
neighbour: its place on the last axis on which it is not at the first value, one back. So the first
row along each axis is a chain, from which chains along the next one branch off: they can be solved
side by side, and what a case starts from does not depend on how many are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.batch.judging.figures import FIGURES
from quito_cli.batch.suite.axes import Axis
from quito_cli.batch.suite.case import Case, Ending, Figure, Finished, Scalar
from quito_cli.errors import UsageError
from quito_cli.options import Options
from quito_cli.problem.load import changed
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import ProblemError

Array = NDArray[np.float64]
ANSWERED = (Ending.PASSED, Ending.OUTSIDE)
"""Endings of a case with an answer."""


@dataclass(frozen=True)
class Sweep:
    """The cases of a sweep."""

    name: str
    """Of the problem."""
    title: str
    text: str
    """The problem's YAML text."""
    axes: tuple[Axis, ...]
    cases: tuple[Case, ...]
    """The last axis runs fastest."""
    options: Mapping[str, Any]
    """As given, for all cases."""
    constants: Mapping[str, Scalar]
    """Set for all cases."""
    warm: bool
    """Whether each solve starts from its neighbour."""

    @property
    def shape(self) -> tuple[int, ...]:
        """How many values each axis has."""
        return tuple(len(axis.values) for axis in self.axes)


@dataclass(frozen=True)
class Swept:
    """A sweep with what became of its cases."""

    sweep: Sweep
    finished: tuple[Finished | None, ...]
    """In the order of the cases; None of those that nothing was done for."""

    @property
    def solved(self) -> tuple[bool, ...]:
        """Of which cases there is an answer."""
        return tuple(one is not None and one.ending in ANSWERED for one in self.finished)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of what is known of the answers, in the order in which cases have them."""
        known: dict[str, None] = {}
        for one, solved in zip(self.finished, self.solved, strict=True):
            if one is not None and solved:
                known |= dict.fromkeys(one.figures)
        return tuple(known)

    def figure(self, name: str) -> list[Figure]:
        """Return a figure of all cases; None where there is no answer, or none that has it."""
        return [
            one.figures.get(name) if one is not None and solved else None
            for one, solved in zip(self.finished, self.solved, strict=True)
        ]

    def grid(self, name: str) -> Array | None:
        """Return a figure over the axes, NaN where it is not known; None where it is no number.

        Returns:
            The shape of the sweep; of figures with several numbers, such as times, another axis.
        """
        values = self.figure(name)
        known = FIGURES.get(name)  # words are words, too, where none of the answers has one
        if any(isinstance(value, str) for value in values) or (known and known.kind == "word"):
            return None
        several = [value for value in values if isinstance(value, tuple)]
        if not several:
            flat = [math.nan if value is None else value for value in values]
            return np.array(flat, dtype=float).reshape(self.sweep.shape)
        grid = np.full((len(values), max(map(len, several))), math.nan)
        for row, value in zip(grid, values, strict=True):
            if isinstance(value, tuple):
                row[: len(value)] = value
        return grid.reshape(*self.sweep.shape, -1)


def expand(
    problem: Problem,
    where: str,
    axes: Sequence[Axis],
    *,
    options: Mapping[str, Any],
    constants: Mapping[str, Scalar],
    warm: bool,
) -> Sweep:
    """Return the cases of a sweep, looked at as far as that takes no solve.

    Args:
        problem: the problem as its file has it, without `constants` set.
        where: the name of a bundled problem, or the path of its file.
        axes: what to sweep over; there is one at least.
        options: fields of Options for all cases; None counts as not given.
        constants: to set in all cases, by name or dotted path.
        warm: start each solve from its neighbour.

    Raises:
        UsageError: something is both swept and set, or options exclude each other.
        ProblemError: the file makes no sense at the first point.
    """
    options = {name: value for name, value in options.items() if value not in (None, {})}
    if not axes:
        raise UsageError("a sweep goes over something: add --over NAME=START:STOP:POINTS")
    _refuse_set(axes, options, constants)
    _refuse_combinations(problem, axes, options)
    cases = tuple(_case(point, where, options, constants) for point in points(axes, warm=warm))
    _check(problem, cases[0])
    return Sweep(
        problem.name, problem.title, problem.text, tuple(axes), cases, options, constants, warm
    )


def collected(sweep: Sweep, finished: Iterable[Finished]) -> Swept:
    """Return the sweep with what became of its cases; each is taken once, in whatever order."""
    by_name = {one.case.name: one for one in finished}
    return Swept(sweep, tuple(by_name.get(case.name) for case in sweep.cases))


@dataclass(frozen=True)
class Point:
    """A place on the grid of some axes; mappings are by the names of these."""

    options: dict[str, Scalar]
    """Values of those that are options."""
    constants: dict[str, Scalar]
    """Values of the others."""
    labels: Mapping[str, str]
    before: Mapping[str, str] | None
    """Labels of the neighbour to start from; None where there is none."""

    @property
    def values(self) -> dict[str, Scalar]:
        """Values of all axes, in their order."""
        both = self.options | self.constants
        return {name: both[name] for name in self.labels}


def points(axes: Sequence[Axis], *, warm: bool) -> Iterator[Point]:
    """Yield all combinations of the values of axes, the last axis fastest.

    Args:
        axes: without any there is one point.
        warm: whether points have neighbours to start from.
    """
    for index in product(*(range(len(axis.values)) for axis in axes)):
        at = list(zip(axes, index, strict=True))
        yield Point(
            {axis.name: axis.values[i] for axis, i in at if axis.option},
            {axis.name: axis.values[i] for axis, i in at if not axis.option},
            _labels(axes, index),
            _labels(axes, _neighbour(index)) if warm and any(index) else None,
        )


def _labels(axes: Sequence[Axis], index: Sequence[int]) -> dict[str, str]:
    return {axis.name: axis.labels[i] for axis, i in zip(axes, index, strict=True)}


def _case(
    point: Point, where: str, options: Mapping[str, Any], constants: Mapping[str, Scalar]
) -> Case:
    """Return the case at a point."""
    return Case(
        name=_name(point.labels),
        problem=where,
        options={**options, **point.options},
        constants={**constants, **point.constants},
        axes=point.values,
        follows=None if point.before is None else _name(point.before),
    )


def _name(labels: Mapping[str, str]) -> str:
    return ",".join(f"{name}={label}" for name, label in labels.items())


def _neighbour(index: tuple[int, ...]) -> tuple[int, ...]:
    """Return the place one back on the last axis on which it is not at the first value."""
    last = max(i for i, place in enumerate(index) if place)
    return (*index[:last], index[last] - 1, *index[last + 1 :])


def _refuse_set(
    axes: Sequence[Axis], options: Mapping[str, Any], constants: Mapping[str, Scalar]
) -> None:
    """Refuse what is swept over and has one value, too.

    Raises:
        UsageError: there is such a thing.
    """
    for axis in axes:
        hyphened = axis.name.replace("_", "-")
        if axis.option and axis.name in options:
            raise UsageError(f"{hyphened} is swept over: leave out --{hyphened}")
        for name in constants:
            if not axis.option and name.removeprefix("constants.") == axis.name:
                raise UsageError(f"{axis.name} is swept over: leave out --set {name}")


def _refuse_combinations(
    problem: Problem, axes: Sequence[Axis], options: Mapping[str, Any]
) -> None:
    """Refuse options that exclude each other anywhere on the grid.

    Raises:
        UsageError: some do; the place is named.
    """
    swept = [axis for axis in axes if axis.option]
    for point in points(swept, warm=False):
        try:
            Options.resolve(problem.options, {**options, **point.options})
        except UsageError as error:
            at = f"{_name(point.labels)}: " if swept else ""
            raise type(error)(f"{at}{error}") from None


def _check(problem: Problem, case: Case) -> None:
    """Look whether the problem makes sense at a point.

    Raises:
        UsageError: there is nothing of some name to set.
        ProblemError: what is set makes no sense there.
    """
    try:
        changed(problem, {name: str(value) for name, value in case.constants.items()})
    except ProblemError:
        raise
    except UsageError as error:
        raise UsageError(str(error).replace("--set", "--over or --set", 1)) from None


def place_of(problem: str, path: Path) -> str:
    """Return what a case calls the problem: the name of a bundled one, or an absolute path."""
    return problem if not Path(problem).is_file() else str(path.resolve())
