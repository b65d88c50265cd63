"""The search of one friction law: the motion of a drive on a spring is simulated and fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import inf, pi, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.filtered import filtered
from stickslip_ros.identification.fit import OUT_OF_TIME
from stickslip_ros.identification.identified_law import DELAY, LAG, IdentifiedLaw
from stickslip_ros.identification.laws import EXPONENTIAL, TableAdapter
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.refinement import OPTIONAL, Refinement, loss_of
from stickslip_ros.identification.regression import Regression, regress
from stickslip_ros.identification.regression_rows import LINEAR, Rows
from stickslip_ros.identification.rests import static_force
from stickslip_ros.identification.search import refine
from stickslip_ros.identification.segment_starts import Errors, best_starts
from stickslip_ros.identification.time_limit import TimeLimit
from stickslip_ros.identification.trajectories import Trajectories, segments_of

_SHORT_SEGMENT, _LONG_SEGMENT = 1.25, 5.0
"""Length of the segments in natural periods: of the search, and of the fit."""
_FIRST_STEPS, _STEPS, _FINALISTS = 5, 100, 2
"""Steps of the search from each start, steps from the best ones, and their number."""
_RIVAL_STEPS = 20
"""Steps from the best start while the errors of another law are noise."""
_RESTART_LOSS_RATIO = 0.95
"""Other starts of segments must lower the squared error to this share, or the search ends."""
_NEAR_SHARE = 1e-3
"""Share of the motion from which on an error needs no other start."""
_SHAPES, _MEMORY_STARTS = (0.1, 0.3, 0.8), 3
"""Shapes from which the search starts, besides that of the regression: shares of the speeds; and
the number of starts of a law with a memory from which it takes steps, besides the first."""
_OPTIONAL_GAIN, _OPTIONAL_ERRORS = 0.05, 4.0
"""Share of the squared error, and standard errors, for which one more constant is searched."""
_CLEAR_GAIN = 0.5
"""Share of the squared error for which it is searched in any case: where the error is that of what
is missing, it makes the standard error large."""
_ZERO_ERRORS = 3.0
"""Standard errors by which such a constant must differ from zero."""
_GIVEN_UP_LOSS_RATIO = 100.0
"""A law whose squared error is larger by this factor is searched no further."""
_SEARCH_SAMPLES, _MOST_SAMPLES = 4_000, 15_000
"""Samples of a drive in which a law is searched, and that are fitted: minutes of work."""
_POINTS = 8
"""Number of points of friction without a law."""
_LEAST_SHARE = 1e-9
"""Smallest friction from which a search starts, as a share of the other forces."""


class LawSearch:
    """Records of a drive on a spring, with what is known of it, and the fits of laws to them."""

    def __init__(
        self, records: Sequence[Record], fixed: Mapping[str, float], limit: TimeLimit
    ) -> None:
        self.records, self.limit = records, limit
        self.normal_force = fixed.get("normal_force", 1.0)
        self.fixed = {name: fixed[name] for name in (*LINEAR, DELAY) if name in fixed}
        self.friction = {
            name.removeprefix("friction."): value
            for name, value in fixed.items()
            if name.startswith("friction.")
        }
        self.free = [name for name in ("mass", "stiffness") if name not in self.fixed]
        if all(not record.held_force.any() for record in records) and len(self.free) == 2:
            raise InvalidInputError(
                "no force acts in the recordings: only ratios of mass, stiffness and friction are "
                "identifiable; fix one, as in --fix plant.mass=100"
            )
        delay = self.fixed.get(DELAY, 0.0)
        self.rows = Rows.of_records(
            [filtered(record, decimated=False, delay=delay) for record in records]
        )
        self.predictors = [Predictor(record) for record in records]
        self._first: dict[IdentifiedLaw, Refinement] = {}

    @cached_property
    def constants(self) -> Mapping[str, float]:
        """Mass and stiffness by the regression; InvalidInputError where one is not above zero."""
        fit = self._regression(EXPONENTIAL)
        fit.require("mass", "stiffness")
        return fit.constants

    @cached_property
    def period(self) -> float:
        """Natural period by the regression, s, within what the records can have."""
        natural = 2.0 * pi * sqrt(self.constants["mass"] / self.constants["stiffness"])
        shortest = 20.0 * self.records[0].period
        longest = max(record.duration for record in self.records) / _LONG_SEGMENT
        return max(min(natural, longest), shortest)

    def by_regression(self, laws: Sequence[IdentifiedLaw]) -> Sequence[IdentifiedLaw]:
        """Return laws in the order of the errors of their regressions, the best one first."""
        return sorted(laws, key=lambda law: rms(self._regression(law.one_way).residual))

    @property
    def begun(self) -> Sequence[Refinement]:
        """Fits after the first steps from the first start, of the laws that have some."""
        return [*self._first.values()]

    def first(self, law: IdentifiedLaw) -> Refinement:
        """Return the fit after the first steps from the first start."""
        if law not in self._first:
            values = self._starts(law, self._regression(law.one_way))[0]
            self._first[law] = self._begun(law, values)
        return self._first[law]

    def extend_best(self) -> None:
        """Give the best fit so far the constants of any law that the records ask for."""
        best = min(self.begun, key=loss_of)
        self._first[best.law] = self._with(OPTIONAL, best, least_share=_OPTIONAL_GAIN)

    def searched(self, law: IdentifiedLaw, noise: float = inf) -> Sequence[Refinement]:
        """Return the best fits to short segments, from several starts.

        `noise` is the squared error of a law whose errors are noise: one that is much worse after
        the first steps is not searched further.
        """
        tried = [self.first(law)]
        if tried[0].is_white or _is_given_up(tried[0], noise):
            return tried
        fastest = float(self.rows.speeds[-1])
        thorough = law.one_way.shaped and noise == inf
        shapes = [share * fastest for share in _SHAPES] if thorough else []
        starts = [
            start
            for shape in (None, *shapes)
            for start in self._starts(law, self._regression(law.one_way, shape))
        ]
        others = starts[1:]
        if law.memory:  # its steps take long, and no coordinate stays as it is at the start
            others = sorted(others, key=lambda values: self._misfit(law, values))[:_MEMORY_STARTS]
        for values in others:
            if self.limit.is_over or rms(tried[-1].residual) < _NEAR_SHARE * tried[-1].scale:
                break
            tried.append(self._begun(law, values))
            if tried[-1].is_white:
                return tried[-1:]
        finalists, most = (_FINALISTS, _STEPS) if noise == inf else (1, _RIVAL_STEPS)
        settled: list[Refinement] = []
        for near in sorted(tried, key=loss_of)[:finalists]:
            settled.append(self._settled(near, most))
            if settled[-1].is_white or settled[-1].is_rounding or self.limit.is_over:
                break
        return settled

    def searched_near(self, law: IdentifiedLaw, like: Refinement) -> Sequence[Refinement]:
        """Return the best fit of a law with a memory to short segments, from a LuGre model."""
        # The static friction of Dahl's law is the kinetic one.
        begun = self._begun(law, {**like.values, "static": like.values["kinetic"]})
        stays = begun.is_white or _is_given_up(begun, like.loss)
        return [begun if stays else self._settled(begun)]

    def extended(self, near: Sequence[Refinement], least: float) -> Refinement:
        """Return the best fit of a law with the constants that the records ask for.

        `near` has its fits without them, in the order in which they are tried. Where the squared
        error of the best law so far is much less, `least`, they are as they are.
        """
        if _is_given_up(best := min(near, key=loss_of), least):
            return best
        extended: list[Refinement] = []
        for fit in near:
            names = () if fit.is_white else (*OPTIONAL, *fit.law.optional)
            more = self._with(names, fit, least_share=_OPTIONAL_GAIN)
            extended.append(more)
            if more.is_white or more.is_rounding:
                break
        return min(extended, key=loss_of)

    def _starts(self, law: IdentifiedLaw, fit: Regression) -> Sequence[Mapping[str, float]]:
        """Return the coordinates from which a law is searched: first those that rests tell."""
        values = self._start(law, fit)
        starts = law.starts(values, float(self.rows.speeds[-1]))
        if law.identifiable_in_slip or len(self.rows.directions) > 1:
            return starts
        (sign,), static = self.rows.directions, -inf
        for record in self.records:
            held = record.held_force + values["bias_force"] - values["stiffness"] * record.position
            static = max(static, static_force(record, held, sign)[0])
        rise = static - law.static_force({**values, "rise": 0.0})
        return [{**values, "rise": rise}, *starts] if rise > 0.0 else starts

    def _start(self, law: IdentifiedLaw, fit: Regression) -> dict[str, float]:
        """Return the coordinates that a regression gives, within their bounds."""
        constants, columns = fit.constants, fit.rows.columns
        others = sum(abs(value) * rms(columns[name]) for name, value in constants.items())
        smallest = _LEAST_SHARE * (others or 1.0)
        directions = [fit.curve.start(coordinates, smallest) for coordinates in fit.coordinates]
        # A curve that does not suit the friction may leave no mass or stiffness to them.
        unfit = [name for name in self.free if not constants[name] > 0.0]
        return {
            **constants,
            **law.joined(directions if law.one_way is not law else directions[-1:]),
            **{name: self.constants[name] for name in unfit},
        }

    @cached_property
    def table(self) -> TableAdapter:
        """Friction without a law, at the speeds that were recorded."""
        speeds = np.quantile(self.rows.speeds, np.linspace(0.0, 1.0, _POINTS))
        speeds[0] = 0.0
        return TableAdapter(speeds)

    def _begun(self, law: IdentifiedLaw, values: Mapping[str, float]) -> Refinement:
        """Return the fit to short segments after the first steps from a start."""
        names = [*self.free, *law.coordinates]
        names = [name for name in names if name not in (*self.friction, *law.optional)]
        return refine(self._short(law), names, self._known(law, values), most=_FIRST_STEPS)

    def _misfit(self, law: IdentifiedLaw, values: Mapping[str, float]) -> float:
        """Return the squared error at a start of a search, to first order, before any step."""
        task = self._short(law)
        errors = Errors.at(task, (), self._known(law, values), task.starts)
        left = errors.without_starts(errors.residual[:, None])
        return float(np.sum(left * left))

    def _settled(self, near: Errors, most: int = _STEPS) -> Refinement:
        """Return the best fit near other values: segments with wrong starts try others."""
        fit = refine(near.task, near.names, near.values, near.starts, most=most)
        while fit.has_outliers and not self.limit.is_over:
            other = fit.restarted()
            if other.loss > _RESTART_LOSS_RATIO * fit.loss:
                break
            fit = refine(near.task, near.names, other.values, other.starts, most=most)
        return fit

    def _with(self, more: Sequence[str], fit: Refinement, *, least_share: float) -> Refinement:
        """Return the fit with those of some more constants that the records ask for.

        They must take away a share of the squared error, and differ clearly from zero.
        """
        task = fit.task
        for name in more:
            values = fit.values
            if name in self.fixed or name in self.friction or name in fit.names:
                continue
            if name == LAG and DELAY in fit.names:
                # A short lag is like a delay, which stands for most of it: gains do not tell.
                values = {**values, **dict.fromkeys((DELAY, LAG), 0.5 * values[DELAY])}
            else:
                errors, share = fit.gain(name)
                unclear = abs(errors) < _OPTIONAL_ERRORS and share < _CLEAR_GAIN
                if unclear or share < least_share:
                    continue
            other = refine(task, [*fit.names, name], values, fit.starts, most=_STEPS)
            if other.loss >= fit.loss:
                continue
            if _errors_from_zero(other, name) > _ZERO_ERRORS:
                fit = other
                continue
            # It was not needed, but may have led the others out of a local minimum.
            without = {**other.values, name: fit.values[name]}
            other = refine(task, fit.names, without, other.starts, most=_STEPS)
            fit = min(fit, other, key=loss_of)
        if {DELAY, LAG} <= {*fit.names} and _errors_from_zero(fit, DELAY) < _ZERO_ERRORS:
            # It stood for the lag.
            free = [name for name in fit.names if name != DELAY]
            fit = refine(task, free, {**fit.values, DELAY: 0.0}, fit.starts, most=_STEPS)
        return fit

    def finished(self, near: Refinement) -> Refinement:
        """Return a fit to long segments, with the constants that the records ask for."""
        task = self._trajectories(near.law, _LONG_SEGMENT * self.period, _MOST_SAMPLES)
        # Measured starts are too rough for motions that grow over a segment.
        begun = best_starts(task, near.values).restarted()
        fit = self._settled(replace(begun, names=near.names))
        fit = self._with((*OPTIONAL, *fit.law.optional), fit, least_share=0.0)
        validated = replace(fit, held_out=_held_out(fit))
        return remarked(fit, OUT_OF_TIME) if self.limit.is_over else validated

    def _regression(self, law: IdentifiedLaw, shape: float | None = None) -> Regression:
        fixed = {name: self.fixed.get(name, 0.0) for name in LINEAR if name not in self.free}
        return regress(self.rows, law, self.free, fixed, shape)

    def _short(self, law: IdentifiedLaw) -> Trajectories:
        return self._trajectories(law, _SHORT_SEGMENT * self.period, _SEARCH_SAMPLES)

    def _trajectories(self, law: IdentifiedLaw, length: float, most: int) -> Trajectories:
        # Of the segments of long records one of so many is used.
        stride = -(-sum(len(record.position) for record in self.records) // most)
        segments = segments_of(self.predictors, length)[::stride]
        directions = self.rows.directions
        return Trajectories(law, directions, segments, self.normal_force, self.limit)

    def _known(self, law: IdentifiedLaw, values: Mapping[str, float]) -> dict[str, float]:
        friction = {
            name: value * (1.0 if name in law.unscaled else self.normal_force)
            for name, value in self.friction.items()
        }
        return {DELAY: 0.0, LAG: 0.0, **values, **friction, **self.fixed}


def _is_given_up(fit: Refinement, loss: float) -> bool:
    """Return whether a fit is too far behind a squared error for a search to go on.

    It is that of noise, that of LuGre's law after the first steps, or that of the best law before
    constants are added that the records ask for.
    """
    return fit.loss > _GIVEN_UP_LOSS_RATIO * loss


def _errors_from_zero(fit: Refinement, name: str) -> float:
    """Return by how many standard errors a fitted coordinate differs from zero."""
    place = [*fit.names].index(name)
    error = sqrt(max(fit.covariance[place, place], 0.0))
    return abs(fit.values[name]) / error if error > 0.0 else inf


def remarked(fit: Refinement, remark: str) -> Refinement:
    """Return a fit that is out of the choice, with its errors in the segments that it is for."""
    return replace(fit, held_out=fit.losses, remark=remark)


def _held_out(fit: Refinement) -> FloatArray:
    """Return the mean square error in each segment, fitted to the other half of the segments."""
    losses, segments = fit.losses, fit.task.segments
    if len(segments) < 4:
        return losses
    even, odd = slice(0, None, 2), slice(1, None, 2)
    for training, other in ((even, odd), (odd, even)):
        task, rest = (replace(fit.task, segments=segments[half]) for half in (training, other))
        trained = refine(task, fit.names, fit.values, fit.starts[training], most=6)
        losses[other] = best_starts(rest, trained.values, fit.starts[other]).losses
    return losses
