"""The last few values of a function of one object, for who asks again with the same one.

The objects are frozen and need not be hashable: they are told apart by identity. One process that
solves a problem many times, with other options, then derives its formulas once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")


def recent(most: int) -> Callable[[Callable[[A], B]], Callable[[A], B]]:
    """Return a decorator that keeps the last `most` values, with what they are of."""

    def keeping(function: Callable[[A], B]) -> Callable[[A], B]:
        kept: deque[tuple[A, B]] = deque(maxlen=most)

        @wraps(function)
        def asked(of: A) -> B:
            for one, value in tuple(kept):
                if one is of:
                    return value
            value = function(of)
            kept.append((of, value))
            return value

        return asked

    return keeping
