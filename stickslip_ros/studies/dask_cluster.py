"""A Dask cluster as the executor of a study."""

import logging
from collections.abc import Generator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from typing import Any

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.studies.runner import IN_FLIGHT

_TIMEOUT = "10s"


class DaskError(RunError):
    """A task has killed several workers of a cluster."""


@contextmanager
def dask_executor(address: str) -> Generator[tuple[Executor, int]]:
    """Connect to the scheduler at `address`; provide the executor and the tasks that it may hold.

    A task whose worker dies is computed again by another worker. Raises InvalidInputError if
    no scheduler answers or distributed is not installed, and DaskError for a task that has killed
    several workers.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise InvalidInputError(
            f"{address}: Dask is not installed: pip install 'stickslip_ros[dask]'"
        ) from None
    logger = logging.getLogger("distributed")
    with ExitStack() as stack:
        # Dask logs errors with tracebacks; they are raised here instead.
        stack.callback(logger.setLevel, logger.level)
        logger.setLevel(logging.CRITICAL)
        try:
            client = Client(address, timeout=_TIMEOUT)
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split()) or "nothing answers"
            raise InvalidInputError(f"{address}: no scheduler found: {reason}") from None
        with client:
            threads: Any = client.nthreads()
            try:
                yield client.get_executor(), max(2 * sum(threads.values()), IN_FLIGHT)
            except KilledWorker as error:
                raise DaskError(f"{address}: {error}") from None
