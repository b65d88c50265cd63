"""The identified model: constants with intervals, the friction curve, and its predictions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, isfinite, isinf
from typing import Any, TypeVar

import numpy as np

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.identification.choice import Candidate, better_by
from stickslip_ros.identification.drives import POOR_ERROR
from stickslip_ros.identification.filtered import START, Filtered, filtered
from stickslip_ros.identification.fit import Estimate, ForceErrors, Friction, Residuals
from stickslip_ros.identification.record import FEWEST, Record
from stickslip_ros.identification.rest import static_force
from stickslip_ros.identification.servo import Servo, closed_loop
from stickslip_ros.identification.trajectory import delayed
from stickslip_ros.model.drive import Drive

_STILL_SPEED = 0.02
"""Share of the fastest speed below which a slide may stick."""
_VAGUE_ERROR = 0.5
"""Standard error, as a share of the value, from which a constant counts as not identifiable."""
_USED_SHARE = 0.6
"""Share of the samples below which the fit says that it used some of them only."""
_MISSING_SHARE = 1e-3
"""Share of missing samples up to which nothing is said."""
_SPEEDS_OF_MACHINES = 1e-6, 20.0
"""Fastest speeds that a machine may have, m/s; others are in another unit."""
_FRICTION_DIFFERENCE = 0.05
"""Difference of friction at any speed, as a share of the largest, by which two laws differ."""
_NAMED_CORRELATION = 0.95
"""Correlation from which two constants are named together."""
_ADDED_SHARE = 0.3
"""Share of samples with added forces from which another controller may have acted."""
_STATIC_SHARE = 1.1
"""Largest force at which the slide may break loose, in static friction of the law, to say nothing.
"""
_BY_DIRECTION = "it merges with friction by direction, and is taken as 0"
CHECKED = (
    "force_error",
    "free_run_error",
    "segment_error",
    "position_error",
    "closed_loop_force_error",
)
"""Errors of the prediction of a recording."""

_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class Findings:
    """The model that was chosen, and what the recordings tell of it."""

    records: Sequence[Record]
    """Records to which it was fitted."""
    candidates: Sequence[Candidate]
    """All laws that competed."""
    chosen: Candidate
    """The law that was chosen."""
    as_good: Mapping[str, bool]
    """Whether each candidate, by label, predicts held-out parts as well as the best one."""
    normal_force: float
    """Normal force that scales the friction, N."""
    fixed: Mapping[str, float]
    """Constants that were given."""
    servo: Servo | None
    """The position controller in the first record that has one."""
    left: Sequence[str] = ()
    """Laws that were not fitted to the end, because the time was over."""
    _predicted: dict[tuple[Any, Record], Any] = field(
        default_factory=dict[tuple[Any, Record], Any], init=False, repr=False
    )
    """Predictions so far, by method of the fit and record."""

    def behind(self, candidate: Candidate) -> float:
        """Return by how many standard errors a law predicts held-out parts worse than the best."""
        allowed = [each for each in self.candidates if not each.remark] or self.candidates
        return better_by(min(allowed, key=lambda each: each.error), candidate)

    @property
    def law(self) -> str:
        """Friction law."""
        return self.chosen.law

    @property
    def delay(self) -> float:
        """Time from a sample until its force acts, s."""
        return self.chosen.fit.delay or 0.0

    @property
    def has_spring(self) -> bool:
        """Whether the model has a spring."""
        return self.chosen.fit.has_spring

    @cached_property
    def fitted(self) -> Mapping[str, Estimate]:
        """Constants by parameter of the plant, such as `friction.static`; SI units."""
        names, values, covariance = self._constants
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return {
            name: Estimate(float(value), float(error))
            for name, value, error in zip(names, values, errors, strict=True)
        }

    @cached_property
    def correlations(self) -> Sequence[tuple[str, str, float]]:
        """Pairs of constants whose errors go together, with their correlation."""
        names, _, covariance = self._constants
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        found: list[tuple[str, str, float]] = []
        for first, one in enumerate(names):
            for second in range(first):
                product = errors[first] * errors[second]
                share = covariance[first, second] / product if product > 0.0 else 0.0
                if isfinite(share) and abs(share) > _NAMED_CORRELATION:
                    found.append((names[second], one, float(share)))
        return found

    @cached_property
    def _constants(self) -> tuple[list[str], FloatArray, FloatArray]:
        """Names, values and covariance of the constants that are parameters of the plant."""
        return self.chosen.fit.parameters(self.normal_force)

    @property
    def notes(self) -> Sequence[str]:
        """Sentences on what makes the model doubtful."""
        return _notes(self)

    @cached_property
    def unidentified(self) -> Mapping[str, str]:
        """Why a parameter of the plant is not identifiable, and the run that would identify it."""
        return _untold(self)

    @cached_property
    def rivals(self) -> Sequence[str]:
        """Laws that predict as well as the one that was chosen, and have another friction."""
        found: list[str] = []
        for each in self.candidates:
            # The one that was chosen may have been fitted further since.
            same = each.label == self.chosen.label
            if same or not self.as_good.get(each.label) or each.remark:
                continue
            for number, sign in enumerate(self.directions):
                own, other = self.friction(number), each.fit.friction(sign, self.fastest)
                away = np.abs(np.interp(own.speed, other.speed, other.force) - own.force)
                if float(away.max()) > _FRICTION_DIFFERENCE * float(own.force.max()):
                    found.append(each.label)
                    break
        return found

    @property
    def one_belt_speed(self) -> bool:
        """Whether the belt has one velocity in all records."""
        belts = np.concatenate([record.belt_velocity for record in self.records])
        return float(np.ptp(belts)) <= 1e-3 * float(np.abs(belts).max())

    @cached_property
    def _filtered(self) -> Sequence[Filtered]:
        """Filtered columns of each record, without a delay."""
        return [filtered(each, decimated=False) for each in self.records]

    @property
    def _speeds(self) -> Sequence[FloatArray]:
        """Sliding speeds of each record, m/s."""
        return [np.abs(each.relative_speed) for each in self._filtered]

    @property
    def slowest(self) -> float:
        """Slowest speed |v_r| that was recorded for long, m/s."""
        speeds = np.concatenate(self._speeds)
        return float(np.quantile(speeds[speeds > _STILL_SPEED * float(speeds.max())], 0.02))

    @property
    def stuck(self) -> bool:
        """Whether the slide stuck in a record; the filter blurs short sticking, noise the rest."""
        raw = (
            np.abs(np.diff(each.position) / each.period - each.belt_velocity[1:])
            for each in self.records
        )
        return any(
            np.mean(each > _STILL_SPEED * each.max()) < 0.98 for each in (*self._speeds, *raw)
        )

    @property
    def directions(self) -> Sequence[float]:
        """Signs of the relative speed that were recorded: 1, -1 or both."""
        return self.chosen.fit.directions

    def friction(self, direction: int = 0) -> Friction:
        """Return the friction curve over the recorded speeds, in one of `directions`."""
        return self.chosen.fit.friction(self.directions[direction], self.fastest)

    @property
    def fastest(self) -> float:
        """Fastest speed |v_r| that was recorded, m/s."""
        return max(float(each.max()) for each in self._speeds)

    @cached_property
    def drive(self) -> Drive:
        """The drive, with the usual belt speed of the first record: the median where it moves."""
        return self.chosen.fit.drive(self.normal_force, _usual(self.records[0].belt_velocity))

    def errors(self, record: Record | None = None) -> ForceErrors:
        """Return measured and modelled forces on the filtered rows of a record, or of the first.

        Of a drive on a spring these are the rows where it slips.
        """
        return self.chosen.fit.errors(self.records[0] if record is None else record)

    def force_error(self, record: Record) -> float | None:
        """Return the rms of F - F_model over that of F, on filtered rows; None without a force."""
        if not record.held_force.any():
            return None
        found = self.errors(record)
        return rms(found.error) / rms(found.force) if len(found.force) else None

    def free_run(self, record: Record) -> FloatArray:
        """Return the positions that the model runs through, with the recorded force, no feedback.

        The velocity at the start is the one that fits best. A drive on a spring starts where the
        slide is fast relative to the belt, at the position that fits best, too; NaN before.
        """
        return self._once(self.chosen.fit.free_run, record)

    def residuals(self, record: Record | None = None) -> Residuals:
        """Return what the model leaves of a record, or of the first one.

        Of a drive on a spring these are the position errors in segments like those of the fit, each
        from the state that fits best. The model of an axis is fitted to the forces.
        """
        return self._once(self.chosen.fit.residuals, self.records[0] if record is None else record)

    def _once(self, predicted: Callable[[Record], _T], record: Record) -> _T:
        key = predicted, record
        if key not in self._predicted:
            self._predicted[key] = predicted(record)
        return self._predicted[key]

    def check(self, record: Record) -> dict[str, float | None]:
        """Return what the model predicts of a record, as `CHECKED` names it.

        `free_run_error` and `segment_error` are in m, the others are shares of the rms of what was
        recorded. What is unbounded is infinite.
        """
        record.require_motion()
        away = (self.free_run(record) - record.position)[~record.lost]
        error = rms(away[~np.isnan(away)]) if self.has_spring else rms(away)
        found: dict[str, float | None] = dict.fromkeys(CHECKED)
        found |= {
            "force_error": self.force_error(record),
            "free_run_error": error if isfinite(error) else inf,
            "segment_error": rms(self.residuals(record).error) if self.has_spring else None,
        }
        led = record.led
        if self.servo is not None and led is not None and led.force is not None:
            position, force = closed_loop(led, self.drive, self.servo, self.delay)
            found["position_error"] = _relative(position[START:], led.position[START:])
            found["closed_loop_force_error"] = _relative(force[START:], led.force[START:])
        return found


def _usual(belt: FloatArray) -> float:
    """Return the median speed of a belt where it moves, in its more frequent direction."""
    size = np.abs(belt)
    moving = belt[size > _STILL_SPEED * float(size.max())]
    if not len(moving):
        return 0.0
    sign = 1.0 if np.mean(moving > 0.0) >= 0.5 else -1.0
    return float(np.median(moving[moving * sign > 0.0]))


def _relative(found: FloatArray, measured: FloatArray) -> float:
    """Return the rms error as a share of what was measured; infinite of an unbounded motion."""
    return rms(found - measured) / rms(measured) if np.isfinite(found).all() else inf


def notes_on(found: Findings, record: Record) -> Sequence[str]:
    """Return sentences on what cannot be predicted of a record, and why."""
    if found.servo is None or record.reference is None or record.force is None:
        return record.notes
    led = record.led
    if led is None:
        why = f"has no {FEWEST} samples in a row: the closed loop is not predicted"
        return [*record.notes, f"the reference of {record.name} {why}"]
    share = float(np.mean(found.servo.added(led) != 0.0))
    if share < _ADDED_SHARE:
        return record.notes
    return [
        *record.notes,
        f"the controller that was found does not explain {share:.0%} of the forces of "
        f"{record.name}: they are taken as forces added to its command; if another controller "
        "acted, its closed loop is not predicted",
    ]


def _notes(found: Findings) -> Sequence[str]:
    """Return sentences on what makes the model doubtful."""
    notes: list[str] = []
    if found.chosen.error >= POOR_ERROR:
        notes.append(
            f"the model does not describe the recordings: its error is {found.chosen.error:.0%} "
            "of what it predicts; an input may be missing (a disturbance, the velocity of the "
            "belt), or have another sign or unit"
        )
    for name in dict.fromkeys(record.name for record in found.records):
        own = [record for record in found.records if record.name == name]
        notes += [f"{name}: {note}" for note in own[0].notes]
        missing = float(np.mean(np.concatenate([record.lost for record in own])))
        if missing > _MISSING_SHARE:
            used = ", and not fitted" if found.has_spring else ""
            notes.append(
                f"{100.0 * missing:.2g} % of the samples of {name} are missing: they are "
                f"interpolated{used}"
            )
        if own[0].left_out > 0.0:
            notes.append(
                f"{100.0 * own[0].left_out:.2g} % of the samples of {name} are left out: they "
                f"are in parts of less than {FEWEST} samples between gaps"
            )
    if found.left:
        notes.append(
            f"the time was over before these laws were fitted to the end: {', '.join(found.left)}; "
            "more time is --time-limit, a single law is --law"
        )
    if not _SPEEDS_OF_MACHINES[0] <= found.fastest <= _SPEEDS_OF_MACHINES[1]:
        notes.append(
            f"the slide is as fast as {found.fastest:.3g} m/s: check the units of time, position "
            "and belt velocity"
        )
    fit = found.chosen.fit
    if fit.used < _USED_SHARE:
        notes.append(
            f"{fit.used:.0%} of the samples were used, in parts over the whole length: the "
            "recordings are long; choose a part by --from and --to"
        )
    if fit.repetition is not None:
        notes.append(
            f"the errors repeat every {fit.repetition} samples: the motion takes a whole "
            "number of samples, so that rounding does not average out; the intervals may be "
            "too narrow"
        )
    return notes


def _static_friction(found: Findings) -> str:
    """Return what rests tell of the static friction, where it may be another one than the law's."""
    fit, texts = found.chosen.fit, list[str]()
    values = fit.values_at(fit.point)
    records = [delayed(record, found.delay) for record in found.records]
    for sign, way in zip((1.0, -1.0), ("forward", "backward"), strict=True):
        if sign not in found.directions:
            continue
        held = (
            record.held_force + values["bias_force"] - values["stiffness"] * record.position
            for record in records
        )
        bounds = [static_force(*each, sign) for each in zip(records, held, strict=True)]
        low, high = max(low for low, _ in bounds), min(high for _, high in bounds)
        own = float(fit.force_at(fit.point, sign, np.zeros(1))[0])
        if isfinite(low) and isfinite(high) and not low <= own <= high <= _STATIC_SHARE * own:
            texts.append(
                f"{way} the slide rests under {low:.3g} N and moves at {high:.3g} N at the latest, "
                f"where the law has {own:.3g} N"
            )
    return ", ".join(texts)


