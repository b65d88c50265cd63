import os
from collections.abc import Iterator

import pytest

from tests.nodes.graph import Graph, own_domain


@pytest.fixture(autouse=True)
def _this_machine_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@pytest.fixture
def domain() -> Iterator[int]:
    with own_domain() as domain:
        yield domain


@pytest.fixture
def graph(domain: int) -> Iterator[Graph]:
    graph = Graph(domain)
    yield graph
    graph.close()


@pytest.fixture
def process_environment(domain: int) -> dict[str, str]:
    """Environment of a process that is in the test's domain."""
    return {**os.environ, "ROS_DOMAIN_ID": str(domain)}
