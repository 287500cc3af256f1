"""What a suite may expect of an answer: a field for each figure, and how near is near enough.

cost: 0.757618 ± 1e-6                          value and tolerance; +- is understood, too
cost: {value: 0.757618, relative: 1e-6}        the same in full; absolute or relative or both
error_l2: <= 0.01                              a limit, or {most: 0.01}; '>= 2' is {least: 2}
iterations: 14                                 counts, words and switches stand for themselves
switching_times: {value: [1.37, 2.46], absolute: 0.01}
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, ConfigDict, Discriminator, Field, Tag, WithJsonSchema
from pydantic import model_validator as checked

from quito_cli.batch.case import Expectation
from quito_cli.problem.schema_values import MAX_SIZE, Nothing, Strict, kind

_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_LIMIT = re.compile(rf"(<=|>=)\s*({_NUMBER})")
_NEAR = re.compile(rf"({_NUMBER})\s*(?:±|\+-)\s*({_NUMBER})(\s*%)?")
_PATTERN = rf"^\s*((<=|>=)\s*{_NUMBER}|{_NUMBER}\s*(±|\+-)\s*{_NUMBER}(\s*%)?)\s*$"
_FORMS = "0.75 ± 1e-6, 0.75 ± 0.1 %, <= 0.01 or '>= 2'"


def _readable(text: str) -> str:
    """Return a short form, known to be one."""
    _read(text)
    return text


def _read(text: str) -> dict[str, float]:
    """Return what a short form says, as the fields of an expectation."""
    if limit := _LIMIT.fullmatch(text.strip()):
        return {"most" if limit[1] == "<=" else "least": float(limit[2])}
    near = _NEAR.fullmatch(text.strip())
    if near is None or float(near[2]) < 0:
        raise ValueError(
            f"expected a value with its tolerance, or a limit: {_FORMS}, got {text[:80]!r}"
        )
    if near[3]:
        return {"target": float(near[1]), "relative": float(near[2]) / 100}
    return {"target": float(near[1]), "absolute": float(near[2])}


Finite = Annotated[float, Field(allow_inf_nan=False)]
Tolerance = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _Tolerances(Strict):
    """How near a value is to be."""

    absolute: Tolerance | None = None
    """Tolerance."""
    relative: Tolerance | None = None
    """Tolerance over the size of the value; of two tolerances the larger one holds."""


class Within(_Tolerances):
    """A value with a tolerance, limits, or both."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1})

    value: Finite | None = None
    """What it is to be near to."""
    most: Finite | None = None
    """Upper limit."""
    least: Finite | None = None
    """Lower limit."""

    @checked(mode="after")
    def _says_something(self) -> Self:
        tolerant = self.absolute is not None or self.relative is not None
        if self.value is not None and not tolerant:
            raise ValueError("say how near to the value: `absolute`, `relative`, or both")
        if self.value is None and tolerant:
            raise ValueError("a tolerance is of a `value`: say which, or write `most` or `least`")
        if self.value is None and self.most is None and self.least is None:
            raise ValueError("expected `value`, `most` or `least`, such as {most: 0.01}")
        if self.least is not None and self.most is not None and self.least > self.most:
            raise ValueError("`least` is above `most`: nothing can be between them")
        return self


class WithinTimes(_Tolerances):
    """Several values with one tolerance."""

    value: Annotated[list[Finite], Field(max_length=MAX_SIZE)]
    """What they are to be near to: as many, in order."""

    @checked(mode="after")
    def _says_how_near(self) -> Self:
        if self.absolute is None and self.relative is None:
            raise ValueError("say how near to the values: `absolute`, `relative`, or both")
        return self


Short = Annotated[
    str,
    AfterValidator(_readable),
    WithJsonSchema({"type": "string", "pattern": _PATTERN}),
    Tag("=expression"),
]
_Full = Annotated[Within, Tag("=mapping")]
NumberExpected = Annotated[Short | _Full | Nothing, Discriminator(kind)]
"""A short form such as 0.75 ± 1e-6 or <= 0.01; or {value:, absolute:, relative:, most:, least:}."""
CountExpected = Annotated[
    Annotated[int, Field(ge=0, strict=True), Tag("=number")] | Short | _Full | Nothing,
    Discriminator(kind),
]
"""A whole number; or a limit or a tolerance, as of a number."""


