"""An expectation held against what was found: passed or not, in a sentence.

A target v with the tolerances a (absolute) and r (relative) is met by x where
|x − v| ≤ max(a, r|v|), in every entry where there are several; words, counts and switches without
a tolerance are met by themselves. A limit is met by what is at it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from quito_cli.batch.case import Check, Expectation, Figure


def check_all(expected: Iterable[Expectation], found: Mapping[str, Figure]) -> tuple[Check, ...]:
    """Hold every expectation against the figures of an answer."""
    return tuple(check(one, found.get(one.figure)) for one in expected)


def check(expected: Expectation, found: Figure) -> Check:
    """Hold an expectation against what was found; what is not known is not as expected."""
    wanted = f"expected {wording(expected)}"
    if found is None:
        why = "it takes a reference, a certificate or a refinement that this answer has not"
        return Check(expected, found, False, f"{expected.figure} is not known ({why}), {wanted}")
    passed = _near(expected, found) and _within(expected, found)
    return Check(expected, found, passed, f"{expected.figure} is {shown(found)}, {wanted}")


def wording(expected: Expectation) -> str:
    """Return an expectation in words: `0.7576 ± 1e-06`, `at most 0.01`."""
    parts = []
    if expected.target is not None:
        tolerance = [f"{expected.absolute:g}"] if expected.absolute is not None else []
        tolerance += [f"{100 * expected.relative:g} %"] if expected.relative is not None else []
        parts.append(
            " ± ".join([shown(expected.target), *([" or ".join(tolerance)] * bool(tolerance))])
        )
    parts += [f"at least {expected.least:g}"] if expected.least is not None else []
    parts += [f"at most {expected.most:g}"] if expected.most is not None else []
    return " and ".join(parts)


def shown(value: Figure) -> str:
    """Return a figure as a person writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, tuple):
        return f"({', '.join(f'{entry:.10g}' for entry in value)})"
    return "not known" if value is None else str(value)


def _near(expected: Expectation, found: Any) -> bool:
    target: Any = expected.target
    if target is None:
        return True
    if isinstance(target, tuple):
        entries = found if isinstance(found, tuple) else (found,)
        return len(target) == len(entries) and all(
            abs(x - v) <= _tolerance(expected, v) for x, v in zip(entries, target, strict=True)
        )
    if isinstance(target, str | bool) or isinstance(found, str | bool):
        return bool(found == target)
    return bool(abs(found - target) <= _tolerance(expected, target))


def _tolerance(expected: Expectation, target: float) -> float:
    return max(expected.absolute or 0.0, (expected.relative or 0.0) * abs(target))


def _within(expected: Expectation, found: Any) -> bool:
    most = math.inf if expected.most is None else expected.most
    least = -math.inf if expected.least is None else expected.least
    if most == math.inf and least == -math.inf:
        return True
    entries = found if isinstance(found, tuple) else (found,)
    return all(least <= entry <= most for entry in entries)
