"""Identification of axes that no spring holds: the forces of filtered records are fitted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.choice import AUTO
from stickslip_ros.identification.covariance import BLOCKS
from stickslip_ros.identification.filtered import END, START, filtered, mean_forces
from stickslip_ros.identification.identified_law import DELAY, IdentifiedLaw
from stickslip_ros.identification.laws import (
    EXPONENTIAL,
    GAUSSIAN,
    FollowedTable,
    SaturatingAdapter,
    TableAdapter,
)
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.regression import Regression, regress
from stickslip_ros.identification.regression_rows import LINEAR, Rows
from stickslip_ros.identification.time_limit import TimeLimit

_RESOLVED_ERROR_RATIO = 0.9
"""Share of the error to which a delay or a memory must lower it to be believed."""
_DELAYS = np.arange(-1.0, 4.01, 0.25)
"""Delays that are tried, periods."""
_DELAY_STEPS = 0.05 * np.arange(-5.0, 6.0)
"""Changes of the best one that are tried, periods."""
_KNOTS = 9
_GAIN = 0.1
"""Speed that an axis that coasts may seem to gain, as a share of the fastest."""
_REVERSAL_ERROR_RATIO = 0.75
"""Share of the error to which rows away from reversals must lower it for the others to go."""
_SETTLED_DEFLECTIONS = 10.0
"""Path behind a reversal, in deflections of bristles, from which friction is that of a curve."""
_DEFLECTIONS = (1e-5, 1e-4, 1e-3)
"""Deflections that are tried first, shares of the range of the positions."""
_FIT_TIME = 3e-5
"""Usual processor time of the fit of a law, by sample, s."""
_CANDIDATES_TIME = 0.6
"""Share of the time after which no further law is begun."""
AXIS_LAWS = ("coulomb", "stribeck", "exponential", "table", "lugre")
"""Laws that can be identified for an axis without a spring."""


class AxisTask:
    """Records of an axis without a spring, with what is known of it."""

    def __init__(
        self, records: Sequence[Record], fixed: Mapping[str, float], limit: TimeLimit
    ) -> None:
        coasts = not any(record.held_force.any() for record in records)
        if coasts and "mass" not in fixed:
            given = any(record.force is not None for record in records)
            hint = (
                ""
                if given
                else "; if a force acts, name its column, as in --columns force=u, or of a bag its "
                "--force-topic, or --force effort"
            )
            raise InvalidInputError(
                f"{'the recorded force is always 0' if given else 'no force is recorded'}: without "
                "one only the ratio of friction and mass of an axis is identifiable: if it coasts, "
                f"give its mass, as in --fix plant.mass=95{hint}"
            )
        self.records, self.limit = records, limit
        self.left: list[str] = []
        """Laws that were not fitted, because the time was over."""
        given_constants = {name: fixed[name] for name in LINEAR if name in fixed}
        self.fixed = {**dict.fromkeys(LINEAR[1:], 0.0), **given_constants}
        self.free = [name for name in LINEAR if name not in self.fixed]
        self.delay: float | None = fixed.get(DELAY, 0.0 if coasts else None)
        # Where the slide never rests it is as in the published method: the force is that at the
        # instant of a sample. Otherwise it is held until the next one.
        self.rows = self._near = Rows.of_records(
            [filtered(record, decimated=True) for record in records]
        )
        if self.delay is not None or self.rows.resting:
            self.rows = self._delayed(self.rows, self.delay or 0.0)
        for part, record in zip(self.rows.parts, records, strict=True):
            blocks = np.array_split(np.abs(part.velocity), BLOCKS)
            speeds = np.array([float(block.mean()) for block in blocks])
            gain = float((speeds - np.minimum.accumulate(speeds)).max())
            if coasts and "bias_force" not in fixed and gain > _GAIN * float(speeds.max()):
                raise InvalidInputError(
                    f"{record.name}: the axis gains speed, and no force is recorded; choose a part "
                    "in which it coasts, by --from and --to"
                )
        if not coasts:
            self._leave_reversals_out()

    def _leave_reversals_out(self) -> None:
        """Leave out rows near reversals where no curve explains them: bristles deflect.

        What the others leave is then the error of the curve itself.
        """
        near = self._fitted(self._table, self.rows)
        memory = self._with_memory(near)
        bristles = rms(memory.residual) < _RESOLVED_ERROR_RATIO * rms(near.residual)
        if near.rows.resting and not bristles:
            return
        path = _SETTLED_DEFLECTIONS * memory.curve.deflection if bristles else 0.0
        parts = [filtered(record, decimated=True, path=path) for record in self.records]
        self.rows = self._delayed(Rows.of_records(parts), near.rows.delay)
        away = self._fitted(self._table, self.rows)
        if bristles or rms(away.residual) < _REVERSAL_ERROR_RATIO * rms(near.residual):
            self.rows = self._delayed(self.rows, self.delay or 0.0)
        else:
            self.rows = near.rows

    @property
    def _table(self) -> TableAdapter:
        """Friction at the speeds of the rows; without rows near rest it is constant below."""
        knots = np.quantile(self.rows.speeds, np.linspace(0.0, 1.0, _KNOTS))
        knots[0] = self.rows.curve_speeds[1] if self.rows.resting else 0.0
        return TableAdapter(np.unique([0.0, *knots]), knots)

    def candidates(
        self, law: str, laws: Sequence[IdentifiedLaw], progress: Callable[[str], None]
    ) -> list[Regression]:
        """Return the fits of the laws that compete, or of the one that is asked for."""
        fits: list[Regression] = []
        self.limit.begin_stage(_CANDIDATES_TIME)
        for curve in laws:
            if curve.memory or not curve.identifiable_in_slip:
                continue
            if fits and self.limit.is_over:
                self.left.append(curve.name)
            else:
                progress(curve.name)
                tried = (curve, GAUSSIAN) if curve is EXPONENTIAL else (curve,)
                fits.append(min(map(self._with_delay, tried), key=lambda fit: fit.error))
        if fits and self.limit.is_over:
            self.left.append("table")
        elif law in (AUTO, "table", "lugre"):
            progress("table")
            tables = SaturatingAdapter(self.rows.curve_speeds), self._table
            best = min(map(self._with_delay, tables), key=lambda fit: fit.error)
            fits.append(best if law != "lugre" else self._with_memory(best).validated())
        # Friction without a law is what is left where the others are not that of the rows.
        named = [fit for fit in fits if fit.law.name != TableAdapter.name]
        return [replace(fit, remark=fit.doubt) if fit in named else fit for fit in fits]

    def _with_delay(self, law: IdentifiedLaw) -> Regression:
        """Return a fit with a delay if the records ask for one."""
        self.limit.spend(_FIT_TIME * sum(len(record.position) for record in self.records))
        fit = without = self._fitted(law, self.rows).validated()
        if self.delay is not None:
            return without
        if self.rows.resting:
            fits = fit, self._fitted(law, self._delayed(self.rows, None)).validated()
            without = min(fits, key=lambda fitted: fitted.error)
        best = 0.0
        for tried in (_DELAYS, _DELAY_STEPS):
            best = self._best_delay(fit, best + tried)
            fit = self._fitted(law, self._delayed(self.rows, best * self.records[0].period))
        fit = fit.validated()
        return fit if fit.error < _RESOLVED_ERROR_RATIO * without.error else without

    def _best_delay(self, fit: Regression, tried: FloatArray) -> float:
        """Return the delay, in samples, with which the errors of a fit are least."""
        period = self.records[0].period
        design, wanted = fit.system
        changes = [
            self._forces(self.rows, delay * period) - fit.rows.force for delay in tried.tolist()
        ]
        wanted = wanted[:, None] + np.column_stack(changes)
        left = wanted - design @ np.linalg.lstsq(design, wanted, rcond=None)[0]
        return float(tried[np.argmin(np.sum(left * left, axis=0))])

    def _with_memory(self, static: Regression) -> Regression:
        """Return the fit whose friction follows the table of another over a path.

        Rows near reversals tell the path, also where the curve is fitted without them.
        """
        speeds, table = self.rows.curve_speeds, static.curve
        assert isinstance(table, TableAdapter)
        span = max(float(np.ptp(record.position)) for record in self.records)
        near = self._delayed(self._near, static.rows.delay)
        curve = SaturatingAdapter(speeds) if table.shaped else TableAdapter(speeds, table.knots)

        def fitted(deflection: float) -> Regression:
            return replace(static, curve=FollowedTable(curve, deflection)).refitted()

        def loss(fit: Regression) -> float:
            left = replace(fit, rows=near).residual
            return float(left @ left)

        best = min((fitted(share * span) for share in _DEFLECTIONS), key=loss)
        others = [fitted(factor * best.curve.deflection) for factor in (0.2, 0.4, 2.0, 4.0)]
        return min([best, *others], key=loss)

    def _fitted(self, law: IdentifiedLaw, rows: Rows) -> Regression:
        return regress(rows, law, self.free, self.fixed)

    def _delayed(self, rows: Rows, delay: float | None) -> Rows:
        """Return rows with another delay of the force, s; None: read when the position is."""
        shift = -0.5 * self.records[0].period if delay is None else delay
        return replace(rows, force=self._forces(rows, shift), delay=delay)

    def _forces(self, rows: Rows, delay: float) -> FloatArray:
        pairs = zip(rows.parts, self.records, strict=True)
        return np.concatenate(
            [part.rows(mean_forces(record, delay)[START:-END]) for part, record in pairs]
        )
