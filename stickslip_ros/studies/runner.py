"""Running a study: in this process, in several local processes, or through an executor."""

import logging
import signal
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, get_context, parent_process
from os import _exit
from pathlib import Path
from threading import Thread
from typing import Any, cast

import numpy as np

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.settling import MotionState
from stickslip_ros.studies.study import Piece, PointStudy, compute, pieces_of

IN_FLIGHT = 64
"""Default number of tasks that an executor holds at a time, which limits the memory."""

_LARGEST_TASK = 1000
"""Largest number of points of a task."""

_DASK_TIMEOUT = "10s"

CountPoints = Callable[[int], None]
"""A function that receives the number of points that are done."""


class WorkersDiedError(RunError):
    """An executor has lost its workers."""


class DaskError(RunError):
    """A task has killed several workers of a cluster."""


def run(
    journal: Journal,
    executor: Executor | None = None,
    *,
    in_flight: int = IN_FLIGHT,
    progress: CountPoints = lambda _: None,
) -> None:
    """Compute the points of a journal's study that are missing.

    If the run is interrupted, the journal holds the points that are done. The result does not
    depend on the executor, to the last bit on one kind of processor.

    An executor holds `in_flight` tasks of some points each at a time; without one this process
    computes them. `progress` receives the number of points that are done. Raises InvalidInputError
    if `in_flight` is below 1, and WorkersDiedError if the executor gives up.
    """
    if in_flight < 1:
        raise InvalidInputError(f"{in_flight} tasks in flight: must be 1 or more")
    study = journal.study
    size = _task_size(journal, 1 if executor is None else in_flight)
    progress(journal.count)
    chains = (_Chain(pieces_of(points, size), start) for points, start in _missing(journal))
    if not study.plan.continuation:  # the pieces are independent
        pieces = [piece for chain in chains for piece in chain.pieces]
        chains = (_Chain(iter((piece,)), None) for piece in _scattered(pieces))
    if executor is None:
        for chain in chains:
            for points in chain.pieces:
                chain.start = _record(journal, compute(study, points, chain.start), progress)
        return
    waiting: dict[Future[Piece], _Chain] = {}

    def submit(chain: "_Chain") -> None:
        points = next(chain.pieces, None)
        if points is not None:
            waiting[executor.submit(compute, study, points, chain.start)] = chain

    try:
        while True:
            while len(waiting) < in_flight and (chain := next(chains, None)) is not None:
                submit(chain)
            if not waiting:
                return
            for task in wait(waiting, return_when=FIRST_COMPLETED).done:
                piece, chain = task.result(), waiting.pop(task)
                chain.start = _record(journal, piece, progress)
                if study.plan.continuation:
                    submit(chain)
    except (BrokenExecutor, CancelledError) as error:
        raise WorkersDiedError(
            f"{type(executor).__name__} has lost its workers with {journal.count} of "
            f"{study.plan.size} points done: {error or 'a task was cancelled'}"
        ) from None
    finally:
        for task in waiting:
            if task.done() and not task.cancelled() and task.exception() is None:
                journal.add(task.result())
            task.cancel()


def run_here(journal: Journal, workers: int, progress: CountPoints = lambda _: None) -> None:
    """Run the study as `run` does, in `workers` processes of this machine.

    Processes that are killed are replaced. Raises RunError if they keep dying.
    """
    if workers < 1:
        raise InvalidInputError(f"{workers} workers: must be 1 or more")
    if workers == 1:
        run(journal, progress=progress)
        return
    deaths = 0
    while True:
        before = journal.count
        try:
            with local_processes(workers) as pool:
                run(journal, pool, in_flight=2 * workers, progress=progress)
        except WorkersDiedError:
            deaths = 1 if journal.count > before else deaths + 1
            if deaths == 3:
                raise RunError(
                    f"worker processes were killed {deaths} times without progress, with "
                    f"{journal.count} of {journal.study.plan.size} points done: check that there "
                    "is enough memory, and that a script has `if __name__ == '__main__':`"
                ) from None
        else:
            return


