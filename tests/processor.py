"""A watch for what must not hang: the work of this process counts, not what else a machine does."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Fail where what is done inside takes more processor time than `seconds`.

    The limit stands for "does not hang": some ten times what it takes, so that no machine is
    too slow for it.
    """
    begun = time.process_time()
    yield
    assert time.process_time() - begun < seconds, "it took too long"
