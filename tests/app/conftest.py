import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import chdir
from pathlib import Path
from unittest import mock

import pytest
from rclpy.logging import LoggingSeverity, set_logger_level

from stickslip_ros.app.main import main
from tests.nodes.conftest import domain, process_environment  # noqa: F401 - fixtures used here
from tests.nodes.graph import PATIENCE

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def stickslip(
    process_environment: dict[str, str],  # noqa: F811
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> Run:
    """Run a command of the entry script in an empty directory, and return what it came to.

    It runs in this process; the nodes that it starts are processes all the same, and what they
    print belongs to its output.
    """

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        environment = mock.patch.dict(os.environ, process_environment, clear=True)
        with environment, chdir(tmp_path), pytest.raises(SystemExit) as ended:
            main(arguments)
        set_logger_level("", LoggingSeverity.INFO)  # a run has raised it for the whole process
        return subprocess.CompletedProcess(arguments, ended.value.code, *capfd.readouterr())

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
