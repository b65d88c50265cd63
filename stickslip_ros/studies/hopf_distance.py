"""Distance of a belt speed from the Hopf speed, which also reveals a wrong unit."""

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.theory.hopf import hopf_points


def hopf_ratio(drive: Drive) -> float | None:
    """Return the belt speed over the nearest Hopf speed; None without one or at zero speed.

    A drive that the theory does not cover has none.
    """
    try:
        speeds = [point.belt_speed for point in hopf_points(drive)]
    except InvalidInputError:
        return None
    speed = abs(drive.belt_speed)
    if not speeds or speed == 0.0:
        return None
    return min((speed / each for each in speeds), key=lambda ratio: max(ratio, 1.0 / ratio))


def hopf_distance(drive: Drive) -> str:
    """Return a clause on the belt speed and the nearest Hopf speed; empty without one."""
    ratio = hopf_ratio(drive)
    if ratio is None:
        return ""
    unit = "" if drive.is_dimensionless else " m/s"
    speed = abs(drive.belt_speed)
    clause = f"{speed:.4g}{unit} is {ratio:.4g} times the Hopf speed of {speed / ratio:.4g}{unit}"
    return clause if drive.is_dimensionless else f"{clause} (belt speeds are in m/s)"
