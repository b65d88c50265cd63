"""Pytest plugin that measures tests: `make slow` lists the slow ones in slow.txt.

With `--slow-tests=known`, as in `make test-all`, a test that is far above the limit and not in the
list fails.
"""

import resource
import time
from collections import defaultdict
from collections.abc import Generator
from functools import cache
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import settings

LIST = Path(__file__).with_name("slow.txt")
"""The functions of slow tests, one a line; `make check` leaves them out."""

LIMIT = 0.05
"""Processor time of a test above which it is slow, s, where `_loop` takes LOOP."""
LOOP = 0.0105
FAR = 8.0
"""A test that the list lacks fails at so many times the limit: processor times vary."""

EXAMPLES = 20
"""Examples of a property where the list is made; with more of them the limit is higher."""

_SLOW = "slow"


def function_of(node: str) -> str:
    """The function of a test, whatever its parameters."""
    return node.partition("[")[0]


@cache
def listed() -> frozenset[str]:
    """The functions in the list."""
    return frozenset(LIST.read_text(encoding="utf-8").splitlines())


def _processor_time() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def _loop() -> float:
    """Return the processor time of a fixed loop: it tells how fast the processor is now."""
    start, total = time.process_time(), 0
    for number in range(200_000):
        total += number * number % 7
    return time.process_time() - start


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the choice of what to do with slow tests."""
    parser.addoption("--slow-tests", choices=("list", "known"), default="list")


def pytest_configure(config: pytest.Config) -> None:
    """Measure, and list or check."""
    config.pluginmanager.register(_Measurement(config.getoption("--slow-tests") == "list"))


class _Measurement:
    """Measures each test with the fixtures that it shares with others.

    The first that runs pays for imports, compiled flows and shared fixtures, whichever it is. So
    one that seems slow is run once more, with fixtures of its own.
    """

    def __init__(self, makes_list: bool) -> None:
        self._makes_list = makes_list
        self._factor = 1.0 if makes_list else FAR
        self._shared: dict[str, dict[str, float]] = defaultdict(dict)
        """Processor time of each shared fixture, by its name and where it is defined."""
        self._within = 0.0
        """Processor time of the shared fixtures that the present test has set up."""
        self._slow: set[str] = set()

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(
        self, fixturedef: pytest.FixtureDef[object]
    ) -> Generator[None, object, object]:
        start = _processor_time()
        try:
            return (yield)
        finally:
            if fixturedef.scope != "function":
                taken = _processor_time() - start
                self._within += taken
                self._shared[fixturedef.argname][fixturedef.baseid] = taken

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(
        self, item: pytest.Function, nextitem: pytest.Item | None
    ) -> Generator[None, object, object]:
        start, self._within = _processor_time(), 0.0
        result = yield
        taken = _processor_time() - start - self._within
        if not self._is_left_out(item) and self._is_slow(item, taken + self._shared_by(item)):
            item.session._setupstate.teardown_exact(None)
            start = _processor_time()
            runtestprotocol(item, log=False, nextitem=nextitem)
            taken = _processor_time() - start
            if self._is_slow(item, taken):
                item.ihook.pytest_runtest_logreport(report=self._report(item, taken))
        return result

    def _is_left_out(self, item: pytest.Item) -> bool:
        known = not self._makes_list and function_of(item.nodeid) in listed()
        return known or bool({"long", "process"}.intersection(item.keywords))

    def _shared_by(self, item: pytest.Function) -> float:
        fixtures = [each for name in item.fixturenames for each in self._shared[name].items()]
        return sum(taken for base, taken in fixtures if item.nodeid.startswith(base))

    def _is_slow(self, item: pytest.Item, taken: float) -> bool:
        limit = LIMIT * self._factor
        if item.get_closest_marker("hypothesis"):
            limit *= max(settings().max_examples / EXAMPLES, 1.0)
        return taken > limit and taken > limit * min(_loop() for _ in range(3)) / LOOP

    def _report(self, item: pytest.Item, taken: float) -> pytest.TestReport:
        return pytest.TestReport(
            item.nodeid,
            item.location,
            keywords={},
            outcome="passed" if self._makes_list else "failed",
            longrepr=f"{item.nodeid} takes {taken:.2f} s and is not listed: run `make slow`",
            when="teardown",
            user_properties=[(_SLOW, taken)],
        )

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Collect what the workers have measured."""
        if _SLOW in dict(report.user_properties):
            self._slow.add(function_of(report.nodeid))

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write the list, where the results of all workers are."""
        if self._makes_list and not hasattr(session.config, "workerinput"):
            LIST.write_text("".join(f"{name}\n" for name in sorted(self._slow)), encoding="utf-8")
