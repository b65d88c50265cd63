"""The tables of a design: the proposal, its margins, and what it does at each belt speed."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from stickslip_ros.plots.units import Units
from stickslip_ros.studies.design import Design
from stickslip_ros.tables import TextTable

CONTROLLER = {
    "corner_frequency": ("cutoff frequency", "rad/s"),
    "linear_gain": ("linear gain", "N s/m"),
    "cubic_gain": ("cubic gain", "N s^3/m^3"),
    "force_limit": ("force limit", "N"),
    "start_after": ("start after", "s"),
}

MARGINS = {
    "gain_down": ("unstable below this share of the linear gain", ""),
    "gain_up": ("unstable above this multiple of it", ""),
    "delay": ("delay margin", "s"),
}
WORST = {
    "predicted_settling_time": ("1 % settling time, predicted", "s"),
    "settling_time": ("simulated", "s"),
    "predicted_peak_force": ("peak force, predicted", "N"),
    "peak_force": ("simulated", "N"),
}
CHECKS = {"belt_speed": ("belt speed", "m/s"), "vibrates": ("vibrates", "")} | WORST

REST = {
    "amplitude": ("amplitude", "m"),
    "peak_force": ("peak force", "N"),
    "rms_force": ("rms force", "N"),
}


def design_tables(name: str, found: Design) -> Iterator[TextTable | str]:
    """Yield the tables of a design for the scenario of that name, and the remark on it."""
    units = Units.for_drive(found.task.drive)
    speeds = units.texts(sorted({*found.task.belt_speeds}), "m/s")
    task = f"{name}, belt speed {' to '.join(speeds)}"
    if found.controller is None:
        yield f"{task}: nothing to propose"
    else:
        values = {
            name: None if value == float("inf") else value
            for name, value in asdict(found.controller).items()
        }
        yield TextTable(task, ["proposal", ""], _rows(values, CONTROLLER, units))
        if found.margins is not None:
            margins = _rows(asdict(found.margins), MARGINS, units)
            yield TextTable("margins at the worst of these belt speeds", ["margins", ""], margins)
        checks = [asdict(check) for check in found.checks]
        columns = [
            units.texts([check[key] for check in checks], unit) for key, (_, unit) in CHECKS.items()
        ]
        headings = [label for label, _ in CHECKS.values()]
        rows = list(zip(*columns, strict=True))
        yield TextTable("verification", headings, rows)
        yield from _at_rest(found, units)
    if found.remark is not None:
        yield found.remark


def _at_rest(found: Design, units: Units) -> Iterator[TextTable]:
    """Yield what noise and rounding leave at the equilibrium, if there are any."""
    left = [(check.belt_speed, check.rest) for check in found.checks if check.rest is not None]
    if not left:
        return
    columns = [units.texts([speed for speed, _ in left], "m/s")]
    for name, (_, unit) in REST.items():
        columns.append(units.texts([getattr(rest, name) for _, rest in left], unit))
    headings = ["belt speed", *(label for label, _ in REST.values())]
    yield TextTable("at rest, by noise and rounding", headings, list(zip(*columns, strict=True)))


def _rows(
    figures: Mapping[str, Any], labels: Mapping[str, tuple[str, str]], units: Units
) -> list[list[str]]:
    return [[label, units.text(figures[key], unit)] for key, (label, unit) in labels.items()]
