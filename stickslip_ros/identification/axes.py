"""Identification of axes that no spring holds: the forces of filtered records are fitted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.choice import AUTO
from stickslip_ros.identification.covariance import BLOCKS
from stickslip_ros.identification.filtered import END, START, filtered, mean_forces
from stickslip_ros.identification.identified_law import DELAY, IdentifiedLaw
from stickslip_ros.identification.laws import SaturatingAdapter, TableAdapter
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.regression import Regression, regress
from stickslip_ros.identification.rows import LINEAR, Rows
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
_DEFLECTIONS = (1e-5, 1e-4, 1e-3)
"""Deflections that are tried first, shares of the range of the positions."""
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
            hint = "; name its column, as in --columns force=u, or of a bag its --force-topic, or "
            raise InvalidInputError(
                f"{'the recorded force is always 0' if given else 'no force is recorded'}: without "
                "one only the ratio of friction and mass of an axis is identifiable: if it coasts, "
                "give its mass, as in --fix plant.mass=95"
                + ("" if given else f"{hint}--force effort")
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
        self.rows = Rows.of([filtered(record, decimated=True) for record in records])
        if self.delay is not None or self.rows.resting:
            self.rows = self._rows(self.delay or 0.0)
        for part, record in zip(self.rows.parts, records, strict=True):
            blocks = np.array_split(np.abs(part.velocity), BLOCKS)
            speeds = np.array([float(block.mean()) for block in blocks])
            gain = float((speeds - np.minimum.accumulate(speeds)).max())
            if coasts and "bias_force" not in fixed and gain > _GAIN * float(speeds.max()):
                raise InvalidInputError(
                    f"{record.name}: the axis gains speed, and no force is recorded; choose a part "
                    "in which it coasts, by --from and --to"
                )

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
                fits.append(self._with_delay(curve))
        if fits and self.limit.is_over:
            self.left += ["table", "lugre"]
        elif law in (AUTO, "table", "lugre"):
            progress("table")
            knots = np.quantile(self.rows.speeds, np.linspace(0.0, 1.0, _KNOTS))
            knots[0] = 0.0
            tables = SaturatingAdapter(self.rows.curve_speeds), TableAdapter(knots)
            best = min(map(self._with_delay, tables), key=lambda fit: fit.error)
            fits += [best] if law != "lugre" else []
            if law != "table":
                progress("lugre")
                fits.append(self._with_memory(best, asked=law == "lugre"))
        return fits

    def _with_delay(self, law: IdentifiedLaw) -> Regression:
        """Return a fit with a delay if the records ask for one."""
        fit = without = self._fitted(law, self.rows).validated()
        if self.delay is not None:
            return without
        if self.rows.resting:
            fits = fit, self._fitted(law, self._rows(None)).validated()
            without = min(fits, key=lambda fitted: fitted.error)
        best = 0.0
        for tried in (_DELAYS, _DELAY_STEPS):
            best = self._best_delay(fit, best + tried)
            fit = self._fitted(law, self._rows(best * self.records[0].period))
        fit = fit.validated()
        return fit if fit.error < _RESOLVED_ERROR_RATIO * without.error else without

    def _best_delay(self, fit: Regression, tried: FloatArray) -> float:
        """Return the delay, in samples, with which the errors of a fit are least."""
        period = self.records[0].period
        design, wanted = fit.system
        changes = [self._forces(delay * period) - fit.rows.force for delay in tried.tolist()]
        wanted = wanted[:, None] + np.column_stack(changes)
        left = wanted - design @ np.linalg.lstsq(design, wanted, rcond=None)[0]
        return float(tried[np.argmin(np.sum(left * left, axis=0))])

    def _with_memory(self, static: Regression, *, asked: bool) -> Regression:
        """Return the fit whose friction follows the table of another over a path."""
        speeds, table = self.rows.curve_speeds, static.curve
        span = max(float(np.ptp(record.position)) for record in self.records)

        def fitted(deflection: float) -> Regression:
            bristled = (
                SaturatingAdapter(speeds, deflection)
                if table.shaped
                else TableAdapter(speeds, table.speeds, deflection)
            )
            return replace(static, curve=bristled).refitted()

        best = min((fitted(share * span) for share in _DEFLECTIONS), key=_loss)
        others = [fitted(factor * best.curve.deflection) for factor in (0.2, 0.4, 2.0, 4.0)]
        memory = min([best, *others], key=_loss).validated()
        if asked or memory.error < _RESOLVED_ERROR_RATIO * static.error:
            return memory
        share = f"{1.0 - _RESOLVED_ERROR_RATIO:.0%}"
        remark = f"predicts better by less than {share}: not resolved by filtered rows"
        return replace(memory, remark=remark)

    def _fitted(self, law: IdentifiedLaw, rows: Rows) -> Regression:
        return regress(rows, law, self.free, self.fixed)

    def _rows(self, delay: float | None) -> Rows:
        """Return the rows with another delay of the force, s; None: read when the position is."""
        shift = -0.5 * self.records[0].period if delay is None else delay
        return replace(self.rows, force=self._forces(shift), delay=delay)

    def _forces(self, delay: float) -> FloatArray:
        pairs = zip(self.rows.parts, self.records, strict=True)
        return np.concatenate(
            [part.rows(mean_forces(record, delay)[START:-END]) for part, record in pairs]
        )


def _loss(fit: Regression) -> float:
    return float(fit.residual @ fit.residual)
