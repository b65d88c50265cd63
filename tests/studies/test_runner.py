"""The runner: the points do not depend on where tasks are computed or which worker dies."""

import os
import random
import signal
import subprocess
import sys
from collections.abc import Callable, Generator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, parent_process
from pathlib import Path
from queue import Queue
from select import select
from typing import Any

import pytest

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.studies import runner
from stickslip_ros.studies.columns import Point
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.plan import Axis, Continuation, Grid
from stickslip_ros.studies.runner import compute_columns, local_processes, run, run_here
from stickslip_ros.studies.settling import SettlingOptions
from stickslip_ros.studies.study import Piece, Study, compute
from tests.studies.studies import SHORT, free, paper, speeds, stop_at

MINIMUM = Axis("plant.friction.minimum", 0.1, 0.6, 6)
SPEED = Axis("plant.belt_speed", 0.05, 0.6, 4)
SLOPE = Axis("plant.friction.slope", 0.1, 0.9, 4)
GAIN = Axis("washout_controller.linear_gain", -1.0, 100.0, 6)

STUDIES = {
    "each alone": Study(free(), Grid((MINIMUM, SPEED)), SHORT),
    "up and down": Study(free(), Grid((SPEED, MINIMUM), Continuation.BOTH), SHORT),
    "running away": Study(
        free("plant.friction.law=linear"),
        Grid((SPEED, SLOPE), Continuation.DOWN),
        SettlingOptions(20.0, 2),
    ),
    "sampled": Study(
        paper("plant.rate=20.0", "plant.force_jitter=0.1"), Grid((GAIN,), Continuation.UP), SHORT
    ),
    "continuous": Study(paper(), Grid((GAIN,)), SHORT, continuous=True),
}
"""Among whose points some are refused and some run away."""