class Expect(Strict):
    """What is expected of the figures of an answer, by name; `null` takes a default back."""

    cost: NumberExpected = None
    """Cost, in the file's sense."""
    cost_error: NumberExpected = None
    """|cost − the reference's|."""
    relative_cost_error: NumberExpected = None
    """|cost − the reference's| over the reference's size, where that is not zero."""
    resimulated_cost_error: NumberExpected = None
    """|cost that the control attains when it is integrated anew − the reference's|."""
    error_l2: NumberExpected = None
    """(∫ e² dt)^½ of the controls' error e against the reference."""
    error_l1: NumberExpected = None
    """∫ |e| dt."""
    error_sup: NumberExpected = None
    """Largest |e|."""
    error_sup_outside: NumberExpected = None
    """Largest |e| further than 1 % of the horizon from the known switching times."""
    error_norm: NumberExpected = None
    """2-norm of the vector of samples of e, four for each cell."""
    dft_norm: NumberExpected = None
    """2-norm of the discrete Fourier transform of these samples."""
    state_error: NumberExpected = None
    """Largest error of a state against the reference, over the largest value of that state."""
    switching_error: NumberExpected = None
    """Largest error of a time at which the reference's control jumps."""
    switching_times: Annotated[
        Annotated[WithinTimes, Tag("=mapping")] | Nothing, Discriminator(kind)
    ] = None
    """All times at which a control or a constraint changes: {value: [...], absolute: ...}."""
    initial_time: NumberExpected = None
    """Initial time."""
    final_time: NumberExpected = None
    """Final time."""
    status: (
        Literal[
            "solved",
            "inaccurate",
            "acceptable",
            "infeasible",
            "iteration_limit",
            "time_limit",
            "not_finite",
            "stuck",
            "diverged",
            "too_few_freedoms",
            "failed",
        ]
        | None
    ) = None
    """How the solve is to end; without it, an answer that did not converge fails its case."""
    success: bool | None = None
    """Whether it is to converge; without it, an answer that did not fails its case."""
    certificate: Literal["passed"] | None = None
    """`passed`: conditions of Pontryagin's principle are judged, and none fails."""
    polished: bool | None = None
    """Whether the answer is a polished one, of which every condition holds."""
    iterations: CountExpected = None
    """Iterations of the solver."""
    cells: CountExpected = None
    """Control cells."""
    warnings: CountExpected = None
    """Number of warnings."""
    violation: NumberExpected = None
    """Largest violation of any bound or condition, between the nodes too."""
    resimulation_gap: NumberExpected = None
    """Largest distance of the re-simulated states from the answer's, over their size."""
    total_variation: NumberExpected = None
    """Total variation, summed over the controls."""
    ringing: NumberExpected = None
    """Largest ringing index of the controls; up to about one is a control without ringing."""
    estimated_error: NumberExpected = None
    """Estimated error of the control on an adaptive mesh, over its range."""
    build_seconds: NumberExpected = None
    """Time before the solver is called; of this machine."""
    solve_seconds: NumberExpected = None
    """Time in the solver; of this machine."""
    processor_seconds: NumberExpected = None
    """Time of a processor for the whole solve with its checks; of this machine, but not of what
    else it does."""

    def expectations(self) -> Iterator[Expectation]:
        """Yield what is expected, in the order of the fields."""
        for name in type(self).model_fields:
            value = getattr(self, name)
            if value is not None:
                yield Expectation(name, **_as_fields(value))


def _as_fields(value: Any) -> dict[str, Any]:
    """Return what is expected of a figure, as the fields of an Expectation."""
    if isinstance(value, Strict):
        given = value.model_dump(exclude_none=True)
        target = given.pop("value", None)
        return given | {"target": tuple(target) if isinstance(target, list) else target}
    if isinstance(value, str) and (_LIMIT.match(value.strip()) or _NEAR.match(value.strip())):
        return _read(value)
    return {"target": value}
