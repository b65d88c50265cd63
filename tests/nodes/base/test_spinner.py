"""Waiting for conditions while nodes run, also while the system's clock is set back."""

import platform
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.task import Future
from typing_extensions import override

from stickslip_ros.nodes.base.process import loopback_session
from stickslip_ros.nodes.base.spinner import (
    Spinner,
    signal_handlers_kept,
    spin,
    steady_clock,
    stop_on_signals,
)
from tests.nodes.graph import PATIENCE, wait_for

# What the library waits for by the system's clock takes as much longer as that is set back.
_CLOCK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <time.h>

static volatile long back;
static int (*gettime)(clockid_t, struct timespec *);
static int (*wait)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);

__attribute__((constructor)) static void find(void) {
    gettime = dlsym(RTLD_NEXT, "clock_gettime");
    wait = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
}

void set_back(long seconds) { back = seconds; }

int clock_gettime(clockid_t clock, struct timespec *time) {
    if (!gettime) find();
    int failed = gettime(clock, time);
    if (clock == CLOCK_REALTIME) time->tv_sec -= back;
    return failed;
}

int pthread_cond_timedwait(
    pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *deadline) {
    if (deadline->tv_sec < 1000000000) return wait(condition, mutex, deadline);
    for (;;) {
        long before = back;
        struct timespec due = {deadline->tv_sec + before, deadline->tv_nsec};
        int failed = wait(condition, mutex, &due);
        if (failed != ETIMEDOUT || before == back) return failed;
    }
}
"""

_WAIT = """
import ctypes, sys, threading, time
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from stickslip_ros.nodes.base.process import ros_session

with ros_session() as spinner:
    spinner.add(Node("waiting"))
    before = time.time()
    threading.Timer(0.2, ctypes.CDLL(sys.argv[1]).set_back, [1000]).start()
    assert not spinner.spin_until(lambda: False, 0.5)
    assert time.time() < before
"""


@pytest.fixture
def spinner(domain: int) -> Iterator[Spinner]:
    with loopback_session(domain, ["--ros-args"]) as spinner:
        spinner.add(Node("waiting", context=spinner.executor.context))
        yield spinner


def test_time_ends_waiting_though_there_is_always_a_callback_to_run(spinner: Spinner) -> None:
    def call_again() -> None:
        spinner.executor.create_task(call_again)
        spinner.executor.create_task(lambda: None)

    call_again()
    started = time.monotonic()
    assert not spinner.spin_until(lambda: False, 0.1)
    assert time.monotonic() - started < 10.0


def test_waiting_is_cut_short(spinner: Spinner) -> None:
    rung: list[None] = []
    other = Node("ringing", context=spinner.executor.context)
    spinner.add(other)
    other.create_timer(0.05, lambda: rung.append(None))
    spinner.is_cut_short = lambda: bool(rung)
    assert not spinner.spin_until(lambda: False)
    assert not spinner.spin_until(lambda: True)


def test_timers_ring_at_their_period_after_an_executor_that_did_not_run(spinner: Spinner) -> None:
    """Else a node that waited would do everything many times, and then nothing for long."""
    node = Node("ringing", context=spinner.executor.context)
    spinner.add(node)
    rung: list[float] = []
    period = 0.5
    node.create_timer(period, lambda: rung.append(time.monotonic()), clock=steady_clock(node))
    spinner.spin_until(lambda: bool(rung), PATIENCE)
    until = time.monotonic() + 4.0 * period
    wait_for(lambda: time.monotonic() > until, "time passes and nothing runs")
    assert spinner.spin_until(lambda: len(rung) > 3, PATIENCE)
    assert rung[3] - rung[1] > 0.99 * period  # the first one is late by an unknown part of it


@pytest.mark.process
def test_a_wait_ends_though_the_clock_is_set_back(
    tmp_path: Path, process_environment: dict[str, str]
) -> None:
    compiler = shutil.which("cc")
    if compiler is None or platform.libc_ver()[0] != "glibc":
        pytest.skip("the clock cannot be replaced here")
    (tmp_path / "clock.c").write_text(_CLOCK)
    clock = tmp_path / "clock.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", clock, tmp_path / "clock.c"], check=True)
    subprocess.run(
        [sys.executable, "-c", _WAIT, clock],
        env={**process_environment, "LD_PRELOAD": str(clock)},
        timeout=PATIENCE,
        check=True,
    )


def test_a_session_destroys_its_nodes_however_it_ends(domain: int) -> None:
    made: list[Node] = []
    with suppress(ZeroDivisionError), loopback_session(domain, ["--ros-args"]) as spinner:
        made.append(Node("left_behind", context=spinner.executor.context))
        spinner.add(made[0])
        raise ZeroDivisionError
    with pytest.raises(InvalidHandle):
        made[0].get_name()


class InterruptedFuture(Future):
    """Is interrupted, once, when a callback is added to it, while it holds its lock."""

    interrupts = 0

    @override
    def _pending(self) -> bool:
        if not self.interrupts:
            self.interrupts += 1
            signal.raise_signal(signal.SIGINT)
        return super()._pending()


@pytest.mark.timeout(PATIENCE)
def test_a_signal_completes_a_future_whose_lock_is_held(spinner: Spinner) -> None:
    stopped = InterruptedFuture()
    with signal_handlers_kept():
        stop_on_signals(spinner.executor, stopped)
        spin(spinner.executor, stopped)
    assert stopped.interrupts == 1


def test_each_signal_completes_the_next_future(spinner: Spinner) -> None:
    stop, hurry = Future(), Future()
    with signal_handlers_kept():
        stop_on_signals(spinner.executor, stop, hurry)
        signal.raise_signal(signal.SIGTERM)
        spin(spinner.executor, stop)
        assert not hurry.done()
        for _ in range(2):
            signal.raise_signal(signal.SIGINT)
        spin(spinner.executor, hurry)


def test_signals_have_their_handlers_again_after_a_run() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with signal_handlers_kept():
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    assert signal.getsignal(signal.SIGTERM) is before
