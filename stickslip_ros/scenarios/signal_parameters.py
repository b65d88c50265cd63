"""The parameters of the signals of a run: belt, load, disturbance and reference."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from inspect import signature
from math import inf
from typing import Any, Self

from typing_extensions import override

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Changes, at_build, constant
from stickslip_ros.model.signals import NO_SIGNAL, SIGNALS, Signal, table
from stickslip_ros.scenarios.curve_file import Pairs, read_curve
from stickslip_ros.scenarios.parameter_group import ParameterGroup

_NEEDS = {kind: list(signature(make).parameters) for kind, make in SIGNALS.items()}
"""Arguments of the function of each kind of signal: parameters, the sample period, the points."""


def _kind(changes: Changes) -> Any:
    return constant(
        "none",
        "Time profile: none, step, impulse (one sample long), ramp, sine, trapezoid or table.",
        changes=changes,
        choices=("none", *SIGNALS),
    )


@dataclass(frozen=True)
class _TimeProfile(ParameterGroup):
    kind: str = "none"
    amplitude: float = constant(0.0, "Amplitude of the profile.")
    start: float = constant(
        0.0, "Simulated time at which the profile starts.", "s", at_least=0.0, at_most=1e9
    )
    duration: float = constant(
        inf, "Duration of the profile; of a ramp, the time of its rise.", "s", at_least=0.0
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
        if self.kind not in SIGNALS:
            return NO_SIGNAL
        given = {**vars(self), "period": period}
        return SIGNALS[self.kind](**{name: given[name] for name in _NEEDS[self.kind]})

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        for name in self.known:
            need = "points" if name == "file" else name
            kinds = self.known["kind"].choices
            users = [kind for kind in kinds if need in _NEEDS.get(kind, ())]
            if name != "kind" and self.kind not in users:
                yield name, f"by the kind {self.kind}; kinds that use it: {', '.join(users)}"


@dataclass(frozen=True)
class SignalParameters(_TimeProfile):
    """Signal over the time since the first sample."""

    kind: str = _kind(Changes.AT_REST)
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
        if self.kind != "table":
            return replace(super().completed(prefix, curves), points=())
        if not self.file:
            raise ValueError(
                f"{prefix}file = '' is invalid: must be the path of a CSV file for a table"
            )
        return replace(self, points=read_curve(f"{prefix}file", self.file, _check_points, curves))

    @override
    def signal(self, period: float) -> Signal:
        return self._table if self.kind == "table" else super().signal(period)

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

    kind: str = _kind(Changes.LIVE)
    amplitude: float = constant(0.0, "Amplitude of the disturbance.", "N")


@dataclass(frozen=True)
class ReferenceParameters(_TimeProfile):
    """Reference that the controller follows."""

    kind: str = at_build(
        "none",
        "Source: none, the topic `reference`, or a time profile (step, ramp, sine, trapezoid).",
        choices=("none", "topic", *(kind for kind in SIGNALS if kind not in ("impulse", "table"))),
    )
    amplitude: float = constant(0.0, "Largest displacement of the profile.", "m")


def _check_points(points: Pairs) -> None:
    table(points)
