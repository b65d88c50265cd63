"""The shell of a reader in a copy of the checkout, and the other terminals."""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import sysconfig
import time
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event
from typing import Any

from stickslip_ros.app import INTERRUPTED
from stickslip_ros.nodes.base.network import this_machine_only
from tests.docs.page import CHECKOUT
from tests.nodes.graph import PATIENCE, wait_for

# Variables that tie a process to the installation in which the tests run.
OURS = (
    *("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH"),
    *("LD_LIBRARY_PATH", "PYTHONPATH"),
)
# Variables that make, pytest and the fixtures of a test set.
_CALLERS = (
    *this_machine_only(),
    *("MAKEFLAGS", "MAKELEVEL", "MFLAGS", "PYTEST_ADDOPTS", "VENV", "VIRTUAL_ENV"),
)

_STAMPS = (".ready", ".complete")
"""Files by which `make` knows what an environment has, the oldest first."""

_INTERRUPTED = {"stickslip": {INTERRUPTED}, "ros2 topic": {signal.SIGINT}}
_OTHERS_INTERRUPTED = {0, -signal.SIGINT}
"""The status with which a program ends by Ctrl-C."""

_SIGNS = {
    "ros2 topic": "\n",
    "stickslip": "\n",
    "dask scheduler": "Scheduler at:",
    "dask worker": "Registered to:",
}
_ACTIVE = "]: active"
"""Texts that programs, and our nodes, print when they are up."""

_HEARS_A_JOINT_STATE = "ros2 topic echo --once /feed_drive/joint_states"

_ROS_SETUP = f"""
export AMENT_PREFIX_PATH={sys.prefix}
export LD_LIBRARY_PATH={os.environ.get("LD_LIBRARY_PATH", "")}
export PYTHONPATH={sysconfig.get_path("purelib")}
"""
"""Set-up script of an installed ROS: makes the ROS of the tests visible to other environments."""

_ROS2 = f"""#!/bin/sh
if [ "$1" = run ]; then
  IFS=:
  for prefix in $AMENT_PREFIX_PATH; do
    if [ -e "$prefix/share/ament_index/resource_index/packages/$2" ]; then
      program=$prefix/lib/$2/$3
      shift 3
      exec env -u _ROS_WHEELS_BOOTSTRAP_COMPLETE "$program" "$@"
    fi
  done
  exit 1
fi
PYTHONPATH={CHECKOUT} exec {sys.executable} -m tests.docs.ros2 "$@"
"""
"""Stand-in for `ros2`."""

_TO_END = 10.0
"""How long, s, the processes of a page may take to end when their terminal is closed."""

_NEVER = Event()

_TRACEBACK = "Traceback (most recent call last)"


