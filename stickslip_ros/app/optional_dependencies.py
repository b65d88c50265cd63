"""What only some commands need: ROS, and the packages of the dashboard."""

import signal
from collections.abc import Generator
from contextlib import contextmanager
from importlib.util import find_spec

from stickslip_ros.errors import RunError


@contextmanager
def loading_ros() -> Generator[None]:
    """Wrap the imports that need ROS; raises RunError if ROS cannot be loaded."""
    from stickslip_ros.nodes.base.shared_memory import check_shared_memory

    try:
        with interrupts_kept():
            check_shared_memory()
            yield
    except ModuleNotFoundError as error:
        raise RunError(
            f"running nodes needs ROS 2, of which {error.name} is not installed: "
            "pip install 'stickslip_ros[ros]', or source an installed ROS 2"
        ) from None


@contextmanager
def interrupts_kept() -> Generator[None]:
    """Delay SIGINT: during the import of a C extension it would become an ImportError."""
    kept: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: kept.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if kept:
            signal.raise_signal(signal.SIGINT)


def check_dashboard() -> None:
    """Raise RunError if the packages of the dashboard are not installed."""
    if find_spec("nicegui") is None:
        raise RunError(
            "the dashboard needs NiceGUI, which is not installed: "
            "pip install 'stickslip_ros[dashboard]'"
        )
