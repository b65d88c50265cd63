"""Versions of the software that computed a result."""

import platform
from importlib import metadata


def versions() -> dict[str, str]:
    """Return the versions of Python, this package and the packages that its results depend on."""
    found = {"python": platform.python_version()}
    for package in ("stickslip_ros", "heyoka", "numpy", "mcap", "rclpy"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found