def copy_checkout(to: Path) -> None:
    """Copy the files that git has or would add, so that the original does not change."""
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.check_output(listing, cwd=CHECKOUT, text=True).split("\0")
    for name in filter(None, names):
        if (CHECKOUT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(CHECKOUT / name, to / name)


def copy_compiled(to: Path) -> None:
    """Copy what Python has compiled of the package: in each copy it would be compiled again."""
    for compiled in (CHECKOUT / "stickslip_ros").rglob("__pycache__/*.pyc"):
        (to / compiled.relative_to(CHECKOUT)).parent.mkdir(exist_ok=True)
        shutil.copy2(compiled, to / compiled.relative_to(CHECKOUT))


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Shell:
    """Runs the commands of a page, in a directory and an environment that carry over."""

    def __init__(self, scratch: Path, domain: int) -> None:
        self.checkout = scratch / "stickslip_ros"
        copy_checkout(self.checkout)
        copy_compiled(self.checkout)
        self._scratch = scratch
        self._common = {k: v for k, v in os.environ.items() if k not in _CALLERS}
        self._common |= {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(scratch / "log"),
            "PIP_COMPILE": "0",
            "PYTHONFAULTHANDLER": "1",
            "PORT": str(free_port()),
            "ROS_SETUP": str(scratch / "setup.bash"),
        }
        self._directory = self.checkout
        self._fill_environment()
        stand_in = scratch / "bin" / "ros2"
        stand_in.parent.mkdir()
        stand_in.write_text(_ROS2)
        stand_in.chmod(0o755)
        (scratch / "setup.bash").write_text(_ROS_SETUP)
        self._path = [str(stand_in.parent), self._common["PATH"]]
        self._environment = self._common | {
            "PATH": os.pathsep.join([str(Path(sys.executable).parent), *self._path]),
            "AMENT_PREFIX_PATH": sys.prefix,
            "PYTHONPATH": str(self.checkout),  # changes of a page in its copy take effect
            "PIP_NO_INDEX": "1",  # `.venv` is not a copy
        }

    def _fill_environment(self) -> None:
        """Make a `.venv` as `make` does: the one of the tests, up to date."""
        environment = self.checkout / ".venv"
        environment.mkdir()
        for entry in Path(sys.prefix).iterdir():
            if entry.name not in _STAMPS:
                (environment / entry.name).symlink_to(entry)
        for stamp in _STAMPS:
            (environment / stamp).touch()

    def renew(self) -> None:
        """Reset the environment to that of a new shell."""
        self._environment = {k: v for k, v in self._common.items() if k not in OURS} | {
            "PATH": os.pathsep.join([f"{sys.base_prefix}/bin", *self._path])
        }
        environment = self.checkout / ".venv"
        if (environment / "bin").is_symlink():
            shutil.rmtree(environment)
        self._directory = self.checkout

    def path(self, name: str) -> Path:
        """The file of that name in the directory of the reader."""
        return self._directory / name

    def run(self, script: str, timeout: float) -> tuple[int, str]:
        """Run a script to its end; return exit status and output."""
        state = self._scratch / "state"
        state.unlink(missing_ok=True)
        process, output = self._start(["-e", "-c", f'{script}\nenv -0 >"{state}"'])
        try:
            status = process.wait(timeout)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"not done after {timeout} s:\n{output.read_text()}") from None
        finally:
            _end(process)
        if state.exists():
            pairs = (entry.split("=", 1) for entry in state.read_text().split("\0") if entry)
            self._environment = dict(pairs)
            self._directory = Path(self._environment["PWD"])
        return status, output.read_text()

    @contextmanager
    def beside(self, command: str) -> Generator[None]:
        """Run a command while others are run; it must be up, and end by Ctrl-C without an error."""
        process, output = self._start(["-c", command])

        def said() -> str:
            return f"{command}:\n{output.read_text()}"

        def is_up() -> bool:
            assert process.poll() is None, f"has ended: {said()}"
            return _of(command, _SIGNS, _ACTIVE) in output.read_text()

        try:
            wait_for(is_up, f"up: {command}")
            if "stickslip run" in command:  # whose nodes say nothing
                status, heard = self.run(_HEARS_A_JOINT_STATE, 2.0 * PATIENCE)
                assert status == 0, f"{heard}\n{said()}"
            yield
            assert process.poll() is None, f"has ended: {said()}"
            os.killpg(process.pid, signal.SIGINT)
            try:
                status = process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGABRT)  # lets Python print where it is
                process.wait(PATIENCE)
                raise AssertionError(f"does not end by Ctrl-C: {said()}") from None
        finally:
            _end(process)
        assert status in _of(command, _INTERRUPTED, _OTHERS_INTERRUPTED), (
            f"ended with status {status}: {said()}"
        )
        assert _TRACEBACK not in said(), said()

    def _start(self, arguments: list[str]) -> tuple[subprocess.Popen[bytes], Path]:
        count = len(list(self._scratch.glob("*.output")))
        output = self._scratch / f"{count}.output"
        with output.open("wb") as opened:
            process = subprocess.Popen(
                ["bash", *arguments],
                cwd=self._directory,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=opened,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        return process, output


def _of(command: str, by_program: Mapping[str, Any], otherwise: Any) -> Any:
    """The value for the program of a command, which may begin with environment variables."""
    bare = re.sub(r"^(\w+=\S* )+", "", command)
    return next((v for program, v in by_program.items() if bare.startswith(program)), otherwise)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and all processes of its session, as closing a terminal does."""
    for number in (signal.SIGHUP, signal.SIGKILL):
        deadline = time.monotonic() + _TO_END
        with suppress(ProcessLookupError):  # when none is left
            os.killpg(process.pid, number)
            while time.monotonic() < deadline:
                process.poll()
                os.killpg(process.pid, 0)
                _NEVER.wait(0.02)
