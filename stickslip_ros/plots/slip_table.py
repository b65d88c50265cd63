"""Table of the slips of a record."""

from collections.abc import Mapping, Sequence
from typing import Any

from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.plots.units import Units

_ROWS = (
    ("time of sticking", "stick_time", "s"),
    ("drop", "drop", "m"),
    ("time of slipping", "slip_time", "s"),
    ("velocity while sticking", "stick_velocity", "m/s"),
)
_COLUMNS = ("mean", "standard_error", "q05", "median", "q95")


def slip_table(
    slips: Mapping[str, Any], units: Units
) -> tuple[str, Sequence[str], list[Sequence[str]]]:
    """Return title, headings and rows of the distributions that `SlipMeter.report` has."""
    regime = Regime.label(slips["regime"])
    title = f"{slips['count']} slips of more than {units.text(slips['least_drop'], 'm')}: {regime}"
    rows: list[Sequence[str]] = []
    for label, name, unit in _ROWS:
        found = slips[name]
        if found is not None:
            rows.append([label, *(units.text(found[column], unit) for column in _COLUMNS)])
    if slips["belt_speed"]:
        rows.append(["belt speed", units.text(slips["belt_speed"], "m/s"), "", "", "", ""])
    return title, ["", "mean", "standard error", "5 %", "median", "95 %"], rows
