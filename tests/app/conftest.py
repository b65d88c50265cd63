import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import chdir
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from rclpy.logging import LoggingSeverity, set_logger_level

from stickslip_ros.app.main import main
from stickslip_ros.nodes.base.spinner import signal_handlers_kept
from tests.nodes.conftest import domain, graph, process_environment  # noqa: F401 - used here
from tests.nodes.graph import PATIENCE

REFERENCE = str(Path(__file__).parents[2] / "bags" / "reference")

Done = subprocess.CompletedProcess[str]
Start = Callable[..., subprocess.Popen[str]]


class Run:
    """Runs a command of the entry script in a directory, and returns what it came to.

    It runs in this process; the nodes that it starts are processes all the same, and what they
    print belongs to its output.
    """

    def __init__(
        self, directory: Path, environment: dict[str, str], capfd: pytest.CaptureFixture[str]
    ) -> None:
        self._directory, self._environment, self._capfd = directory, environment, capfd

    def __call__(self, *arguments: str) -> Done:
        environment = mock.patch.dict(os.environ, self._environment, clear=True)
        here = chdir(self._directory)
        with environment, here, signal_handlers_kept(), pytest.raises(SystemExit) as ended:
            main(arguments)
        set_logger_level("", LoggingSeverity.INFO)  # a run has raised it for the whole process
        return Done(arguments, ended.value.code, *self._capfd.readouterr())

    def json(self, *arguments: str) -> Any:
        """Return what a command that succeeds prints with --json."""
        done = self(*arguments, "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout, parse_constant=_refuse)


def _refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is not JSON")


class RunOfItsOwn(Run):
    """Runs a command in a process of its own, which finds further packages in the directory."""

    def __init__(self, directory: Path, environment: dict[str, str]) -> None:
        self._directory = directory
        path = filter(None, [str(directory), environment.get("PYTHONPATH")])
        self._environment = environment | {"PYTHONPATH": os.pathsep.join(path)}

    def __call__(self, *arguments: str) -> Done:
        return subprocess.run(
            [sys.executable, "-m", "stickslip_ros.app.main", *arguments],
            cwd=self._directory,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )


@pytest.fixture
def stickslip(
    process_environment: dict[str, str],  # noqa: F811
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> Run:
    return Run(tmp_path, process_environment, capfd)


@pytest.fixture
def start_stickslip(
    process_environment: dict[str, str],  # noqa: F811
    tmp_path: Path,
) -> Iterator[Start]:
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


def ended(process: subprocess.Popen[str], status: int, number: int = 0) -> tuple[str, str]:
    """Return what a process has printed that ends with this status, after a signal if one is given.

    Its standard output, and its standard error from now on.
    """
    process.send_signal(number)
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == status, errors
    return output, errors
