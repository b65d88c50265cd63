import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.nodes.conftest import domain, process_environment  # noqa: F401 - fixtures used here
from tests.nodes.graph import PATIENCE

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def stickslip(process_environment: dict[str, str], tmp_path: Path) -> Run:  # noqa: F811
    """Run a command of the entry script in an empty directory, and return what it came to."""

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "stickslip_ros.app.main", *arguments],
            cwd=tmp_path,
            env=process_environment,
            capture_output=True,
            text=True,
            timeout=3 * PATIENCE,
        )

    return run


@pytest.fixture
def start_stickslip(
    process_environment: dict[str, str],  # noqa: F811
    tmp_path: Path,
) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start a command of the entry script in an empty directory; it is ended after the test."""
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-m", "stickslip_ros.app.main", *arguments],
            cwd=tmp_path,
            env=process_environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)
