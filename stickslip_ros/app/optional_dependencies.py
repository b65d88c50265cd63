"""Dependencies of some commands only: ROS, matplotlib, and the packages of the dashboard."""

import os
from collections.abc import Generator
from contextlib import chdir, contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from stickslip_ros.errors import RunError


@contextmanager
def loading_ros() -> Generator[None]:
    """Wrap the imports that need ROS; raises RunError if ROS cannot be loaded."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise RunError(
            f"running nodes needs ROS 2, of which {error.name} is not installed: "
            "pip install 'stickslip_ros[ros]', or source an installed ROS 2"
        ) from None


def load_matplotlib() -> None:
    """Import matplotlib without the user's settings: no figure depends on them.

    It takes them from the environment and the working directory, and fails if they are wrong.
    """
    kept = dict(os.environ)
    try:
        with chdir(Path(__file__).parent):
            os.environ.update(MPLBACKEND="agg", MATPLOTLIBRC=os.devnull)
            import_module("matplotlib")
    finally:
        os.environ.clear()
        os.environ.update(kept)


def check_dashboard() -> None:
    """Raise RunError if the packages of the dashboard are not installed."""
    if find_spec("nicegui") is None:
        raise RunError(
            "the dashboard needs NiceGUI, which is not installed: "
            "pip install 'stickslip_ros[dashboard]'"
        )
