"""What a result was made with."""


def versions() -> dict[str, str]:
    """Return the versions of Python, of this package and of what its figures depend on."""
    import platform  # these two take longer to import than the start of a command should take
    from importlib import metadata

    found = {"python": platform.python_version()}
    for package in ("stickslip_ros", "heyoka", "numpy", "mcap", "rclpy"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found
