"""Courses: functions of time that a drive follows, such as those of its belt speed and its load."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True)
class Course(ABC):
    """Function of time, smooth in each of its modes.

    A course is a frozen dataclass of its constants, each described by `constant`; the unit of what
    it gives is called "value" there. Its equations accept floats, complex numbers and heyoka
    expressions. A course with corners has `switches`, values that are constant between two corners.
    A mode ends where one of `margins` falls to zero; `switches_after` then gives the next one.

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

    def margins(self, time: Any, switches: Sequence[Any]) -> Sequence[Any]:
        """Return what is above zero up to the next corner, and zero there.

        Parameters
        ----------
        time : float or expression
            Time from the start of the motion, s.
        switches : sequence of float or expression
            Values of `switches`.

        Returns
        -------
        sequence of float or expression
            Margins; as many in every mode, and a constant above zero where there is none.
        """
        return ()

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

    def switches_after(self, margin: int, switches: Sequence[float]) -> Sequence[float]:
        """Return the switches after the corner where a margin has fallen to zero.

        Parameters
        ----------
        margin : int
            Index of the margin.
        switches : sequence of float
            Values of `switches` so far.

        Returns
        -------
        sequence of float
            Values of `switches` from then on.
        """
        return switches


@dataclass(frozen=True)
class NoCourse(Course):
    """Zero at any time: what follows it is constant."""

    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        """Return 0; see `Course.value`.

        Parameters
        ----------
        time : float, complex or expression
            Time from the start of the motion, s.
        switches : sequence of float or expression
            Values of `switches`; none.

        Returns
        -------
        float
            0.
        """
        return 0.0


NO_COURSE = NoCourse()
"""The course of what is constant."""
