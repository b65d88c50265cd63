"""Courses: functions of time that a drive follows, such as those of its belt speed and its load."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Any, ClassVar, Self

import numpy as np
from typing_extensions import override


@dataclass(frozen=True)
class Course(ABC):
    """Function of time, smooth in each of its modes.

    A course is a frozen dataclass of its constants, each described by `constant`; the unit of what
    it gives is called "value" there. Its equations accept floats, complex numbers and heyoka
    expressions. A course with corners has `switches`, values that are constant between two corners,
    and says in `next_switch_time` when the next one comes.

    Examples
    --------
    A load that swings:

    >>> from dataclasses import dataclass
    >>> from math import pi
    >>> from stickslip_ros.physics.model.constants import constant
    >>> from stickslip_ros.physics.model.course import Course
    >>> from stickslip_ros.physics.model.functions import sin
    >>> @dataclass(frozen=True)
    ... class Swing(Course):
    ...     amplitude: float = constant(0.0, "Amplitude.", "value")
    ...     frequency: float = constant(1.0, "Frequency.", "Hz")
    ...
    ...     def value(self, time, switches):
    ...         return self.amplitude * sin(2.0 * pi * self.frequency * time)
    >>> round(float(Swing(amplitude=2.0, frequency=0.5).value(0.5, ())), 3)
    2.0
    """

    switches: ClassVar[Sequence[str]] = ()
    """Names of the values that are constant between two corners."""

    @property
    def equations(self) -> "Course":
        """Course that has the same `value`, from the switches alone if possible.

        Courses with the same equations share their compiled flows. By default it is the course.
        """
        return self

    @cached_property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value at any time; infinite by default, where they are not known."""
        return -inf, inf

    @cached_property
    def steepest(self) -> float:
        """Largest absolute derivative by time; infinite by default, where it is not known."""
        return inf

    def refusal(self) -> str | None:
        """Return why constants do not fit together, or None.

        Returns
        -------
        str or None
            Start of a sentence, "name = value: must be ..."; None if nothing is wrong.
        """
        return None

    def sampled(self, period: float) -> Self:
        """Return the course for a sample period.

        Parameters
        ----------
        period : float
            Sample period, s.

        Returns
        -------
        Course
            The course itself, unless it counts in samples.
        """
        return self

    def at(self, time: float) -> float:
        """Return the value at a time.

        Parameters
        ----------
        time : float
            Time from the start of the motion, s.

        Returns
        -------
        float
            Value; at a corner that after it.
        """
        return float(self.value(time, self.switches_at(time)))

    def integral(self, start: float, end: float) -> float:
        """Return the integral over an interval.

        By default a quadrature that is exact to rounding where the course is smooth over it.

        Parameters
        ----------
        start : float
            Start of the interval, s.
        end : float
            End of the interval, s; not before its start.

        Returns
        -------
        float
            Integral, in the unit of the value times s.
        """
        nodes, weights = np.polynomial.legendre.leggauss(20)
        half = 0.5 * (end - start)
        values = [self.at(time) for time in (start + half * (1.0 + nodes)).tolist()]
        return half * float(np.dot(weights, values))

    @abstractmethod
    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        """Return the value at a time.

        Parameters
        ----------
        time : float, complex or expression
            Time from the start of the motion, s.
        switches : sequence of float or expression
            Values of `switches`.

        Returns
        -------
        float, complex or expression
            Value, in the unit of what follows the course.
        """

    def switches_at(self, time: float) -> Sequence[float]:
        """Return the switches of the mode that starts at a time, or in which it lies.

        Parameters
        ----------
        time : float
            Time from the start of the motion, s.

        Returns
        -------
        sequence of float
            Values of `switches`.
        """
        return ()

    def next_switch_time(self, switches: Sequence[float]) -> float:
        """Return the time of the next corner, where `switches_at` gives the next mode.

        Parameters
        ----------
        switches : sequence of float
            Values of `switches`.

        Returns
        -------
        float
            Time from the start of the motion, s; infinite if no corner follows.
        """
        return inf


@dataclass(frozen=True)
class NoCourse(Course):
    """Zero at any time: what follows it is constant."""

    @override
    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        return 0.0

    @cached_property
    @override
    def bounds(self) -> tuple[float, float]:
        return 0.0, 0.0

    @cached_property
    @override
    def steepest(self) -> float:
        return 0.0

    @override
    def integral(self, start: float, end: float) -> float:
        return 0.0


NO_COURSE = NoCourse()
"""The course of what is constant."""