def compute_columns(
    study: PointStudy[Any],
    *,
    workers: int = 1,
    executor: Executor | None = None,
    in_flight: int = IN_FLIGHT,
    path: Path | None = None,
    progress: CountPoints = lambda _: None,
    columns: Any = None,
) -> Any:
    """Compute a study and return its points as columns.

    The result does not depend on how the work is shared.

    Parameters
    ----------
    study : PointStudy
        The study, as from `sweep_study` or `basin_study`.
    workers : int
        Number of processes on this machine; 1 computes in this process.
    executor : concurrent.futures.Executor, optional
        Executor to use instead of `workers`.
    in_flight : int
        Number of tasks that the executor holds at a time.
    path : Path, optional
        Journal file. An interrupted study continues from it, and it is kept at the end.
    progress : Callable[[int], None]
        Receives the number of points that are done.
    columns : optional
        What takes the points; by default `Columns`.

    Returns
    -------
    Columns
        The results, one row for each point; or `columns`.

    Raises
    ------
    InvalidInputError
        If `path` is not a journal of this study, or cannot be written.
    RunError
        If the worker processes keep dying, or the executor gives up.
    """
    with Journal(study, path, columns) as journal:
        if executor is not None:
            run(journal, executor, in_flight=in_flight, progress=progress)
        else:
            run_here(journal, workers, progress)
        return journal.columns


@contextmanager
def local_processes(workers: int) -> Generator[ProcessPoolExecutor]:
    """Provide `workers` processes on this machine, which end whenever this one ends.

    They are spawned, not forked, because a fork would lose the threads of heyoka's compiler.
    """
    others = set(active_children())
    pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=_begin_worker)
    try:
        # Workers inherit the blocked signals: this process terminates them on an interrupt.
        unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            for _ in range(workers):
                pool.submit(bool)  # an empty task, which starts a process
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
        yield pool
    except BaseException:
        for child in set(active_children()) - others:
            child.terminate()
        # If one has ended within a result, the pool would wait for the rest of it.
        cast(Any, pool)._result_queue._writer.close()
        pool.shutdown(cancel_futures=True)
        raise
    else:
        pool.shutdown()


@contextmanager
def dask_executor(address: str) -> Generator[tuple[Executor, int]]:
    """Connect to the Dask scheduler at `address`; provide the executor and its tasks in flight.

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
            client = Client(address, timeout=_DASK_TIMEOUT)
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split()) or "nothing answers"
            raise InvalidInputError(f"{address}: no scheduler found: {reason}") from None
        with client:
            threads: Any = client.nthreads()
            try:
                yield client.get_executor(), max(2 * sum(threads.values()), IN_FLIGHT)
            except KilledWorker as error:
                raise DaskError(f"{address}: {error}") from None


def _begin_worker() -> None:
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
    _exit(1)


@dataclass
class _Chain:
    """Pieces that are computed in sequence."""

    pieces: Iterator[range]
    start: MotionState | None
    """State in which the next piece starts."""


def _missing(journal: Journal) -> Iterator[tuple[range, MotionState | None]]:
    """Yield runs of missing points, and the state in which the first point of each starts."""
    plan, done = journal.study.plan, journal.columns.done
    for points in plan.chains():
        places = np.flatnonzero(~done[points])
        for run in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1):
            if len(run):
                first, last = int(run[0]), int(run[-1])
                carried = plan.continuation and first
                start = journal.ends[points[first - 1]] if carried else None
                yield points[first : last + 1], start


def _scattered(pieces: list[range]) -> Iterator[range]:
    """Yield the pieces so that the first ones are like all: their time tells the time left.

    The places are those of a Kronecker sequence by the golden section, of low discrepancy.
    """
    sequence = np.arange(len(pieces)) * 0.618034 % 1.0
    return (pieces[place] for place in np.argsort(np.argsort(sequence)))


def _record(journal: Journal, piece: Piece, progress: CountPoints) -> MotionState | None:
    journal.add(piece)
    progress(journal.count)
    return piece.end


def _task_size(journal: Journal, in_flight: int) -> int:
    size = min(int(0.25 / journal.study.cost()), _LARGEST_TASK)  # tasks of about 0.25 s
    if in_flight > 1 and not journal.study.plan.continuation:
        # At least 16 tasks for each worker, so that all workers end at about the same time.
        size = min(size, journal.study.plan.size // (16 * in_flight // 2))
    return max(size, 1)
