"""What only some commands need: ROS, and what the dashboard is made with."""

import signal
from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from stickslip_ros.errors import RunError


def ros_nodes(module: str) -> ModuleType:
    """Return a module of `nodes`; the commands that need no ROS do without.

    Raises RunError where ROS cannot be loaded.
    """
    try:
        with interrupts_kept():
            import_module("stickslip_ros.nodes.base.shared_memory").check_shared_memory()
            return import_module(f"stickslip_ros.{module}")
    except ModuleNotFoundError as error:
        raise RunError(
            f"running nodes needs ROS 2, of which {error.name} is not installed: "
            "pip install 'stickslip_ros[ros]', or source an installed ROS 2"
        ) from None


@contextmanager
def interrupts_kept() -> Generator[None]:
    """Let SIGINT wait: where it meets a C extension being loaded, it becomes an ImportError."""
    kept: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: kept.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if kept:
            signal.raise_signal(signal.SIGINT)


def check_dashboard() -> None:
    """Raise RunError if what the dashboard is made with is not installed."""
    if find_spec("nicegui") is None:
        raise RunError(
            "the dashboard needs NiceGUI, which is not installed: "
            "pip install 'stickslip_ros[dashboard]'"
        )
