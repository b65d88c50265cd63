"""Identification of axes that no spring holds: the forces of filtered records are fitted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.choice import Candidate, Task
from stickslip_ros.identification.filtered import filtered
from stickslip_ros.identification.identified_law import DELAY, IdentifiedLaw
from stickslip_ros.identification.laws import (
    BristledTableAdapter,
    SaturatingAdapter,
    TableAdapter,
)
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.regression import (
    LINEAR,
    Regression,
    Rows,
    regress,
    solve,
)
from stickslip_ros.identification.time_limit import TimeLimit
from stickslip_ros.identification.trajectory import Predictor, delayed, free_run

_RESOLVED_ERROR_RATIO = 0.9
"""Share of the error to which a delay or a memory must lower it to be believed."""
_DELAYS = np.arange(-1.0, 4.01, 0.25)
"""Delays that are tried, periods."""
_DELAY_STEPS = 0.05 * np.arange(-5.0, 6.0)
"""Changes of the best one that are tried, periods."""
_KNOTS = 9
_DEFLECTIONS = (1e-5, 1e-4, 1e-3)
"""Deflections that are tried first, shares of the range of the positions."""

_UNBOUNDED_ERROR = 1e3
"""Error of a free run that is not bounded, in units of that of the regression."""
_FREE_RUN_STEPS = 3
"""Steps in which forces and free runs are fitted together."""
_FREE_WEIGHT = 1.4
"""Weight of the free run beside that of the forces."""
_LEAST_MASS_SHARE = 0.1
"""Smallest mass that is tried there, as a share of that by the forces."""
_STEP = 1e-4
"""Step of differences, as a share of the value."""
_CANDIDATES_TIME = 0.6
"""Share of the time after which no further law is begun."""
AXIS_LAWS = ("coulomb", "stribeck", "exponential", "table", "lugre")
"""Laws that can be identified for an axis without a spring."""


class AxisTask(Task[Regression]):
    """Records of an axis without a spring, with what is known of it."""

    def __init__(
        self, records: Sequence[Record], fixed: Mapping[str, float], limit: TimeLimit
    ) -> None:
        if all(not record.held_force.any() for record in records):
            given = any(record.force is not None for record in records)
            hint = "" if given else "; name its column, as in --columns force=u, or of a "
            "bag its --force-topic, or --force effort"
            raise InvalidInputError(
                f"{'the recorded force is always 0' if given else 'no force is recorded'}: without "
                f"a force neither mass nor friction of an axis is identifiable{hint}"
            )
        super().__init__(records, limit)
        own = {name: fixed[name] for name in LINEAR if name in fixed}
        self.fixed = {**dict.fromkeys(LINEAR[1:], 0.0), **own}
        self.free = [name for name in LINEAR if name not in self.fixed]
        self.delay: float | None = fixed.get(DELAY)
        # Where the slide never rests it is as in the published method: the force is that at the
        # instant of a sample. Otherwise it is held until the next one.
        self.rows = Rows.of([filtered(each, decimated=True) for each in records], None)
        if self.delay is not None or self.rows.resting:
            self.rows = self._rows(self.delay or 0.0)

    @override
    def candidates(
        self, law: str, laws: Sequence[IdentifiedLaw], progress: Callable[[str], None]
    ) -> list[Candidate[Regression]]:
        """Return the fits of the laws that compete, or of the one that is asked for."""
        found: list[Candidate[Regression]] = []
        self.limit.begin_stage(_CANDIDATES_TIME)
        for each in laws:
            if each.memory or not each.of_slip:
                continue
            if found and self.limit.is_over:
                self.left.append(each.name)
            else:
                progress(each.name)
                found.append(self._with_delay(each))
        if found and self.limit.is_over:
            self.left += ["table", "lugre"]
        elif law in ("auto", "table", "lugre"):
            progress("table")
            knots = np.quantile(self.rows.speeds, np.linspace(0.0, 1.0, _KNOTS))
            knots[0] = 0.0
            tables = SaturatingAdapter(self.rows.curve_speeds), TableAdapter(knots)
            fitted = ((self._with_delay(each), each) for each in tables)
            best, table = min(fitted, key=lambda each: each[0].error)
            found += [best] if law != "lugre" else []
            if law != "table":
                progress("lugre")
                found.append(self._with_memory(best, table, asked=law == "lugre"))
        return found

    @override
    def adjusted(self, found: Candidate[Regression]) -> Candidate[Regression]:
        """Return a table that fits its free run, too; laws with constants stay as they are."""
        fit = found.fit
        fit.require("mass")
        return replace(found, fit=adjusted(fit, self.records)) if found.law == "table" else found

    def _with_delay(self, law: IdentifiedLaw) -> Candidate[Regression]:
        """Return a fit with a delay if the records ask for one."""
        fit = self._fitted(law, self.rows)
        found = Candidate(fit, fit.held_out)
        if self.delay is not None:
            return found
        if self.rows.resting:
            read = self._fitted(law, self._rows(None))
            found = min(found, Candidate(read, read.held_out), key=lambda each: each.error)
        period, tried = self.records[0].period, _DELAYS
        for _ in range(2):
            design, wanted = fit.system
            changes = [self._forces(each * period) - fit.rows.force for each in tried.tolist()]
            wanted = wanted[:, None] + np.column_stack(changes)
            left = wanted - design @ np.linalg.lstsq(design, wanted, rcond=None)[0]
            best = float(tried[np.argmin(np.sum(left * left, axis=0))])
            fit = self._fitted(law, self._rows(best * period))
            tried = best + _DELAY_STEPS
        other = Candidate(fit, fit.held_out)
        return other if other.error < _RESOLVED_ERROR_RATIO * found.error else found

    def _with_memory(
        self, static: Candidate[Regression], table: TableAdapter, *, asked: bool
    ) -> Candidate[Regression]:
        """Return the fit whose friction follows the table of another over a path."""
        fit = static.fit
        if not table.shaped:
            table = TableAdapter(self.rows.curve_speeds, table.speeds)
        span = max(float(np.ptp(record.position)) for record in self.records)
        tried: dict[float, Regression] = {}

        def error(deflection: float) -> float:
            tried[deflection] = replace(
                fit, curve=BristledTableAdapter(table, deflection)
            ).refitted()
            return _loss(tried[deflection])

        best = min((share * span for share in _DEFLECTIONS), key=error)
        for factor in (0.2, 0.4, 2.0, 4.0):
            error(factor * best)
        nearest = min(tried.values(), key=_loss)
        found = Candidate(nearest, nearest.held_out)
        if asked or found.error < _RESOLVED_ERROR_RATIO * static.error:
            return found
        share = f"{1.0 - _RESOLVED_ERROR_RATIO:.0%}"
        remark = f"predicts better by less than {share}: not resolved by filtered rows"
        return replace(found, remark=remark)

    def _fitted(self, law: IdentifiedLaw, rows: Rows) -> Regression:
        return regress(rows, law, self.free, self.fixed)

    def _rows(self, delay: float | None) -> Rows:
        """Return the rows with another delay of the force, s; None: read when the position is."""
        shift = -0.5 * self.records[0].period if delay is None else delay
        return replace(self.rows, force=self._forces(shift), delay=delay)

    def _forces(self, delay: float) -> FloatArray:
        pairs = zip(self.rows.parts, self.records, strict=True)
        return np.concatenate([part.rows(part.delayed(record, delay)) for part, record in pairs])


def _loss(fit: Regression) -> float:
    return float(fit.residual @ fit.residual)


def adjusted(fit: Regression, records: Sequence[Record]) -> Regression:
    """Return a regression whose forces fit, and whose free run through each record, too.

    The sum of both mean squares is least, each in units of what the regression leaves. `records`
    are those that it was fitted to. Forces that leave a free run unbounded stay as they are.
    """
    from scipy.optimize import least_squares

    task = _FreeRuns(fit, records)
    if not task.bounded:
        return fit
    start = task.begun() if fit.rows.resting else task.linear()
    slowest = np.full(len(fit.shapes), fit.rows.least_shape(fit.curve))
    least = np.array([*task.least, *slowest, *[-np.inf] * len(records)])
    solved = least_squares(
        task.residual,
        np.maximum(start, least + 1e-9),
        bounds=(least, np.inf),
        x_scale=np.maximum(np.abs(start), 1e-3),
        diff_step=_STEP,
        max_nfev=_FREE_RUN_STEPS,
    )
    return fit.at(solved.x)


class _FreeRuns:
    """The forces of a regression and the free runs of its drive, as one residual.

    A point has the unknowns and the shapes of the regression, then the velocity at the start of
    each record.
    """

    def __init__(self, fit: Regression, records: Sequence[Record]) -> None:
        self._fit = fit
        records = [delayed(record, fit.delay or 0.0) for record in records]
        self._predictors = [Predictor(record) for record in records]
        self._measured = np.concatenate([record.position for record in records])
        self._records = records
        left = np.concatenate([run for _, run in self._runs(fit)]) - self._measured
        self.bounded = bool(np.isfinite(left).all())
        count = len(fit.residual)
        self._weights = (
            1.0 / (rms(fit.residual) * np.sqrt(count)),
            _FREE_WEIGHT / (rms(left) * np.sqrt(len(left))),
        )
        # The same weight for a run that is sampled as the rows are.
        self._row_weight = _FREE_WEIGHT / (rms(left) * np.sqrt(count))

    @property
    def least(self) -> FloatArray:
        """Smallest value of each of the unknowns; a mass of 0 has no motion."""
        least = self._fit.least
        if "mass" in self._fit.free:
            place = [*self._fit.free].index("mass")
            least[place] = _LEAST_MASS_SHARE * self._fit.unknowns[place]
        return least

    def residual(self, point: FloatArray) -> FloatArray:
        """Return the errors of the forces and of the simulated free runs, weighted."""
        own = self._fit.at(point)
        drive = own.drive(1.0)
        positions: list[FloatArray] = []
        for each, speed in zip(
            self._predictors, point[-len(self._predictors) :].tolist(), strict=True
        ):
            positions.append(each.positions(drive, speed))
        errors = np.concatenate(positions) - self._measured
        errors = np.nan_to_num(errors, nan=_UNBOUNDED_ERROR / self._weights[1])
        return np.concatenate([own.residual * self._weights[0], errors * self._weights[1]])

    def begun(self) -> FloatArray:
        """Return the point of the regression with the velocities of the best free runs."""
        return np.concatenate([self._fit.point, [speed for speed, _ in self._runs(self._fit)]])

    def linear(self) -> FloatArray:
        """Return the point at which the residual is least if errors of force move the mass alone.

        The position error of a free run is then the force error through mass and viscous friction,
        which is linear in the unknowns.
        """
        from scipy.optimize import least_squares
        from scipy.signal import lfilter

        fit, parts = self._fit, self._fit.rows.parts
        mass = fit.constants["mass"]
        speed, typical = fit.rows.speeds, rms(fit.rows.speeds)
        rate = max(_slope(fit, typical, float(speed[-1])) / mass, 1e-3)
        lengths = [len(part.rows(part.time)) for part in parts]
        steps = [float(part.time[1] - part.time[0]) * part.decimation for part in parts]
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
            design, wanted = replace(fit, shapes=shapes).system
            matrix = np.vstack(
                [
                    np.hstack([design * self._weights[0], np.zeros_like(by_speed)]),
                    np.hstack([positions(design), by_speed]) * self._row_weight,
                ]
            )
            target = np.concatenate(
                [wanted * self._weights[0], positions(wanted) * self._row_weight]
            )
            least = np.array([*self.least, *[-np.inf] * len(parts)])
            values = solve(matrix, target, least)
            return values, target - matrix @ values

        def by_logarithms(logarithms: FloatArray) -> FloatArray:
            return solved(np.exp(logarithms))[1]

        shapes = fit.shapes
        if len(shapes):
            lowest = np.log(fit.rows.least_shape(fit.curve))
            found = least_squares(
                by_logarithms,
                np.maximum(np.log(shapes), lowest),
                bounds=(lowest, np.inf),
                diff_step=1e-3,
                max_nfev=10,
            )
            shapes = np.exp(found.x)
        values, _ = solved(shapes)
        point = np.concatenate([values[: len(fit.unknowns)], shapes])
        return np.concatenate([point, [speed for speed, _ in self._runs(self._fit.at(point))]])

    def _runs(self, fit: Regression) -> list[tuple[float, FloatArray]]:
        drive = fit.drive(1.0)
        return [free_run(record, drive) for record in self._records]


def _slope(fit: Regression, low: float, high: float) -> float:
    """Return the mean slope of the friction curves between two speeds, N s/m."""
    slopes: list[float] = []
    for sign in fit.directions:
        low_force, high_force = fit.force_at(fit.point, sign, np.array([low, high]))
        slopes.append(float(high_force - low_force) / (high - low))
    return float(np.mean(slopes))
