"""Studies on a Dask cluster: a scheduler and workers, each a process of its own."""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import distributed
import pytest

from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.plan import Axis, Continuation
from stickslip_ros.studies.runner import WorkersDiedError, dask_executor, run
from stickslip_ros.studies.settling import SettlingOptions
from stickslip_ros.studies.study import Study, sweep_study
from tests.nodes.graph import PATIENCE, wait_for
from tests.studies.studies import points_of, speeds

LOCAL = "127.0.0.1"


class Cluster:
    """A scheduler and workers without nannies: one that is killed stays dead."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self.processes: list[subprocess.Popen[bytes]] = []
        file = directory / "scheduler.json"
        self._start("scheduler", "--host", LOCAL, "--port", "0", "--scheduler-file", str(file))
        wait_for(lambda: file.exists() and file.stat().st_size > 0, "the scheduler")
        self.address = str(json.loads(file.read_text())["address"])

    def add_worker(self) -> subprocess.Popen[bytes]:
        alone = ("--no-nanny", "--nthreads", "1", "--no-dashboard")
        return self._start("worker", self.address, "--host", LOCAL, *alone)

    def wait_for_workers(self, count: int) -> None:
        with distributed.Client(self.address) as client:
            client.wait_for_workers(count, timeout=PATIENCE)

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        with (self._directory / "log").open("ab") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments],
                cwd=self._directory,
                stdout=log,
                stderr=log,
            )
        self.processes.append(process)
        return process

    def end(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    cluster = Cluster(tmp_path)
    yield cluster
    cluster.end()


def study(carry: Continuation | None = None) -> Study:
    scenario = load_scenario("paper", ["plant.expects_control=false"])
    axes = [Axis("plant.damping", 0.0, 0.05, 8), Axis("plant.belt_speed", 0.1, 0.6, 40)]
    return sweep_study(
        scenario, axes, continuation=carry, settling=SettlingOptions(transient=100.0)
    )


@pytest.mark.process  # distributed starts uname
def test_on_a_cluster_the_points_are_the_same() -> None:
    asked = speeds(6)
    with (
        distributed.LocalCluster(
            1, 1, processes=False, host=LOCAL, protocol="tcp://", dashboard_address=None
        ) as cluster,
        Journal(asked) as journal,
        dask_executor(cluster.scheduler_address) as (executor, in_flight),
    ):
        run(journal, executor, in_flight=in_flight)
        found = list(journal.columns.points())
    assert found == points_of(asked)


@pytest.mark.long
def test_a_worker_killed_on_the_way_changes_nothing(cluster: Cluster) -> None:
    doomed = cluster.add_worker()
    cluster.add_worker()
    cluster.wait_for_workers(2)
    asked = study(Continuation.DOWN)
    killed = threading.Event()

    def kill_after_the_first_task(done: float) -> None:
        if 0 < done < asked.plan.size and not killed.is_set():
            os.kill(doomed.pid, signal.SIGKILL)
            killed.set()

    with Journal(asked) as journal, dask_executor(cluster.address) as (executor, in_flight):
        run(journal, executor, in_flight=in_flight, progress=kill_after_the_first_task)
        found = list(journal.columns.points())
    assert killed.is_set()
    assert doomed.wait(PATIENCE) == -signal.SIGKILL
    assert found == points_of(asked)
    assert len(found) == asked.plan.size


@pytest.mark.long
def test_a_scheduler_that_dies_is_an_error_and_what_was_done_is_kept(cluster: Cluster) -> None:
    asked = study()

    def kill_after_the_first_task(done: float) -> None:
        if done > 0:
            cluster.processes[0].kill()

    cluster.add_worker()  # one that comes late is waited for
    with Journal(asked) as journal:
        with (
            pytest.raises(WorkersDiedError, match="has lost its workers"),
            dask_executor(cluster.address) as (executor, in_flight),
        ):
            run(journal, executor, in_flight=in_flight, progress=kill_after_the_first_task)
        assert 0 < journal.count < asked.plan.size
        run(journal)
        assert journal.count == asked.plan.size
