"""Installed packages: ROS packages and their executables, and versions of software."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.text import did_you_mean

_MARKERS = "share/ament_index/resource_index/packages"


def prefixes() -> list[Path]:
    """Return the prefixes in which ROS packages are installed, in search order.

    The prefix of the Python environment comes last: ROS wheels install there without a set-up
    script.
    """
    given = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return [Path(prefix) for prefix in [*filter(None, given), sys.prefix]]


def find_executable(name: str) -> Path:
    """Return the file of the executable PACKAGE/EXECUTABLE, found as by `ros2 run`.

    A name that ends in .py may also be the path of a script. Raises InvalidInputError for one that
    is not installed, or does not exist.
    """
    if name.endswith(".py"):
        script = Path(name)
        if script.is_file():
            return script.absolute()
        if name.count("/") != 1:
            raise InvalidInputError(f"{name}: there is no such file")
    package, _, executable = name.partition("/")
    if not package or not executable or "/" in executable:
        raise InvalidInputError(
            f"{name}: must be PACKAGE/EXECUTABLE, such as stickslip_ros/controller_node, "
            "or the path of a Python script"
        )
    prefix = next((p for p in prefixes() if (p / _MARKERS / package).is_file()), None)
    if prefix is None:
        known = {marker.name for p in prefixes() for marker in (p / _MARKERS).glob("*")}
        places = "searched are AMENT_PREFIX_PATH and the Python environment"
        raise InvalidInputError(
            f"{name}: no package {package} in {', '.join(map(str, prefixes()))}; "
            f"{did_you_mean(package, known, places)}"
        )
    files = {file.name: file for file in _executables(prefix / "lib" / package)}
    if executable not in files:
        raise InvalidInputError(
            f"{name}: the package {package} in {prefix} has no executable {executable}; "
            + did_you_mean(executable, files, f"it has {', '.join(sorted(files)) or 'none'}")
        )
    return files[executable]


def versions() -> dict[str, str]:
    """Return the versions of Python, this package and the packages that its results depend on."""
    import platform  # these two take longer to import than the start of a command should take
    from importlib import metadata

    by_package = {"python": platform.python_version()}
    for package in ("stickslip_ros", "heyoka", "numpy", "mcap", "rclpy"):
        try:
            by_package[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return by_package


def _executables(folder: Path) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder):
        folders[:] = sorted(folder for folder in folders if not folder.startswith("."))
        yield from (
            Path(parent, file) for file in sorted(files) if os.access(Path(parent, file), os.X_OK)
        )
