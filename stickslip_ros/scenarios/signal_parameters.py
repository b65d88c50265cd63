"""The parameters of the signals of a run: belt, load, disturbance and reference."""

from collections.abc import Iterator
from enum import StrEnum
from inspect import signature
from math import inf
from typing import Any, ClassVar, Self

from pydantic import PrivateAttr, ValidationInfo, model_validator
from typing_extensions import override

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.signals import NO_SIGNAL, SIGNALS, Signal, SignalKind, table
from stickslip_ros.scenarios.curve_file import Pairs, read_curve
from stickslip_ros.scenarios.parameter_field import SMALLEST, Fixed, field
from stickslip_ros.scenarios.validation import ParameterGroup

_USED = {
    **{kind: set(signature(make).parameters) for kind, make in SIGNALS.items()},
    SignalKind.TABLE: {"file"},
}
"""The parameters that each kind of signal uses."""


class ReferenceKind(StrEnum):
    """Source of a reference."""

    NONE = "none"
    TOPIC = "topic"
    """Given from outside; as a function of time there is none."""
    STEP = "step"
    RAMP = "ramp"
    SINE = "sine"
    TRAPEZOID = "trapezoid"


class _SignalParameters(ParameterGroup):
    part: ClassVar[str]
    """Name of the group in the parameters."""

    kind: Any = ""
    amplitude: float = field(0.0, "Amplitude of the course.")
    start: float = field(0.0, "Simulated time at which the course starts.", "s", ge=0.0, le=1e9)
    duration: float = field(
        inf,
        "Duration of the course; of a ramp, the time of its rise.",
        "s",
        ge=0.0,
        allow_inf_nan=True,
    )
    frequency: float = field(
        1.0,
        "Frequency of the sine; one over the time of each rise and fall of the trapezoid.",
        "Hz",
        ge=SMALLEST,
        le=1e9,
    )

    @model_validator(mode="after")
    def _signal_is_possible(self) -> Self:
        """Refuse constants that do not make a signal, under their names as parameters."""
        try:
            self.signal(period=1.0)
        except InvalidInputError as error:
            raise ValueError(f"{self.part}.{error}") from None
        return self

    def signal(self, period: float) -> Signal:
        """Return the signal in SI units; `period` is the sample period, s."""
        make = SIGNALS.get(self.kind)
        if make is None:
            return NO_SIGNAL
        given = {**dict(self), "period": period}
        return make(**{name: given[name] for name in signature(make).parameters})

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        kinds: Any = type(self.kind)
        for name in type(self).model_fields:
            users = [kind for kind in kinds if name in _USED.get(kind, ())]
            if name != "kind" and self.kind not in users:
                yield name, f"by the kind {self.kind}; kinds that use it: {', '.join(users)}"


class SignalParameters(_SignalParameters):
    """Signal over the time since the first sample."""

    kind: SignalKind = field(
        SignalKind.NONE,
        "Time course: none, step, impulse (one sample long), ramp, sine, trapezoid or table.",
        choices=SignalKind,
        strict=False,
        fixed=Fixed.ACTIVE,
    )
    file: str = field(
        "",
        "CSV file of the table: time (s) and value on each line, with straight lines between.",
        fixed=Fixed.RUNNING,
        file=True,
    )

    _table: Signal = PrivateAttr(default=NO_SIGNAL)

    @model_validator(mode="after")
    def _table_is_read(self, info: ValidationInfo) -> Self:
        """Read the file of a table."""
        if self.kind is SignalKind.TABLE:
            if not self.file:
                raise ValueError(
                    f"{self.part}.file = '' is refused: must be the path of a CSV file for a table"
                )
            points = read_curve(f"{self.part}.file", self.file, _check_points, info.context)
            self._curves[self.file], self._table = points, table(points)
        return self

    @override
    def signal(self, period: float) -> Signal:
        return self._table if self.kind is SignalKind.TABLE else super().signal(period)


class LoadParameters(SignalParameters):
    """Signal that is added to the normal force."""

    part: ClassVar[str] = "load"
    amplitude: float = field(0.0, "Amplitude of the change of the normal force.", "N")


class BeltParameters(SignalParameters):
    """Signal that is added to the belt speed."""

    part: ClassVar[str] = "belt"
    amplitude: float = field(0.0, "Amplitude of the change of the belt speed.", "m/s")


class DisturbanceParameters(SignalParameters):
    """Disturbance force on the slide that is part of the scenario."""

    part: ClassVar[str] = "disturbance"
    kind: SignalKind = field(
        SignalKind.NONE,
        "Time course: none, step, impulse (one sample long), ramp, sine, trapezoid or table.",
        choices=SignalKind,
        strict=False,
    )
    amplitude: float = field(0.0, "Amplitude of the disturbance.", "N")


class ReferenceParameters(_SignalParameters):
    """Reference that the controller follows."""

    part: ClassVar[str] = "reference"
    kind: ReferenceKind = field(
        ReferenceKind.NONE,
        "Source: none, the topic `reference`, or a time course (step, ramp, sine, trapezoid).",
        choices=ReferenceKind,
        strict=False,
        fixed=Fixed.CONFIGURED,
    )
    amplitude: float = field(0.0, "Largest displacement of the course.", "m")


def _check_points(points: Pairs) -> None:
    table(points)