class AnyOrder(Queue[Any]):
    """Gives what it holds in random order."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._random = random.Random(seed)

    def _get(self) -> Any:
        self.queue.rotate(self._random.randrange(len(self.queue)))
        return self.queue.popleft()


class Shuffled(ThreadPoolExecutor):
    """Computes tasks in random order, one at a time."""

    def __init__(self, seed: int) -> None:
        super().__init__(1)
        self._work_queue: Any = AnyOrder(seed)
        self._futures: list[Future[Any]] = []
        self.most_pending = 0

    def submit(self, task: Any, /, *arguments: Any, **_: Any) -> Future[Any]:
        self._futures.append(super().submit(task, *arguments))
        pending = sum(not future.done() for future in self._futures)
        self.most_pending = max(self.most_pending, pending)
        return self._futures[-1]


@pytest.fixture(autouse=True)
def _small_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "_LARGEST_TASK", 3)


def computed(study: Study, executor: Executor | None = None, in_flight: int = 5) -> list[Point]:
    found = compute_columns(study, executor=executor, in_flight=in_flight)
    assert found.done.all()
    return list(found.points())


def at_once(study: Study) -> list[Point]:
    """Return the points without a runner, each chain at once."""
    points = [p for chain in study.plan.chains() for p in compute(study, chain, None).points]
    return sorted(points, key=lambda point: point.number)


@pytest.mark.parametrize(
    "name", ["each alone", *(pytest.param(name, marks=pytest.mark.long) for name in [*STUDIES][1:])]
)
def test_in_this_process_in_threads_and_in_any_order_the_points_are_the_same(name: str) -> None:
    study = STUDIES[name]
    expected = at_once(study)
    assert any(point.reason for point in expected)
    assert any(point.reason is None for point in expected)
    assert computed(study) == expected
    with ThreadPoolExecutor(3) as threads:
        assert computed(study, threads) == expected
    for seed, in_flight in ((0, 5), (1, 1), (2, 1000)):
        with Shuffled(seed) as shuffled:
            assert computed(study, shuffled, in_flight) == expected
            assert shuffled.most_pending <= in_flight


@pytest.mark.process
@pytest.mark.parametrize("name", ["sampled", pytest.param("up and down", marks=pytest.mark.long)])
def test_in_processes_the_points_are_the_same(name: str) -> None:
    with local_processes(2) as processes:
        assert computed(STUDIES[name], processes) == at_once(STUDIES[name])


def test_independent_points_are_computed_in_an_order_whose_begin_is_like_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """So the time of the first ones tells that of the others, whose motions differ."""
    order: list[int] = []

    def noted(study: Study, points: range, start: Any) -> Piece:
        order.extend(points)
        return Piece([Point(number) for number in points], None)

    monkeypatch.setattr(runner, "compute", noted)
    compute_columns(speeds(96))
    assert sorted(order) == [*range(96)]
    for quarter in (order[:24], order[24:48]):
        assert {point // 16 for point in quarter} == {*range(6)}


def test_an_executor_must_be_allowed_a_task() -> None:
    with Journal(speeds(3)) as journal, ThreadPoolExecutor(1) as executor:
        with pytest.raises(InvalidInputError, match="0 tasks in flight: must be 1 or more"):
            run(journal, executor, in_flight=0)
        with pytest.raises(InvalidInputError, match="0 workers: must be 1 or more"):
            run_here(journal, 0)


class _Instant(Executor):
    """Takes a task for done, and counts it."""

    def __init__(self) -> None:
        self.tasks = 0
        self.points = 0

    def submit(self, task: Any, /, *arguments: Any, **_: Any) -> Future[Any]:
        _, points, _ = arguments
        self.tasks += 1
        self.points += len(points)
        future: Future[Any] = Future()
        future.set_result(Piece(points, None))
        return future


class _Forgetful(Journal):
    """Only counts what it is given."""

    def add(self, piece: Piece) -> None:
        self.columns.done[[*piece.points]] = True


def test_a_million_points_are_a_few_thousand_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    study = Study(free(), speeds(1_000_000).plan, SettlingOptions(10.0, 2))
    executor = _Instant()
    with _Forgetful(study) as journal:
        run(journal, executor)
    assert executor.points == 1_000_000
    assert 16 * runner.IN_FLIGHT // 2 <= executor.tasks < 5_000
    few = _Instant()
    with _Forgetful(speeds(200)) as journal:
        run(journal, few, in_flight=4)
    assert few.tasks >= 4 * 8


class _Held(Executor):
    """Finishes the task before last when the next one comes: one is finished and not asked for."""

    def __init__(self) -> None:
        self._tasks: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, task: Any, /, *arguments: Any, **_: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self._tasks.append((future, lambda: task(*arguments)))
        if len(self._tasks) == 4:
            for waiting, work in self._tasks[1:3]:
                waiting.set_result(work())
        return future


def test_what_was_finished_when_it_is_interrupted_is_kept() -> None:
    with Journal(speeds(60)) as journal:
        with pytest.raises(KeyboardInterrupt):
            run(journal, _Held(), in_flight=4, progress=stop_at(1))
        assert journal.count == 2  # of one point each


@pytest.mark.process
def test_interrupted_processes_end_and_what_is_done_is_kept(tmp_path: Path) -> None:
    study = speeds(60)
    path = tmp_path / "study.part"
    with Journal(study, path) as journal:
        before = set(active_children())
        with pytest.raises(KeyboardInterrupt):
            run_here(journal, 2, stop_at(10))
        assert set(active_children()) <= before
        done = journal.count
        assert 10 <= done < 60
    with Journal(study, path) as journal:
        assert journal.count == done
        run(journal)
        assert list(journal.columns.points()) == at_once(study)


@pytest.mark.process
def test_interrupted_within_a_result_the_processes_end() -> None:
    def interrupt() -> None:
        with local_processes(2) as pool:
            # Results of this size are always on their way, one after the other.
            first, *_ = [pool.submit(bytes, 30_000_000) for _ in range(6)]
            first.result()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()


@pytest.mark.process
def test_a_worker_that_is_killed_costs_no_point() -> None:
    study = Study(free(), Grid((MINIMUM, SPEED), Continuation.BOTH), SHORT)
    others = set(active_children())
    killed: list[int] = []

    def kill_one(done: float) -> None:
        if done >= 10 and not killed:
            victim = next(child for child in active_children() if child not in others)
            killed.append(victim.pid)
            victim.kill()

    with Journal(study) as journal:
        run_here(journal, 2, kill_one)
        assert killed
        assert list(journal.columns.points()) == at_once(study)


@dataclass(frozen=True)
class Deadly(Grid):
    """A grid whose last point kills any worker that asks for its values."""

    def values(self, index: int) -> tuple[float, ...]:
        if index == self.size - 1 and parent_process() is not None:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().values(index)


@pytest.mark.long
@pytest.mark.process
def test_workers_that_keep_dying_end_the_run_and_what_is_done_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = Study(free(), Deadly((Axis("plant.belt_speed", 0.2, 0.6, 6),)), SHORT)
    pools: list[int] = []

    @contextmanager
    def counted(workers: int) -> Generator[Executor]:
        pools.append(workers)
        with local_processes(workers) as pool:
            yield pool

    monkeypatch.setattr(runner, "local_processes", counted)
    with Journal(study) as journal:
        with pytest.raises(RunError, match=r"were killed 3 times without progress, with . of 6"):
            run_here(journal, 2)
        assert 3 <= len(pools) <= 8
        found = list(journal.columns.points())
        assert found == [point for point in at_once(study) if journal.columns.done[point.number]]
        assert not journal.columns.done[5]


_BEGIN = """
from multiprocessing import active_children
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.runner import run_here
from tests.studies.studies import speeds

if __name__ == "__main__":
    with Journal(speeds(100_000)) as journal:
        run_here(journal, 2, lambda done: print(done, *[c.pid for c in active_children()],
                                                flush=True))
"""


@pytest.mark.process
def test_workers_end_with_the_process_that_started_them(tmp_path: Path) -> None:
    script = tmp_path / "begin.py"
    script.write_text(_BEGIN)
    root = Path(__file__).parents[2]
    with subprocess.Popen(
        [sys.executable, script],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(root)},
    ) as process:
        workers = next(pids for _, *pids in map(str.split, process.stdout) if len(pids) == 2)
        descriptors = [os.pidfd_open(int(pid)) for pid in workers]
        process.send_signal(signal.SIGKILL)
        process.wait()
        for descriptor in descriptors:
            ended, *_ = select([descriptor], [], [], 30.0)
            os.close(descriptor)
            assert ended
