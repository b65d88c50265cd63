"""Number of hypothesis examples, the tier of each test, and its order on the workers.

A test that takes a fixture which starts a process is marked `process` by that; one that starts a
process in another way has to say so, and fails where it does not.
"""

import gc
import os
import signal
import sys
from collections.abc import Iterator
from multiprocessing.process import BaseProcess
from pathlib import Path
from shutil import rmtree

import pytest
from hypothesis import settings

from tests.slow import EXAMPLES, function_of, listed

# How long an example takes says more of the machine than of the code. Where nobody looks on,
# the examples are the same every time, so that what fails is the change at hand.
THOROUGH = "thorough"
settings.register_profile(
    "quick",
    deadline=None,
    derandomize=bool(os.environ.get("CI")),
    max_examples=EXAMPLES,
    print_blob=True,
)
settings.register_profile(THOROUGH, settings.get_profile("quick"), max_examples=30)
settings.load_profile("quick")

# What a shell starts in the background ignores SIGINT, and what the tests start would, too.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The workers fill the processors already: threads that wait in a loop would hold them up.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What is compiled is kept for the workers, for what the tests start and for the next time, and not
# among the user's. The larger it is, the longer a process takes to open it.
if "HEYOKA_CACHE_DIR" not in os.environ:
    _compiled = Path(__file__).parents[1] / ".pytest_cache" / "compiled"
    if sum(file.stat().st_size for file in _compiled.glob("*")) > 100 << 20:
        rmtree(_compiled)
    os.environ["HEYOKA_CACHE_DIR"] = str(_compiled)

STARTING_FIXTURES = {"cluster", "processes", "start", "start_stickslip", "with_packages"}

_STARTS = {"os.fork", "os.forkpty", "os.posix_spawn", "os.system", "subprocess.Popen"}
_FOUND_BY_LIBRARIES = {"fc-list", "ldconfig", "/sbin/ldconfig"}
"""Programs that libraries ask about the machine, once."""

_started: list[str] = []


def _note_start(event: str, arguments: tuple[object, ...]) -> None:
    if event in _STARTS and (not arguments or arguments[0] not in _FOUND_BY_LIBRARIES):
        _started.append(f"{event} {arguments[:2]}")


sys.addaudithook(_note_start)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests whose fixtures start processes and the slow ones; deal them to the workers."""
    items[:] = dealt(items, int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))
    for item in items:
        parameters = item.callspec.params if hasattr(item, "callspec") else {}
        fixtures = set(getattr(item, "fixturenames", ())) - parameters.keys()
        if fixtures & STARTING_FIXTURES:
            item.add_marker("process")
        if function_of(item.nodeid) in listed():
            item.add_marker("slow")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect no garbage among what is imported: it stays, and would take a part of the time.

    And less often among the rest.
    """
    gc.set_threshold(20_000)
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def dealt(items: list[pytest.Item], workers: int) -> list[pytest.Item]:
    """Let every worker begin with long tests: of a list, the first gets the first share, and so on.

    A page of the docs takes a minute; of other modules one worker gets all long tests, since they
    may share what takes long.
    """
    others = [item for item in items if "long" not in item.keywords]
    units: dict[object, list[pytest.Item]] = {}
    for item in items:
        if "long" in item.keywords:
            is_page = item.path.name == "test_pages.py"
            units.setdefault(item if is_page else item.path, []).append(item)
    first = sorted(units.values(), key=lambda unit: "test_pages" not in unit[0].nodeid)
    order: list[pytest.Item] = []
    for number in range(workers):
        share = (len(items) - len(order)) // (workers - number)
        begin = [item for unit in first[number::workers] for item in unit]
        rest = max(0, share - len(begin))
        order += begin + others[:rest]
        others = others[rest:]
    return order + others


def pytest_runtest_setup() -> None:
    """Begin before the fixtures of a module or of the session are made."""
    _started.clear()


@pytest.fixture(autouse=True)
def _no_process_unless_marked(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    start = BaseProcess.start

    def note_and_start(process: BaseProcess) -> None:
        _started.append(f"multiprocessing {process.name}")
        start(process)

    monkeypatch.setattr(BaseProcess, "start", note_and_start)
    yield
    if _started and not {"long", "process"}.intersection(request.keywords):
        pytest.fail(f"starts a process and is not marked `process`: {_started[0]}")


@pytest.fixture
def coarse_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute the transitions of a map at fewer places than its picture would want."""
    monkeypatch.setattr("stickslip_ros.studies.transitions._MAP_POINTS", 8)
