"""Pytest plugin that measures each test and lists the slow ones in slow.txt; see `make slow`."""

import resource
from collections.abc import Generator
from pathlib import Path

import pytest

LIST = Path(__file__).with_name("slow.txt")
"""The functions of slow tests, one a line; `make check` leaves them out."""

LIMIT = 0.1
"""Processor time of a test, with its processes, above which it is slow, s."""

_MEASURED = "processor time"
_STARTED = pytest.StashKey[float]()

_slow: set[str] = set()


def function_of(node: str) -> str:
    """The function of a test, whatever its parameters."""
    return node.partition("[")[0]


def _processor_time() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, None, None]:
    """Measure the test from here on: with its fixtures, though others may share them."""
    item.stash[_STARTED] = _processor_time()
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, None, None]:
    """Tell what the test has taken."""
    item.user_properties.append((_MEASURED, _processor_time() - item.stash[_STARTED]))
    return (yield)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Collect what the workers have measured."""
    taken = dict(report.user_properties).get(_MEASURED, 0.0)
    if report.when == "teardown" and taken > LIMIT:
        _slow.add(function_of(report.nodeid))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the list, where the results of all workers are."""
    if not hasattr(session.config, "workerinput"):
        LIST.write_text("".join(f"{name}\n" for name in sorted(_slow)), encoding="utf-8")
