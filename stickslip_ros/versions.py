"""What a result was made with."""

import platform
from importlib import metadata


def versions() -> dict[str, str]:
    """Return the versions of Python, of this package and of what its figures depend on."""
    found = {"python": platform.python_version()}
    for package in ("stickslip_ros", "heyoka", "numpy", "mcap", "rclpy"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found
