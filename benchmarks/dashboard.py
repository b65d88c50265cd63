"""Does the dashboard slow the simulation down?

Ours: plant, controller and analyzer as three processes, as in `stickslip run`, with a dashboard
whose page is open in a headless Chromium, which draws without a graphics processor. Peers: the same
processes with a dashboard without a page, and without a dashboard. Scenario `paper` in lockstep
gives the steps per second, `feed_drive` in real time at 1 kHz the missed deadlines, the late
forces, and the processor time of server and browser, and the page the frames drawn per second.

All run in turns, one slice at a time; meanwhile the other dashboards are stopped and the other
pages empty.
"""

import os
import shutil
import signal
import socket
import sys
import time
import urllib.request
from collections.abc import Callable, Generator, Iterable
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from statistics import median
from typing import TYPE_CHECKING
from urllib.error import URLError

from benchmarks.parties import (
    READY_TIMEOUT,
    ObservedPlant,
    Slice,
    closed_loop,
    party,
    results_by_turns,
)
from benchmarks.slices import Row, compare_rates, lacks, show
from stickslip_ros.nodes.base.child_process import start_child

if TYPE_CHECKING:
    from psutil import Process

LOCKSTEP_ROUNDS = 9
LOCKSTEP_TIME = 3.0
"""Approximate duration of a slice in lockstep, s."""
REALTIME_ROUNDS = 6
REALTIME_SAMPLES = 10_000
FIRST_SAMPLES = 1_000

NOBODY, UNSEEN, SEEN = "no dashboard", "a dashboard without a page", "a dashboard with its page"


@dataclass(frozen=True)
class Figures:
    """The results of a slice."""

    steps_per_second: float
    missed_deadlines: int
    late_forces: int
    frames_per_second: float
    server: float
    """Processors that the server kept busy, with what it computes in other processes."""
    browser: float
    """Processors that the browser kept busy."""


@dataclass(frozen=True)
class Spent:
    """Work and resources of a dashboard so far."""

    frames: float = 0.0
    server: float = 0.0
    """Processor time, s."""
    browser: float = 0.0
    """Processor time, s."""


Watch = Callable[[], Spent]
"""Returns what a dashboard has done and used so far."""


@contextmanager
def watched(scenario: str, by: str) -> Generator[Slice[Figures]]:
    with ExitStack() as resources:
        loop = resources.enter_context(closed_loop(ObservedPlant, scenario, composed=False))
        watching = partial(nullcontext, Spent)
        if by != NOBODY:
            watching = resources.enter_context(dashboard(with_page=by == SEEN))

        def run(samples: int) -> Figures:
            with watching() as watch:
                started, before = time.monotonic(), watch()
                loop.run(samples)
                after, duration = watch(), time.monotonic() - started
            figures = loop.plant.diagnose()[2]
            return Figures(
                figures["steps_per_second"],
                figures["missed_deadlines"],
                figures["late_forces"],
                (after.frames - before.frames) / duration,
                (after.server - before.server) / duration,
                (after.browser - before.browser) / duration,
            )

        yield run


@contextmanager
def dashboard(*, with_page: bool) -> Generator[Callable[[], AbstractContextManager[Watch]]]:
    """Start a dashboard, and a browser; yield a context manager in which they are active."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    url = f"http://127.0.0.1:{port}"
    command = [sys.executable, "-m", "stickslip_ros.app.main", "dashboard", "--port", str(port)]
    with ExitStack() as resources:
        process = start_child(command)
        resources.callback(process.wait)
        resources.callback(process.terminate)
        resources.callback(process.send_signal, signal.SIGCONT)
        page = None
        if with_page:
            from playwright.sync_api import sync_playwright

            playwright = resources.enter_context(sync_playwright())
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
            resources.callback(browser.close)
            page = browser.new_page(viewport={"width": 1400, "height": 1060})
        wait_for_page(url)
        os.kill(process.pid, signal.SIGSTOP)

        def watch() -> Spent:
            import psutil

            server = psutil.Process(process.pid)
            own = psutil.Process().children(recursive=True)
            return Spent(
                page.evaluate("stickslip.frames") if page is not None else 0.0,
                _processor_time([server, *server.children(recursive=True)]),
                _processor_time(each for each in own if each.name().startswith("chrom")),
            )

        @contextmanager
        def watching() -> Generator[Watch]:
            os.kill(process.pid, signal.SIGCONT)
            if page is not None:
                page.goto(url)
                page.wait_for_function("stickslip.frames > 5")
            yield watch
            if page is not None:
                page.goto("about:blank")
            os.kill(process.pid, signal.SIGSTOP)

        yield watching


def _processor_time(processes: Iterable["Process"]) -> float:
    times = [process.cpu_times() for process in processes]
    return sum(each.user + each.system for each in times)


def wait_for_page(url: str) -> None:
    deadline = time.monotonic() + READY_TIMEOUT
    while True:
        try:
            urllib.request.urlopen(url).close()
            return
        except URLError as error:
            if time.monotonic() > deadline:
                raise SystemExit(f"{url} did not answer in {READY_TIMEOUT} s: {error}") from None
            time.sleep(0.1)


def lacking() -> str | None:
    """Return what this needs, and how to install it, if something is not installed."""
    if shutil.which("chromium") is None:
        return "chromium: sudo apt-get install chromium"
    for module in ("playwright", "psutil"):
        if find_spec(module) is None:
            return f"{module}: pip install {module}"
    return None


def measure() -> list[Row]:
    if needed := lacking():
        lacks(needed)
    return [*lockstep_rows(), *realtime_rows()]


def lockstep_rows() -> list[Row]:
    figures, failures = results_by_turns(
        LOCKSTEP_ROUNDS,
        {by: party(watched, "paper", by) for by in (SEEN, UNSEEN, NOBODY)},
        lambda run: round(LOCKSTEP_TIME * run(FIRST_SAMPLES).steps_per_second),
    )
    rates = {by: [each.steps_per_second for each in slices] for by, slices in figures.items()}
    seen = rates.pop(SEEN, None)
    if seen is None:
        return failures
    rows = [compare_rates("steps in lockstep, page open", seen, by, rates[by]) for by in rates]
    return rows + failures


def realtime_rows() -> list[Row]:
    def count(run: Slice[Figures]) -> int:
        run(FIRST_SAMPLES)
        return REALTIME_SAMPLES

    figures, failures = results_by_turns(
        REALTIME_ROUNDS,
        {by: party(watched, "feed_drive", by) for by in (SEEN, UNSEEN, NOBODY)},
        count,
    )
    seen = figures.pop(SEEN, None)
    if seen is None:
        return failures
    rows: list[Row] = []
    samples = REALTIME_ROUNDS * REALTIME_SAMPLES
    for by, slices in figures.items():
        for what in ("missed_deadlines", "late_forces"):
            ours, peer = (float(sum(getattr(e, what) for e in each)) for each in (seen, slices))
            name = f"{what.replace('_', ' ')} of {samples} at 1 kHz, page open"
            rows.append(Row(name, "", ours, by, peer, peer / max(ours, 1.0)))
    for what, unit in (("frames_per_second", "1/s"), ("server", "cores"), ("browser", "cores")):
        name = f"{what.replace('_', ' ')} at 1 kHz, page open"
        rows.append(Row(name, unit, median(getattr(each, what) for each in seen)))
    return rows + failures


if __name__ == "__main__":
    show(__doc__, measure)
