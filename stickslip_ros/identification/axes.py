"""Identification of axes that no spring holds: the forces of filtered records are fitted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import isnan, nan, sqrt

import numpy as np
from scipy.optimize import least_squares

from stickslip_ros.arrays import FloatArray
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
from stickslip_ros.identification.filtered import DECIMATION, filtered
from stickslip_ros.identification.models import DELAY
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.regression import (
    LINEAR,
    Regression,
    Rows,
    regress,
    solve,
    system,
)
from stickslip_ros.identification.trajectory import Predictor, delayed, free_run
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import (
    Coulomb,
    Directional,
    Exponential,
    FrictionLaw,
    LuGre,
    Stribeck,
    Table,
)

RESOLVED = 0.9
"""Share of the error to which a delay, a spring or a memory must lower it to be believed."""
_DELAYS = np.arange(-1.0, 4.01, 0.25)
"""Delays that are tried, periods."""
_FAR = 1e3
"""Error of a free run that is not bounded, in units of that of the regression."""
_KNOTS = 9
_DEFLECTIONS = (1e-5, 1e-4, 1e-3)
"""Deflections that are tried first, shares of the range of the positions."""

_POINTS = 40
"""Points of the table that stands for a curve."""
_ADJUSTING_STEPS = 3
_FREE_WEIGHT = 1.4
"""Weight of the free run beside that of the forces."""
_STEP = 1e-4
"""Step of differences, as a share of the value."""

Progress = Callable[[str], None]
Points = tuple[tuple[float, float], ...]
"""Pairs of speed, m/s, and coefficient."""
_AXIS_LAWS = ("coulomb", "stribeck", "exponential", "table", "lugre")


class AxisTask:
    """Records of an axis without a spring, with what is known of it."""

    def __init__(self, records: Sequence[Record], fixed: Mapping[str, float]) -> None:
        if all(not record.held_force.any() for record in records):
            raise InvalidInputError(
                "no force acts in the recordings: without one an axis tells nothing of its mass "
                "and its friction; name its column, as in --columns force=u"
            )
        self.records = records
        own = {name: fixed[name] for name in LINEAR if name in fixed}
        self.fixed = {**dict.fromkeys(LINEAR[1:], 0.0), **own}
        self.free = [name for name in LINEAR if name not in self.fixed]
        self.delay: float | None = fixed.get(DELAY)
        self.rows = self._rows(self.delay)

    def candidates(self, law: str, progress: Progress) -> list[Candidate]:
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
        """Return a table whose forces fit, and whose free run through each record, too.

        The sum of both mean squares is least, each in units of what the regression leaves. Laws
        with constants stay as the forces alone tell them.
        """
        fit = found.fit
        assert isinstance(fit, Regression)
        if fit.curve.name != "table":
            return found
        delay = 0.0 if isnan(found.delay) else found.delay
        task = _FreeRuns(fit, self.records, delay)
        start = task.linear()
        least = np.array([*fit.least, *(0.05 * fit.shapes), *[-np.inf] * len(self.records)])
        solved = least_squares(
            task.residual,
            np.maximum(start, least + 1e-9),
            bounds=(least, np.inf),
            x_scale=np.maximum(np.abs(start), 1e-3),
            diff_step=_STEP,
            max_nfev=_ADJUSTING_STEPS,
        )
        return replace(found, fit=task.moved(solved.x))

    def _with_delay(self, curve: Curve) -> Candidate:
        """Return a fit with a delay if the records ask for one."""
        plain = self._candidate(self.rows, curve, nan if self.delay is None else self.delay)
        if self.delay is not None:
            return plain
        fit, found = plain.fit, plain
        period = self.records[0].period
        for step in (0.25, 0.05):
            assert isinstance(fit, Regression)
            middle = 0.0 if found is plain else found.delay / period
            reach = _DELAYS if found is plain else middle + step * np.arange(-5.0, 6.0)
            errors = [_error_with(fit, self._rows(each * period)) for each in reach]
            delay = float(reach[int(np.argmin(errors))]) * period
            found = self._candidate(self._rows(delay), curve, delay)
            fit = found.fit
        return found if found.error < RESOLVED * plain.error else plain

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
        if asked or found.error < RESOLVED * static.error:
            return found
        remark = f"predicts better by less than {1.0 - RESOLVED:.0%}: not resolved by filtered rows"
        return replace(found, remark=remark)

    def _candidate(self, rows: Rows, curve: Curve, delay: float) -> Candidate:
        return self._as_candidate(regress(rows, curve, self.free, self.fixed), delay)

    def _as_candidate(self, fit: Regression, delay: float) -> Candidate:
        scale = sqrt(float(np.mean(fit.rows.force**2)))
        size = len(fit.values) + len(fit.shapes) + (fit.curve.deflection > 0.0)
        return Candidate(fit.curve.name, size, fit.held_out, scale, fit, delay)

    def _rows(self, delay: float | None) -> Rows:
        return Rows.of([filtered(each, decimated=True, delay=delay) for each in self.records])


class _FreeRuns:
    """The forces of a regression and the free runs of its drive, as one residual.

    A point has the values and the shapes of the regression, then the velocity at the start of each
    record.
    """

    def __init__(self, fit: Regression, records: Sequence[Record], delay: float) -> None:
        self._fit = fit
        records = [delayed(record, delay) for record in records]
        self._predictors = [Predictor(record) for record in records]
        self._measured = np.concatenate([record.position for record in records])
        self._records = records
        left = np.concatenate([run for _, run in self._runs(fit)]) - self._measured
        count = len(fit.residual)
        self._weights = (
            1.0 / (_rms(fit.residual) * sqrt(count)),
            _FREE_WEIGHT / (_rms(left) * sqrt(len(left))),
        )
        # The same weight for a run that is sampled as the rows are.
        self._row_weight = _FREE_WEIGHT / (_rms(left) * sqrt(count))

    def moved(self, point: FloatArray) -> Regression:
        """Return the regression with the values and shapes of a point."""
        values, shapes = len(self._fit.values), len(self._fit.shapes)
        return replace(self._fit, values=point[:values], shapes=point[values : values + shapes])

    def residual(self, point: FloatArray) -> FloatArray:
        """Return the errors of the forces and of the simulated free runs, weighted."""
        own = self.moved(point)
        drive = axis_drive(own, 1.0, 0.0)
        positions: list[FloatArray] = []
        for each, speed in zip(
            self._predictors, point[-len(self._predictors) :].tolist(), strict=True
        ):
            measured = each.record.position
            positions.append(each.positions(drive, 0, len(measured), float(measured[0]), speed))
        errors = np.concatenate(positions) - self._measured
        errors = np.nan_to_num(errors, nan=_FAR / self._weights[1])
        return np.concatenate([own.residual * self._weights[0], errors * self._weights[1]])

    def linear(self) -> FloatArray:
        """Return the point at which the residual is least if errors of force move the mass alone.

        The position error of a free run is then the force error through mass and viscous friction,
        which is linear in the unknowns.
        """
        from scipy.signal import lfilter

        fit, parts = self._fit, self._fit.rows.parts
        mass = fit.constants["mass"]
        speed, typical = fit.rows.speeds, _rms(fit.rows.speeds)
        rate = max(_slope(fit, typical, float(speed[-1])) / mass, 1e-3)
        lengths = [len(part.rows(part.time)) for part in parts]
        steps = [float(part.time[1] - part.time[0]) * DECIMATION for part in parts]
        place = np.split(np.arange(sum(lengths)), np.cumsum(lengths)[:-1])

        def positions(columns: FloatArray) -> FloatArray:
            made: list[FloatArray] = []
            for rows, step in zip(place, steps, strict=True):
                speeds = lfilter([step / mass], [1.0, -np.exp(-rate * step)], columns[rows], 0)
                made.append(np.cumsum(speeds, axis=0) * step)
            return np.concatenate(made)

        by_speed = np.zeros((len(fit.residual), len(parts)))
        for number, (rows, step) in enumerate(zip(place, steps, strict=True)):
            by_speed[rows, number] = -np.expm1(-rate * step * np.arange(len(rows))) / rate

        def solved(shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
            design, wanted = system(fit.rows, fit.curve, fit.free, fit.fixed, shapes)
            matrix = np.vstack(
                [
                    np.hstack([design * self._weights[0], np.zeros_like(by_speed)]),
                    np.hstack([positions(design), by_speed]) * self._row_weight,
                ]
            )
            target = np.concatenate(
                [wanted * self._weights[0], positions(wanted) * self._row_weight]
            )
            least = np.array([*fit.least, *[-np.inf] * len(parts)])
            values = solve(matrix, target, least)
            return values, target - matrix @ values

        def by_logarithms(logarithms: FloatArray) -> FloatArray:
            return solved(np.exp(logarithms))[1]

        shapes = fit.shapes
        if len(shapes):
            found = least_squares(
                by_logarithms,
                np.log(shapes),
                diff_step=1e-3,
                max_nfev=10,
            )
            shapes = np.exp(found.x)
        values, _ = solved(shapes)
        point = np.concatenate([values[: len(fit.values)], shapes])
        return np.concatenate([point, [speed for speed, _ in self._runs(self.moved(point))]])

    def _runs(self, fit: Regression) -> list[tuple[float, FloatArray]]:
        drive = axis_drive(fit, 1.0, 0.0)
        return [free_run(record, drive) for record in self._records]


def _slope(fit: Regression, low: float, high: float) -> float:
    """Return the mean slope of the friction curves between two speeds, N s/m."""
    slopes: list[float] = []
    for number in range(len(fit.rows.directions)):
        shape = float(fit.shapes[number]) if len(fit.shapes) else 1.0
        low_force, high_force = fit.curve.terms(np.array([low, high]), shape) @ fit.forces(number)
        slopes.append(float(high_force - low_force) / (high - low))
    return float(np.mean(slopes))


def table_speeds(fit: Regression) -> FloatArray:
    """Return the speeds of the points that stand for a curve, m/s: 0 and those recorded."""
    if isinstance(fit.curve, SteppedCurve):
        return np.array(fit.curve.knots)
    low, high = np.quantile(fit.rows.speeds, [0.02, 1.0])
    return np.concatenate([[0.0], np.geomspace(low, high, _POINTS - 1)])


def table_of(fit: Regression, direction: int, normal_force: float) -> Points:
    """Return points of speed (m/s) and coefficient of the curve in a direction of the rows."""
    speed = table_speeds(fit)
    shape = float(fit.shapes[direction]) if len(fit.shapes) else 1.0
    force = fit.curve.terms(speed, shape) @ fit.forces(direction)
    size = np.maximum(force, 0.0) / normal_force
    return tuple(zip(speed.tolist(), size.tolist(), strict=True))


def axis_drive(fit: Regression, normal_force: float, belt_speed: float) -> Drive:
    """Return the drive that a regression stands for."""
    laws = [_law(fit, number, normal_force) for number in range(len(fit.rows.directions))]
    constants = fit.constants
    return Drive(
        mass=constants["mass"],
        damping=max(constants["damping"], 0.0),
        stiffness=max(constants["stiffness"], 0.0),
        normal_force=normal_force,
        belt_speed=belt_speed,
        friction=laws[0] if len(laws) == 1 else Directional(*laws),
        bias_force=constants["bias_force"],
    )


def _law(fit: Regression, direction: int, normal_force: float) -> FrictionLaw:
    first, *others = (fit.forces(direction) / normal_force).tolist()
    if isinstance(fit.curve, CoulombCurve):
        return Coulomb(static=first, viscous=others[0])
    if isinstance(fit.curve, StribeckCurve):
        return Stribeck(
            static=first,
            minimum=max(first - others[0], 0.0),
            minimum_speed=float(fit.shapes[direction]),
        )
    if isinstance(fit.curve, ExponentialCurve):
        return Exponential(
            static=first + others[0],
            kinetic=first,
            decay_speed=float(fit.shapes[direction]),
            viscous=others[1],
        )
    table = Table(table_of(fit, direction, normal_force))
    if not isinstance(fit.curve, FollowedCurve):
        return table
    largest = max(size for _, size in table.points)
    return LuGre(table, bristle_stiffness=largest / fit.curve.deflection, bristle_damping=0.0)


def axis_laws() -> Sequence[str]:
    """Return the names of the laws that can be identified for an axis without a spring."""
    return _AXIS_LAWS


def _rms(values: FloatArray) -> float:
    return sqrt(float(np.mean(values * values)))


def _error_with(fit: Regression, rows: Rows) -> float:
    """Return the squared error of a curve with its shapes, fitted to rows with another delay."""
    residual = replace(fit, rows=rows).refitted().residual
    return float(residual @ residual)
