"""The tables of runs: measures side by side, slips, and why there is no regime."""

from collections.abc import Mapping
from math import inf
from types import MappingProxyType
from typing import Any

from stickslip_ros.measures.cycle_measures import Measures, Regime, trend_text
from stickslip_ros.measures.slips import Slip
from stickslip_ros.model.drive import Drive
from stickslip_ros.quantities import quantities_of
from stickslip_ros.show.quantities import MEASURES, NOISE, SI, Units
from stickslip_ros.tables import TextTable

_SENT = {
    "peak_force": ("peak_applied_force", "peak control force sent"),
    "resting_force": ("resting_applied_force", "final control force sent"),
}
"""The measure of the force that acted, and the label of the sent force where the two differ."""

_MEANING: dict[str | None, str] = {Regime.PURE_SLIP: " (vibration without sticking)"}
"""What a machine does in a regime that has its name from dynamics."""

_SAME_SCALE = {
    "amplitude": "midpoint",
    "midpoint": "amplitude",
    "resting_force": "peak_force",
    "resting_applied_force": "peak_applied_force",
    "reversal_height_error": "reversal_height",
}
"""The quantity with which a value is compared to see whether it is rounding error."""

_DISTRIBUTION = ("mean", "standard_error", "q05", "median", "q95")

_LARGEST_RATIO = 10.0
"""Ratio of belt speed and critical feed speed beyond which the unit is probably wrong."""


def report_sentences(report: Mapping[str, Any], drive: Drive | None) -> list[str]:
    """Return what a recording lacks, what makes its measures doubtful, and why it has no regime."""
    sentences = [*report["missing"], *report["notes"]]
    if report["samples"] > 0 and not report["cycles"] and report["duration"] is not None:
        reason = why_no_cycle(report["regime"], report["duration"], drive)
        sentences += [] if reason is None else [reason]
    return sentences


def measure_table(
    title: str,
    columns: Mapping[str, Mapping[str, Any]],
    units: Mapping[str, Units] = MappingProxyType({}),
) -> TextTable:
    """Return measures by name as a table with one column for each of `columns`.

    Rows are the measures that any of the columns has. `units` are those of each column, by its
    name; the default is SI.
    """
    rows = {
        name: [label, *_row(name, unit, columns, units)]
        for name, (label, unit, _) in MEASURES.items()
        if any(name in values for values in columns.values())
    }
    _tell_apart(rows, columns)
    return TextTable(title, ["", *columns], list(rows.values()))


def _tell_apart(rows: dict[str, list[str]], columns: Mapping[str, Mapping[str, Any]]) -> None:
    """Omit the force that acted if it is unknown or equals the sent one, and drops without any.

    Omit late forces and missed deadlines, too, where no column knows them, and errors at reversals
    without a reversal.
    """
    for sent, (applied, label) in _SENT.items():
        known = [values.get(applied) is not None for values in columns.values()]
        cells = zip(known, rows.get(sent, [])[1:], rows.get(applied, [])[1:], strict=False)
        if any(is_known and of_sent != of_applied for is_known, of_sent, of_applied in cells):
            rows[sent][0] = label
        else:
            rows.pop(applied, None)
    if not any(values.get("dropped_forces") for values in columns.values()):
        rows.pop("dropped_forces", None)
    if not any(values.get("reversals") for values in columns.values()):
        for name in [name for name in rows if name.startswith("reversal_")]:
            del rows[name]
    for name in ("late_forces", "missed_deadlines"):
        if all(values.get(name) is None for values in columns.values()):
            rows.pop(name, None)


def _row(
    name: str, unit: str, columns: Mapping[str, Mapping[str, Any]], units: Mapping[str, Units]
) -> list[str]:
    """Return the cells of one row; columns in the same units have the same prefix."""
    cells: dict[str, str] = {}
    for shown_in in {units.get(column, SI) for column in columns}:
        columns_shown = [column for column in columns if units.get(column, SI) == shown_in]
        values = [_shown(name, columns[column], shown_in) for column in columns_shown]
        others = [columns[column].get(_SAME_SCALE.get(name, "")) for column in columns_shown]
        largest = max((abs(value) for value in others if value is not None), default=0.0)
        cells |= zip(columns_shown, shown_in.texts(values, unit, largest=largest), strict=True)
    return [cells[column] for column in columns]


def _shown(name: str, values: Mapping[str, Any], units: Units) -> Any:
    """Return the value to print; for a regime also whether it is steady, and doubtful."""
    value = values.get(name)
    if name == "regime" and values.get("duration", 0.0) is None:
        return "not known"
    if name == "regime":
        trend = trend_text(values, units.text)
        motion = Regime.label(value, values.get("cycles") or 0) + _MEANING.get(value, "")
        return f"{motion}{trend and f', not steady: {trend}'}{doubt(values)}"
    if name == "velocity_amplitude" and value is not None:
        amplitude, midpoint = values.get("amplitude") or 0.0, values.get("midpoint") or 0.0
        return 0.0 if amplitude <= NOISE * abs(midpoint) else value  # what is left is rounding
    return value


def measures_text(measures: Measures, units: Units) -> str:
    """Return regime, amplitude, frequency and stick fraction at the end as a line of text."""
    trend = trend_text(vars(measures), units.text)
    regime = Regime.label(measures.regime, measures.cycles)
    if measures.regime is not None:
        regime = f"at the end: {regime}"
    texts = [f"{regime}{trend and f', not steady: {trend}'}"]
    for name in ("amplitude", "frequency", "stick_fraction"):
        value, (label, unit, _) = getattr(measures, name), MEASURES[name]
        if value is not None and measures.period is not None:
            texts.append(f"{label} {units.text(value, unit)}")
    return ", ".join(texts)


def doubt(values: Mapping[str, Any]) -> str:
    """Return what is added to a regime of a report whose forces came late."""
    return ", doubtful: late forces" if values.get("in_time") is False else ""


def slip_table(slips: Mapping[str, Any], units: Units) -> TextTable:
    """Return the table of the distributions that `slip_report` has."""
    regime = Regime.label(slips["regime"])
    title = f"{slips['count']} slips of more than {units.text(slips['least_drop'], 'm')}: {regime}"
    rows = [
        [label, *(units.text(slips[name][column], unit) for column in _DISTRIBUTION)]
        for name, (label, unit, _) in quantities_of(Slip).items()
        if slips[name] is not None
    ]
    if slips["belt_speed"]:
        rows.append(["belt speed", units.text(slips["belt_speed"], "m/s"), "", "", "", ""])
    return TextTable(title, ["", "mean", "standard error", "5 %", "median", "95 %"], rows)


def why_no_cycle(regime: str | None, duration: float, drive: Drive | None) -> str | None:
    """Return why a motion over `duration` (s) has no regime; None if it has one."""
    if regime is not None:
        return None
    units = Units.for_drive(drive)
    said = f"no whole cycle was completed in {duration:g} {units.of_unit('s')}".rstrip()
    if drive is None:
        return said
    period = drive.natural_period
    likely = abs(drive.belt_speed) < _LARGEST_RATIO * drive.speed_scale
    if duration < 3.0 * period < inf and likely:
        return f"{said}: the natural period is {units.text(period, 's')}, so run it for longer"
    from stickslip_ros.theory.hopf import hopf_distance, hopf_ratio  # it takes long

    ratio = hopf_ratio(drive)
    if ratio is not None and not 1.0 / _LARGEST_RATIO < ratio < _LARGEST_RATIO:
        return f"{said}: the slide has neither turned back nor settled; {hopf_distance(drive)}"
    return f"{said}: the slide has neither turned back twice nor settled; run it for longer"
