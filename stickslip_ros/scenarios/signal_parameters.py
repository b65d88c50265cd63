"""The parameters of the signals of a run: belt, load, disturbance and reference."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from inspect import signature
from math import inf
from typing import Any, Self

from typing_extensions import override

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.constants import Changes, constant
from stickslip_ros.physics.model.signals import NO_SIGNAL, SIGNALS, Signal, SignalKind, table
from stickslip_ros.scenarios.curve_file import Pairs, read_curve
from stickslip_ros.scenarios.validation import ParameterGroup

_USED = {
    **{kind: set(signature(make).parameters) for kind, make in SIGNALS.items()},
    SignalKind.TABLE: {"file"},
}
"""The parameters that each kind of signal uses."""
_TIME_COURSE = "Time course: none, step, impulse (one sample long), ramp, sine, trapezoid or table."


class ReferenceKind(StrEnum):
    """Source of a reference."""

    NONE = "none"
    TOPIC = "topic"
    """Given from outside; as a function of time there is none."""
    STEP = "step"
    RAMP = "ramp"
    SINE = "sine"
    TRAPEZOID = "trapezoid"


@dataclass(frozen=True)
class _TimeCourse(ParameterGroup):
    kind: Any = ""
    amplitude: float = constant(0.0, "Amplitude of the course.")
    start: float = constant(
        0.0, "Simulated time at which the course starts.", "s", at_least=0.0, at_most=1e9
    )
    duration: float = constant(
        inf, "Duration of the course; of a ramp, the time of its rise.", "s", at_least=0.0
    )
    frequency: float = constant(
        1.0,
        "Frequency of the sine; one over the time of each rise and fall of the trapezoid.",
        "Hz",
        positive=True,
        at_most=1e9,
    )

    @override
    def completed(self, prefix: str, curves: dict[str, Pairs]) -> Self:
        try:
            self.signal(period=1.0)
        except InvalidInputError as error:
            raise ValueError(f"{prefix}{error}") from None
        return self

    def signal(self, period: float) -> Signal:
        """Return the signal in SI units; `period` is the sample period, s."""
        make = SIGNALS.get(self.kind)
        if make is None:
            return NO_SIGNAL
        given = {**vars(self), "period": period}
        return make(**{name: given[name] for name in signature(make).parameters})

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        kinds: Any = type(self.kind)
        for name in self.known:
            users = [kind for kind in kinds if name in _USED.get(kind, ())]
            if name != "kind" and self.kind not in users:
                yield name, f"by the kind {self.kind}; kinds that use it: {', '.join(users)}"


@dataclass(frozen=True)
class SignalParameters(_TimeCourse):
    """Signal over the time since the first sample."""

    kind: SignalKind = constant(SignalKind.NONE, _TIME_COURSE, changes=Changes.AT_REST)
    file: str = constant(
        "",
        "CSV file of the table: time (s) and value on each line, with straight lines between.",
        changes=Changes.AT_START,
        file=True,
    )
    points: Pairs = ()
    """Content of the file of a table."""

    @override
    def completed(self, prefix: str, curves: dict[str, Pairs]) -> Self:
        if self.kind is not SignalKind.TABLE:
            return replace(super().completed(prefix, curves), points=())
        if not self.file:
            raise ValueError(
                f"{prefix}file = '' is refused: must be the path of a CSV file for a table"
            )
        return replace(self, points=read_curve(f"{prefix}file", self.file, _check_points, curves))

    @override
    def signal(self, period: float) -> Signal:
        return self._table if self.kind is SignalKind.TABLE else super().signal(period)

    @cached_property
    def _table(self) -> Signal:
        return table(self.points)


@dataclass(frozen=True)
class LoadParameters(SignalParameters):
    """Signal that is added to the normal force."""

    amplitude: float = constant(0.0, "Amplitude of the change of the normal force.", "N")


@dataclass(frozen=True)
class BeltParameters(SignalParameters):
    """Signal that is added to the belt speed."""

    amplitude: float = constant(0.0, "Amplitude of the change of the belt speed.", "m/s")


@dataclass(frozen=True)
class DisturbanceParameters(SignalParameters):
    """Disturbance force on the slide that is part of the scenario."""

    kind: SignalKind = constant(SignalKind.NONE, _TIME_COURSE)
    amplitude: float = constant(0.0, "Amplitude of the disturbance.", "N")


@dataclass(frozen=True)
class ReferenceParameters(_TimeCourse):
    """Reference that the controller follows."""

    kind: ReferenceKind = constant(
        ReferenceKind.NONE,
        "Source: none, the topic `reference`, or a time course (step, ramp, sine, trapezoid).",
        changes=Changes.AT_BUILD,
    )
    amplitude: float = constant(0.0, "Largest displacement of the course.", "m")


def _check_points(points: Pairs) -> None:
    table(points)
