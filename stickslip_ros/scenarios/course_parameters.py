"""The parameters of the courses of a run: belt, load, disturbance and reference."""

from collections.abc import Collection, Iterator
from math import inf
from typing import Any, ClassVar, Self

from pydantic import PrivateAttr, ValidationInfo, model_validator
from typing_extensions import override

from stickslip_ros.physics.loop.reference import ReferenceCourse, ReferenceKind
from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.course import NO_COURSE, Course
from stickslip_ros.physics.model.courses import COURSES, CourseKind, Table
from stickslip_ros.physics.model.disturbance import NO_TABLE
from stickslip_ros.scenarios.curve_file import Pairs, read_curve
from stickslip_ros.scenarios.parameter_field import SMALLEST, Fixed, field
from stickslip_ros.scenarios.validation import ParameterGroup

_USED: dict[str, Collection[str]] = {
    **{kind: constants_of(course) for kind, course in COURSES.items()},
    CourseKind.IMPULSE: ("amplitude", "start"),
    CourseKind.TABLE: ("file",),
}
"""The parameters that each kind of course uses."""


class _AnyCourse(ParameterGroup):
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

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        kinds: Any = type(self.kind)
        for name in type(self).model_fields:
            users = [kind for kind in kinds if name in _USED.get(kind, ())]
            if name != "kind" and self.kind not in users:
                yield name, f"by the kind {self.kind}; kinds that use it: {', '.join(users)}"


class CourseParameters(_AnyCourse):
    """Course over the time since the first sample."""

    part: ClassVar[str]
    """Name of the group in the parameters."""

    kind: CourseKind = field(
        CourseKind.NONE,
        "Time course: none, step, impulse (one sample long), ramp, sine, trapezoid or table.",
        choices=CourseKind,
        strict=False,
        fixed=Fixed.ACTIVE,
    )
    file: str = field(
        "",
        "CSV file of the table: time (s) and value on each line, with straight lines between.",
        fixed=Fixed.RUNNING,
        file=True,
    )

    _table: Table = PrivateAttr(default_factory=lambda: NO_TABLE)

    @model_validator(mode="after")
    def _course_is_possible(self, info: ValidationInfo) -> Self:
        """Refuse constants that do not make a course, under their names as parameters."""
        if self.kind is CourseKind.TABLE:
            if not self.file:
                raise ValueError(
                    f"{self.part}.file = '' is refused: must be the path of a CSV file for a table"
                )
            points = read_curve(f"{self.part}.file", self.file, _refusal, info.context)
            self._curves[self.file], self._table = points, _as_table(points)
            return self
        refusal = self.as_course(1.0).refusal()
        if refusal is not None:
            raise ValueError(f"{self.part}.{refusal}")
        return self

    def as_course(self, period: float) -> Course:
        """Return the course in SI units; `period` is the sample period, s."""
        if self.kind is CourseKind.NONE:
            return NO_COURSE
        if self.kind is CourseKind.TABLE:
            return self._table
        course = COURSES[self.kind]
        values = {name: getattr(self, name) for name in constants_of(course)}
        return course(**values).sampled(period)

    @property
    def table(self) -> Table:
        """The points of the file; none for another kind of course."""
        return self._table


class LoadParameters(CourseParameters):
    """Course that is added to the normal force."""

    part: ClassVar[str] = "load"
    amplitude: float = field(0.0, "Amplitude of the change of the normal force.", "N")


class BeltParameters(CourseParameters):
    """Course that is added to the belt speed."""

    part: ClassVar[str] = "belt"
    amplitude: float = field(0.0, "Amplitude of the change of the belt speed.", "m/s")


class DisturbanceParameters(CourseParameters):
    """Disturbance force on the slide that is part of the scenario."""

    part: ClassVar[str] = "disturbance"
    kind: CourseKind = field(
        CourseKind.NONE,
        "Time course: none, step, impulse (one sample long), ramp, sine, trapezoid or table.",
        choices=CourseKind,
        strict=False,
    )
    amplitude: float = field(0.0, "Amplitude of the disturbance.", "N")


class ReferenceParameters(_AnyCourse):
    """Reference that the controller follows."""

    kind: ReferenceKind = field(
        ReferenceKind.NONE,
        "Source: none, the topic `reference`, or a time course (step, ramp, sine, trapezoid).",
        choices=ReferenceKind,
        strict=False,
        fixed=Fixed.CONFIGURED,
    )
    amplitude: float = field(0.0, "Largest displacement of the course.", "m")

    @model_validator(mode="after")
    def _course_is_possible(self) -> Self:
        """Refuse constants that do not make a course, under their names as parameters."""
        refusal = ReferenceCourse(**dict(self)).refusal()
        if refusal is not None:
            raise ValueError(f"reference.{refusal}")
        return self


def _as_table(points: Pairs) -> Table:
    times, values = zip(*points, strict=True)
    return Table(times, values)


def _refusal(points: Pairs) -> str | None:
    return _as_table(points).refusal()
