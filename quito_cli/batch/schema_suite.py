"""The suite file as frozen pydantic models: what keys there are and what each means.

The attribute docstrings are the documentation: they become the JSON Schema's descriptions and the
hover text in editors. What a suite may ask of a solve is what a problem file may ask for.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Discriminator, Field, Tag, WithJsonSchema

from quito_cli.batch.limits import LEAST_MEMORY, Limits, bytes_of
from quito_cli.batch.schema_expect import Expect
from quito_cli.errors import UsageError
from quito_cli.problem.options import FileOptions
from quito_cli.problem.schema_values import Strict, kind

MAX_CASES = 10_000
"""Cases a suite may come to, includes and matrices and all."""
MAX_AXES = 8
"""Axes a matrix may have."""
MAX_NAMES = 500
"""Values that may be set at once."""
_LONGEST = 200
"""Characters of a value that stands in the name of a case."""
_LONGEST_PATH = 1000
"""Characters of the path of a file."""
_LONGEST_NAME = 255
"""Bytes of a file's name that file systems know."""
_NAME = "^[A-Za-z0-9][A-Za-z0-9_.+-]{0,79}$"


def _named(name: str) -> str:
    import re

    if not re.fullmatch(_NAME, name):
        raise ValueError(
            f"a name has letters, digits, '_', '.', '+' and '-', at most 80, got {name!r}"
        )
    return name


def _size(text: str) -> str:
    try:
        bytes_of(text)
    except UsageError as error:
        raise ValueError(str(error)) from None
    return text


def _no_novel(text: str) -> str:
    if len(text) > _LONGEST:
        raise ValueError(f"expected at most {_LONGEST} characters, got {len(text)}")
    return text


def _no_odd_path(text: str) -> str:
    if len(text) > _LONGEST_PATH:
        raise ValueError(f"expected a path of at most {_LONGEST_PATH} characters")
    if max(len(part.encode()) for part in ("", *text.split("/"))) > _LONGEST_NAME:
        raise ValueError(f"no file has so long a name: {_LONGEST_NAME} bytes are the most")
    return text


FileName = Annotated[str, AfterValidator(_no_odd_path)]
"""Path of a file, as seen from the suite."""
CaseName = Annotated[
    str, AfterValidator(_named), WithJsonSchema({"type": "string", "pattern": _NAME})
]
"""Letters, digits and some signs: files are named so."""
SetValue = Annotated[
    Annotated[int | float, Tag("=number")] | Annotated[str, Tag("=expression")], Discriminator(kind)
]
"""A number or an expression."""
AxisValue = Annotated[
    Annotated[int | float, Tag("=number")]
    | Annotated[str, AfterValidator(_no_novel), Tag("=expression")]
    | Annotated[bool, Tag("=switch")],
    Discriminator(lambda value: "=switch" if isinstance(value, bool) else kind(value)),
]
"""A number, a word or an expression, or a switch."""
AxisValues = Annotated[
    Annotated[int | float, Tag("=number")]
    | Annotated[str, Tag("=expression")]
    | Annotated[list[AxisValue], Field(min_length=1, max_length=MAX_CASES), Tag("=list")],
    Discriminator(kind),
]
"""A range such as 0.1:2:20, or values with commas between, or a list of them."""
_SIZES = "^ *[0-9]+([.][0-9]+)? *([kKmMgGtT]?[bB])? *$"
Memory = Annotated[
    Annotated[int, Field(ge=LEAST_MEMORY, strict=True), Tag("=number")]
    | Annotated[
        str,
        AfterValidator(_size),
        WithJsonSchema({"type": "string", "pattern": _SIZES}),
        Tag("=expression"),
    ],
    Discriminator(kind),
]
"""Bytes, or such as 500 MB or 2 GB."""


class CaseLimits(Strict):
    """What each case may take; what takes more fails alone. The command line wins."""

    seconds: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    """Time of a case."""
    memory: Memory | None = None
    """Memory of the process of a case: bytes, or such as 500 MB or 2 GB."""

    def over(self, below: Limits) -> Limits:
        """Return these limits, and others where there is none here."""
        given = self.model_fields_set
        memory = None if self.memory is None else bytes_of(self.memory)
        return Limits(
            self.seconds if "seconds" in given else below.seconds,
            memory if "memory" in given else below.memory,
        )


class Shared(Strict):
    """What holds for several cases, and for one."""

    options: FileOptions = FileOptions()
    """Options of the solve, as in a problem file; they win over those of the problem file."""
    set: Annotated[dict[str, SetValue], Field(max_length=MAX_NAMES)] = {}
    """Constants to set, by name, or other values by their path, such as states.x1.upper."""
    expect: Expect = Expect()
    """What is expected of the answer."""
    limits: CaseLimits = CaseLimits()
    """What each case may take."""


class Entry(Shared):
    """A case, or several that differ in options and constants, or what other files have."""

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": ["problem"]}, {"required": ["include"]}]}
    )

    problem: FileName | None = None
    """A problem file, as seen from the suite, or the name of a bundled problem."""
    include: FileName | None = None
    """Files instead of a problem: one, or several by `*` and `?` in the file's name, such as
    problems/*.yaml. Problems are cases each, with what stands beside `include`; of suites, all
    cases, as they stand there."""
    name: CaseName | None = None
    """What the case is called; by default as its problem."""
    matrix: Annotated[
        dict[str, Annotated[list[AxisValue], Field(min_length=1, max_length=MAX_CASES)]],
        Field(max_length=MAX_AXES),
    ] = {}
    """Options and constants that take several values each: a case for every combination, called
    `name[steps=50,mu=1]`."""
    over: Annotated[dict[str, AxisValues], Field(max_length=MAX_AXES)] = {}
    """Axes of a sweep, as `quito sweep --over` takes them: constants and options with a range,
    mu: 0.1:2:20 or mu: 1e-3:1:10:log, or with a list of values. All combinations, with those of
    `matrix`, are cases."""
    warm: bool = False
    """Continuation along the axes of `over`: each solve starts from its neighbour's answer."""


class SuiteFile(Strict):
    """A suite: cases to be solved, and what is expected of each."""

    title: str = ""
    """One line, for headings."""
    description: str = ""
    """Notes: what the suite is for, where its tolerances come from."""
    defaults: Shared = Shared()
    """What holds for every case that does not say otherwise."""
    cases: Annotated[
        list[
            Annotated[
                Annotated[FileName, Tag("=expression")] | Annotated[Entry, Tag("=mapping")],
                Discriminator(kind),
            ]
        ],
        Field(min_length=1, max_length=MAX_CASES),
    ]
    """The cases: each a problem by itself, or a mapping with `problem` or `include`."""


def suite_schema_text() -> str:
    """Return the schema of suites, as `schemas/suite.schema.json` has it."""
    from quito_cli.problem.json_schema import schema_of

    return schema_of(SuiteFile, "quito suite")
