"""Why a motion has no measures."""

from math import inf
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip_ros.physics.model.drive import Drive

_FAR = 10.0
"""Ratio of belt speed and Hopf speed beyond which the unit is probably wrong."""


def why_no_cycle(regime: str | None, duration: float, drive: "Drive | None") -> str | None:
    """Return why a motion over `duration` (s) has no regime; None if it has one."""
    if regime is not None:
        return None
    from stickslip_ros.plots.units import Units
    from stickslip_ros.studies.hopf_distance import hopf_distance, hopf_ratio

    units = Units.for_drive(drive)
    said = f"no whole cycle was completed in {duration:g} {units.of_unit('s')}".rstrip()
    if drive is None:
        return said
    period = drive.natural_period
    if duration < 3.0 * period < inf:
        return f"{said}: the natural period is {units.text(period, 's')}, so run it for longer"
    ratio = hopf_ratio(drive)
    if ratio is not None and not 1.0 / _FAR < ratio < _FAR:
        return f"{said}: the slide has neither turned back nor settled; {hopf_distance(drive)}"
    return f"{said}: the slide has neither turned back twice nor settled; run it for longer"
