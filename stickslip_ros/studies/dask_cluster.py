"""A Dask cluster as the executor of a study."""

import logging
from collections.abc import Generator
from concurrent.futures import Executor
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.studies.runner import IN_FLIGHT

_TIMEOUT = "10s"


@contextmanager
def dask_executor(address: str) -> Generator[tuple[Executor, int]]:
    """Connect to the scheduler at `address`; provide the executor and how many tasks it may hold.

    A task whose worker dies is computed again by another one. Raises InvalidInputError where
    nothing answers, or distributed is not installed, and RunError for a task that has killed
    several workers.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise InvalidInputError(
            f"--dask {address}: Dask is not installed: pip install 'stickslip_ros[dask]'"
        ) from None
    with _silent_log():
        try:
            client = distributed.Client(address, timeout=_TIMEOUT)
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split()) or "nothing answers"
            raise InvalidInputError(f"--dask {address}: no scheduler found: {reason}") from None
        with client:
            threads = sum(client.nthreads().values())
            try:
                yield client.get_executor(), max(2 * threads, IN_FLIGHT)
            except distributed.KilledWorker as error:
                raise RunError(f"--dask {address}: {error}") from None


@contextmanager
def _silent_log() -> Generator[None]:
    """Keep Dask from logging, with tracebacks, what is raised here as an error."""
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
