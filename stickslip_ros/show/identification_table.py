"""The tables of an identification: constants with intervals, laws that competed, predictions."""

from collections.abc import Iterator, Mapping, Sequence
from math import floor, isfinite, log10
from typing import Any

import numpy as np

from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.fit import QUANTILE, Estimate, Fit
from stickslip_ros.identification.sentences import unidentified
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.show.quantities import PREDICTIONS, SI, Units
from stickslip_ros.tables import TextTable

_DIGITS = 2, 10
"""Digits of a value, at least and at most."""


def identification_tables(
    findings: Findings,
    fitted: Mapping[str, Any],
    checks: Sequence[Mapping[str, Any]],
    notes: Sequence[str],
    units: Units = SI,
) -> Iterator[TextTable | str]:
    """Yield the tables of what was found.

    `fitted` is what the model predicts of the first recording that it was fitted to, `checks` of
    others; `notes` are sentences on both.
    """
    names = ", ".join(dict.fromkeys(record.name for record in findings.records))
    constants = {f"plant.{name}": estimate for name, estimate in findings.fitted.items()}
    yield constants_table(f"{names}: law {findings.law}", constants, units)
    if findings.law == "table" or (findings.law == "lugre" and not findings.chosen.has_spring):
        yield _curve(findings, units)
    yield TextTable(
        "laws",
        ["law", "constants", "validation error", ""],
        [
            [fit.label, str(fit.size), f"{fit.error:.3%}", _verdict(findings, fit)]
            for fit in sorted(findings.candidates, key=lambda fit: fit.error)
        ],
    )
    shown = [("fitted to, in-sample", fitted), *((check["recording"], check) for check in checks)]
    yield TextTable(
        "predictions",
        ["recording", *(quantity.label for quantity in PREDICTIONS.values())],
        [[name, *_predicted(values, units)] for name, values in shown],
    )
    yield from notes
    for first, second, share in findings.correlations:
        yield f"plant.{first} and plant.{second} are correlated, {share:.3f}"
    for name, why in unidentified(findings).items():
        yield f"plant.{name} is not identifiable: {why}"


def constants_table(title: str, constants: Mapping[str, Estimate], units: Units) -> TextTable:
    """Return the table of constants by parameter, such as `plant.mass`, with intervals."""
    known = {f"plant.{p.name}": p.unit or "" for p in PlantParameters().known.values()}
    rows = [
        [
            name,
            units.texts([estimate.value], known[name], _digits(estimate))[0],
            units.text(estimate.standard_error, known[name], largest=abs(estimate.value)),
            _interval(estimate, known[name], units),
        ]
        for name, estimate in constants.items()
    ]
    return TextTable(title, ["parameter", "value", "standard error", "95 % interval"], rows)


def _digits(estimate: Estimate) -> int:
    """Return how many digits of a value its standard error tells: two digits of the latter."""
    value, error = abs(estimate.value), estimate.standard_error
    if not isfinite(error) or error == 0.0 or value == 0.0:
        return _DIGITS[0]
    return int(np.clip(floor(log10(value)) - floor(log10(error)) + 2, *_DIGITS))


def _interval(estimate: Estimate, unit: str, units: Units) -> str:
    if not isfinite(estimate.standard_error):
        return "unbounded"
    return " to ".join(units.texts([*estimate.interval], unit, max(6, _digits(estimate))))


def _curve(findings: Findings, units: Units) -> TextTable:
    rows: list[list[str]] = []
    for curve in findings.curves:
        places = range(0, len(curve.speed), max(len(curve.speed) // 6, 1))
        rows += [
            [
                "forward" if curve.direction > 0.0 else "backward",
                units.text(float(curve.speed[place]), "m/s"),
                units.text(float(curve.force[place]), "N"),
                units.text(QUANTILE * float(curve.standard_error[place]), "N"),
            ]
            for place in places
        ]
    return TextTable("friction", ["slip", "speed", "force", "+- (95 %)"], rows)


def _verdict(findings: Findings, candidate: Fit) -> str:
    if candidate.label == findings.chosen.label:
        return "chosen"
    if candidate.remark:
        return candidate.remark
    if findings.as_good.get(candidate.label):
        return "predicts as well, within the noise"
    worse = findings.behind(candidate)
    return f"predicts worse, by {worse:.1f} standard errors" if isfinite(worse) else ""


def _predicted(values: Mapping[str, Any], units: Units) -> list[str]:
    return [
        units.text(value, unit) if unit or value is None else _percent(value)
        for value, unit in ((values[name], unit) for name, (_, unit, _) in PREDICTIONS.items())
    ]


def _percent(share: float) -> str:
    return f"{100.0 * share:.4g} %" if isfinite(share) else "unbounded"