def _untold(found: Findings) -> dict[str, str]:
    """Return why parameters of the plant are not identifiable, and the run that would help."""
    why = {
        "normal_force": "only friction forces are identifiable: it is taken as 1 N, so that "
        "coefficients are in N and viscous ones in N s/m; give it by --fix plant.normal_force=..."
    }
    slower = f"run below {1e3 * found.slowest:.3g} mm/s"
    one_direction = len(found.directions) == 1
    if not found.has_spring:
        why["damping"] = (
            "viscous damping and the viscous part of friction are one where the belt is at rest: "
            "it is in the friction, and taken as 0"
        )
        why["stiffness"] = (
            "no spring is looked for on a belt at rest: it is taken as 0; give it by "
            "--fix plant.stiffness=..."
        )
        why["bias_force"] = (
            "it merges with the static friction of a single direction, and is taken as 0; run in "
            "both directions"
            if one_direction
            else _BY_DIRECTION
        )
        if found.law != "coulomb":  # its static coefficient is that of slip
            why["friction.static"] = (
                "no row at rest is fitted: it is the curve at its slowest steady speed extended "
                f"to rest; {slower}"
            )
        if at_rest := _static_friction(found):
            why["friction.static"] = (
                f"it is that of slip; {at_rest}: the law stiction has static friction of its own, "
                "and a force that rises slowly from rest tells it"
            )
    else:
        if found.one_belt_speed:
            why["damping"] = (
                "at one belt speed it merges with a linear part of friction, and is taken as 0; "
                "run at several belt speeds"
            )
        if one_direction:
            why["bias_force"] = (
                "in one direction it merges with the static friction, and is taken as 0; run in "
                "both directions"
            )
        elif found.chosen.by_direction:
            why["bias_force"] = _BY_DIRECTION
        if not found.stuck and found.law not in ("coulomb", "stiction", "dahl"):
            why["friction.static"] = (
                f"no record shows sticking: it is the curve extended to rest; {slower}"
            )
    known = {*found.fixed, *found.fitted} - {"friction.static"}
    why = {name: reason for name, reason in why.items() if name not in known}
    if found.rivals:
        names = ", ".join([found.chosen.label, *found.rivals[:-1]])
        why["friction.law"] = (
            f"{names} and {found.rivals[-1]} predict held-out parts alike, but differ in friction "
            "at speeds that were hardly recorded: the simplest is taken; run with relative speeds "
            f"from rest to {1e3 * found.fastest:.3g} mm/s"
        )
    for name, estimate in found.fitted.items():
        if estimate.standard_error < _VAGUE_ERROR * abs(estimate.value) or name in why:
            continue
        sure = f"{estimate.value:.4g} has a standard error of {estimate.standard_error:.2g}"
        if isinf(estimate.standard_error):
            sure = f"{estimate.value:.4g} is one of many values that fit alike"
        why[name] = f"{sure}; a run with other speeds and forces may identify it"
    return why
