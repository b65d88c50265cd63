"""The tables of an identification: constants with intervals, laws that competed, predictions."""

from collections.abc import Iterator, Mapping, Sequence
from math import floor, isfinite, log10
from typing import Any

import numpy as np

from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.fit import QUANTILE, Candidate, Estimate
from stickslip_ros.scenarios.parameters import PlantParameters
from stickslip_ros.show.quantities import PREDICTIONS, SI
from stickslip_ros.tables import TextTable

_DIGITS = 2, 10
"""Digits of a value, at least and at most."""


def identification_tables(
    found: Findings,
    own: Mapping[str, Any],
    checks: Sequence[Mapping[str, Any]],
    notes: Sequence[str],
) -> Iterator[TextTable | str]:
    """Yield the tables of what was found.

    `own` is what the model predicts of the first recording that it was fitted to, `checks` of
    others; `notes` are sentences on both.
    """
    names = ", ".join(dict.fromkeys(record.name for record in found.records))
    constants = {f"plant.{name}": each for name, each in found.fitted.items()}
    yield constants_table(f"{names}: law {found.law}", constants)
    if found.law == "table" or (found.law == "lugre" and not found.has_spring):
        yield _curve(found)
    yield TextTable(
        "laws",
        ["law", "constants", "validation error", ""],
        [
            [each.label, str(each.size), f"{each.error:.3%}", _verdict(found, each)]
            for each in sorted(found.candidates, key=lambda each: each.error)
        ],
    )
    shown = [("fitted to, in-sample", own), *((each["recording"], each) for each in checks)]
    yield TextTable(
        "predictions",
        ["recording", *(quantity.label for quantity in PREDICTIONS.values())],
        [[name, *_predicted(values)] for name, values in shown],
    )
    yield from notes
    for first, second, share in found.correlations:
        yield f"plant.{first} and plant.{second} are correlated, {share:.3f}"
    for name, why in found.unidentified.items():
        yield f"plant.{name} is not identifiable: {why}"


def constants_table(title: str, constants: Mapping[str, Estimate]) -> TextTable:
    """Return the table of constants by parameter, such as `plant.mass`, with intervals."""
    units = {f"plant.{each.name}": each.unit or "" for each in PlantParameters().known.values()}
    rows = [
        [
            name,
            SI.texts([each.value], units[name], _digits(each))[0],
            SI.text(each.standard_error, units[name], largest=abs(each.value)),
            _interval(each, units[name]),
        ]
        for name, each in constants.items()
    ]
    return TextTable(title, ["parameter", "value", "standard error", "95 % interval"], rows)


def _digits(estimate: Estimate) -> int:
    """Return how many digits of a value its standard error tells: two digits of the latter."""
    value, error = abs(estimate.value), estimate.standard_error
    if not isfinite(error) or error == 0.0 or value == 0.0:
        return _DIGITS[0]
    return int(np.clip(floor(log10(value)) - floor(log10(error)) + 2, *_DIGITS))


def _interval(estimate: Estimate, unit: str) -> str:
    if not isfinite(estimate.standard_error):
        return "unbounded"
    return " to ".join(SI.texts([*estimate.interval], unit, max(6, _digits(estimate))))


def _curve(found: Findings) -> TextTable:
    rows: list[list[str]] = []
    for number, direction in enumerate(found.directions):
        curve = found.friction(number)
        places = range(0, len(curve.speed), max(len(curve.speed) // 6, 1))
        rows += [
            [
                "forward" if direction > 0.0 else "backward",
                SI.text(float(curve.speed[place]), "m/s"),
                SI.text(float(curve.force[place]), "N"),
                SI.text(QUANTILE * float(curve.standard_error[place]), "N"),
            ]
            for place in places
        ]
    return TextTable("friction", ["slip", "speed", "force", "+- (95 %)"], rows)


def _verdict(found: Findings, candidate: Candidate) -> str:
    if candidate.label == found.chosen.label:
        return "chosen"
    if candidate.remark:
        return candidate.remark
    if found.as_good.get(candidate.label):
        return "predicts as well, within the noise"
    worse = found.behind(candidate)
    return f"predicts worse, by {worse:.1f} standard errors" if isfinite(worse) else ""


def _predicted(values: Mapping[str, Any]) -> list[str]:
    return [
        SI.text(value, unit) if unit or value is None else _percent(value)
        for value, unit in ((values[name], unit) for name, (_, unit, _) in PREDICTIONS.items())
    ]


def _percent(share: float) -> str:
    return f"{100.0 * share:.4g} %" if isfinite(share) else "unbounded"
