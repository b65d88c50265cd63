"""Identification of axes that no spring holds: the forces of filtered records are fitted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from stickslip_ros.arrays import rms
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.candidates import Candidate
from stickslip_ros.identification.curves import (
    CoulombCurve,
    Curve,
    ExponentialCurve,
    FollowedCurve,
    SaturatingCurve,
    SteppedCurve,
    StribeckCurve,
)
from stickslip_ros.identification.filtered import filtered
from stickslip_ros.identification.free_runs import adjusted
from stickslip_ros.identification.friction_models import DELAY
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.regression import LINEAR, Regression, Rows, regress

_RESOLVED_ERROR_RATIO = 0.9
"""Share of the error to which a delay or a memory must lower it to be believed."""
_DELAYS = np.arange(-1.0, 4.01, 0.25)
"""Delays that are tried, periods."""
_KNOTS = 9
_DEFLECTIONS = (1e-5, 1e-4, 1e-3)
"""Deflections that are tried first, shares of the range of the positions."""

AXIS_LAWS = ("coulomb", "stribeck", "exponential", "table", "lugre")
"""Laws that can be identified for an axis without a spring."""


class AxisTask:
    """Records of an axis without a spring, with what is known of it."""

    def __init__(self, records: Sequence[Record], fixed: Mapping[str, float]) -> None:
        if all(not record.held_force.any() for record in records):
            given = any(record.force is not None for record in records)
            hint = "" if given else "; name its column, as in --columns force=u"
            raise InvalidInputError(
                f"{'the recorded force is always 0' if given else 'no force is recorded'}: without "
                f"a force an axis tells nothing of its mass and its friction{hint}"
            )
        self.records = records
        own = {name: fixed[name] for name in LINEAR if name in fixed}
        self.fixed = {**dict.fromkeys(LINEAR[1:], 0.0), **own}
        self.free = [name for name in LINEAR if name not in self.fixed]
        self.delay: float | None = fixed.get(DELAY)
        self._filtered = [filtered(each, decimated=True) for each in records]
        self._by_delay: dict[float, Rows] = {}
        self.rows = Rows.of(self._filtered) if self.delay is None else self._rows(self.delay)

    def candidates(self, law: str, progress: Callable[[str], None]) -> list[Candidate]:
        """Return the fits of the laws that compete, or of the one that is asked for."""
        curves: list[Curve] = [CoulombCurve(), StribeckCurve(), ExponentialCurve()]
        quantiles = np.quantile(self.rows.speeds, np.linspace(0.0, 1.0, _KNOTS)).tolist()
        tables = [SaturatingCurve(), SteppedCurve((0.0, *quantiles[1:]))]
        found: list[Candidate] = []
        for curve in curves:
            if law in ("auto", curve.name):
                progress(curve.name)
                found.append(self._with_delay(curve))
        if law in ("auto", "table", "lugre"):
            progress("table")
            best = min(map(self._with_delay, tables), key=lambda each: each.error)
            found += [best] if law != "lugre" else []
            if law != "table":
                progress("lugre")
                found.append(self._with_memory(best, asked=law == "lugre"))
        return found

    def adjusted(self, found: Candidate) -> Candidate:
        """Return a table that fits its free run, too; laws with constants stay as they are."""
        fit = found.fit
        assert isinstance(fit, Regression)
        fit.require("mass")
        if fit.curve.name != "table":
            return found
        return replace(found, fit=adjusted(fit, self.records, found.delay or 0.0))

    def _with_delay(self, curve: Curve) -> Candidate:
        """Return a fit with a delay if the records ask for one."""
        plain = self._candidate(self.rows, curve, self.delay)
        if self.delay is not None:
            return plain
        fit, found = plain.fit, plain
        period = self.records[0].period
        tried: Sequence[float] = _DELAYS.tolist()
        for step in (0.25, 0.05):
            assert isinstance(fit, Regression)
            if found.delay is not None:
                tried = (found.delay / period + step * np.arange(-5.0, 6.0)).tolist()
            errors = [_error_with(fit, self._rows(each * period)) for each in tried]
            delay = tried[int(np.argmin(errors))] * period
            found = self._candidate(self._rows(delay), curve, delay)
            fit = found.fit
        return found if found.error < _RESOLVED_ERROR_RATIO * plain.error else plain

    def _with_memory(self, static: Candidate, *, asked: bool) -> Candidate:
        """Return the fit whose friction follows the curve of another over a path."""
        fit = static.fit
        assert isinstance(fit, Regression)
        span = max(float(np.ptp(record.position)) for record in self.records)
        tried: dict[float, Regression] = {}

        def error(deflection: float) -> float:
            curve = FollowedCurve(fit.curve, deflection)
            own = replace(fit, curve=curve).refitted()
            tried[deflection] = own
            return float(own.residual @ own.residual)

        best = min((share * span for share in _DEFLECTIONS), key=error)
        for factor in (0.2, 0.4, 2.0, 4.0):
            error(factor * best)
        nearest = min(tried.values(), key=lambda each: float(each.residual @ each.residual))
        found = self._as_candidate(nearest, static.delay)
        if asked or found.error < _RESOLVED_ERROR_RATIO * static.error:
            return found
        share = f"{1.0 - _RESOLVED_ERROR_RATIO:.0%}"
        remark = f"predicts better by less than {share}: not resolved by filtered rows"
        return replace(found, remark=remark)

    def _candidate(self, rows: Rows, curve: Curve, delay: float | None) -> Candidate:
        return self._as_candidate(regress(rows, curve, self.free, self.fixed), delay)

    def _as_candidate(self, fit: Regression, delay: float | None) -> Candidate:
        scale = rms(fit.rows.force)
        size = len(fit.values) + len(fit.shapes) + (fit.curve.deflection > 0.0)
        return Candidate(fit.curve.name, size, fit.held_out, scale, fit, delay)

    def _rows(self, delay: float) -> Rows:
        if delay not in self._by_delay:
            pairs = zip(self._filtered, self.records, strict=True)
            rows = Rows.of([columns.with_delay(record, delay) for columns, record in pairs])
            if delay not in self._tried_first:
                return rows
            self._by_delay[delay] = rows
        return self._by_delay[delay]

    @property
    def _tried_first(self) -> Sequence[float]:
        """Delays that are tried for each curve, s: their rows are kept."""
        return [each * self.records[0].period for each in _DELAYS.tolist()]


def _error_with(fit: Regression, rows: Rows) -> float:
    """Return the squared error of a curve with its shapes, fitted to rows with another delay."""
    residual = replace(fit, rows=rows).refitted().residual
    return float(residual @ residual)
