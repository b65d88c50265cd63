"""Versions of the software that computed a result."""


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
