"""The connection with a Dask scheduler, and whether quito is the same on both of its ends."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from quito_cli import __version__
from quito_cli.batch.workers import remote
from quito_cli.errors import UnavailableError, UsageError

if TYPE_CHECKING:
    from distributed import Client

_CONNECT: Final = 10.0
"""Seconds in which the scheduler has to answer."""
_FILE: Final = ".json"
"""How a scheduler file is called that need not be there yet."""
_LOOK: Final = 0.1
"""Seconds between two looks for it, and to say good-bye to who is gone."""


def _address_in(path: Path) -> str:
    """Return the address in a file of a scheduler, which may be about to be written.

    Raises:
        UnavailableError: there is no such file, even after a while.
    """
    end = time.monotonic() + _CONNECT
    while not path.is_file() or not path.read_bytes().strip():
        if time.monotonic() > end:
            raise UnavailableError(
                f"there is no scheduler file {path}: start `dask scheduler --scheduler-file {path}`"
            )
        time.sleep(_LOOK)
    return str(json.loads(path.read_bytes())["address"])


@contextmanager
def connected(address: str) -> Iterator[Client]:
    """Connect with the scheduler.

    Raises:
        UnavailableError: `distributed` is not installed, or nothing answers.
        UsageError: the address is none.
    """
    try:
        from distributed import Client
    except ImportError:
        raise UnavailableError(
            "--cluster needs Dask, which is not installed: pip install 'quito[dask]'"
        ) from None
    log = logging.getLogger("distributed")
    level = log.level
    log.setLevel(logging.CRITICAL)  # what becomes of connections is told here
    try:
        try:
            if address.endswith(_FILE) or Path(address).is_file():
                address = _address_in(Path(address))
            client = Client(address, timeout=_CONNECT, set_as_default=False, name="quito")
        except (ValueError, LookupError, TypeError) as error:
            raise UsageError(
                f"--cluster {address}: {error}; write tcp://HOST:PORT, as the scheduler prints it, "
                "or name its scheduler file"
            ) from None
        except OSError:
            raise UnavailableError(
                f"no scheduler answers at {address} within {_CONNECT:g} s: is `dask scheduler` "
                "running there, and is its port open to this machine?"
            ) from None
        try:
            yield client
        finally:
            with suppress(Exception):  # the cluster may be gone
                client.close(timeout=_CONNECT if client.status == "running" else _LOOK)
    finally:
        log.setLevel(level)


def refuse_versions(client: Client, address: str) -> None:
    """Compare quito here with that of the scheduler and of the workers that are there by now.

    Raises:
        UnavailableError: it is missing somewhere, or is another.
    """
    found: dict[str, Any] = {}
    try:
        found[f"the scheduler at {address}"] = client.run_on_scheduler(remote.version)
    except Exception as error:
        found[f"the scheduler at {address}"] = error
    found |= client.run(remote.version, on_error="return")
    for where, said in found.items():
        if isinstance(said, Exception):
            raise UnavailableError(
                f"quito cannot be used at {where} ({said}): install quito {__version__} there, in "
                "the environment that Dask runs in"
            )
        if said != __version__:
            raise UnavailableError(
                f"quito {said} is installed at {where}, and {__version__} here: install the same "
                "version everywhere"
            )
