import os
from collections.abc import Iterator

import pytest

from stickslip_ros.nodes.base.network import this_machine_only
from stickslip_ros.testing import own_domain
from tests.nodes.graph import Graph
from tests.nodes.processes import Processes


@pytest.fixture(autouse=True)
def _this_machine_only(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in this_machine_only().items():
        monkeypatch.setenv(name, value)


@pytest.fixture
def domain() -> Iterator[int]:
    with own_domain() as domain:
        yield domain


@pytest.fixture
def often_diagnosed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let nodes of this process publish their diagnostics ten times a second."""
    monkeypatch.setattr("stickslip_ros.nodes.base.managed._DIAGNOSTICS_PERIOD", 0.1)


@pytest.fixture
def graph(domain: int) -> Iterator[Graph]:
    graph = Graph(domain)
    yield graph
    graph.close()


@pytest.fixture
def process_environment(domain: int) -> dict[str, str]:
    """Environment of a process that is in the test's domain."""
    return {**os.environ, "ROS_DOMAIN_ID": str(domain)}


@pytest.fixture
def processes(process_environment: dict[str, str]) -> Iterator[Processes]:
    processes = Processes(process_environment)
    yield processes
    processes.end()
