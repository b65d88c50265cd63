"""Requirements of the theory on a drive; a function refuses every other drive by name."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.control.base import seen_by
from stickslip_ros.model.drive import Drive

_Result = TypeVar("_Result")


class NotCoveredError(InvalidInputError):
    """A function of the theory does not cover a drive; the text names both."""


@dataclass(frozen=True)
class Requirement:
    """Property of a drive that some of the theory needs."""

    need: str
    """The need, for a sentence."""
    lack: Callable[[Drive], str | None]
    """Returns what a drive has instead, for a sentence; None if it has the property."""


def require(function: str, drive: Drive, *requirements: Requirement) -> None:
    """Raise NotCoveredError, which names the function, if a drive lacks one of the requirements."""
    for requirement in requirements:
        lack = requirement.lack(drive)
        if lack is not None:
            raise NotCoveredError(f"{function} needs {requirement.need}: {lack}")


def covered(function: Callable[[], _Result]) -> tuple[_Result | None, str | None]:
    """Return what a function returns, or else why it refuses the drive."""
    try:
        return function(), None
    except NotCoveredError as error:
        return None, str(error)


def require_equilibrium(
    function: str, drive: Drive, control: ContinuousControl | None, *requirements: Requirement
) -> None:
    """Raise NotCoveredError, which names the function, where a loop has no equilibrium.

    It needs a spring, constant belt speed and load, and a control that holds a motor at a position;
    a drive with an ideal motor needs no control. There may be further `requirements`.
    """
    require(function, drive, SPRING, AUTONOMOUS, *requirements)
    if drive.motor is None or (control is not None and _holds_position(control.scaled(drive))):
        return
    raise NotCoveredError(no_position_loop(function, "the control" if control else "no control"))


def no_position_loop(function: str, control: str) -> str:
    """Return a sentence that says why a drive with a motor has no equilibrium under a control."""
    return (
        f"{function} needs a law with a position loop, such as cascade: with {control} nothing "
        "holds the motor at a position, the guide drags it off, and there is no equilibrium"
    )


def _holds_position(control: ContinuousControl) -> bool:
    """Return whether control feels where slide and motor are together."""

    def response(position: float) -> list[float]:
        seen = seen_by(control, position, 0.0, (position, 0.0))
        states = [0.0] * len(control.states)
        rates = control.state_rates(*seen, states)
        return [float(output) for output in (control.control_force(*seen, states), *rates)]

    return response(0.0) != response(1.0)


def _signals(drive: Drive) -> str | None:
    moving = [f"its {name}" for name in ("belt", "load") if getattr(drive, name).pieces]
    return f"the drive has a signal of {' and '.join(moving)}" if moving else None


def _memory(drive: Drive) -> str | None:
    law = drive.friction
    states = ", ".join(law.states)
    return f"the friction law {law.name} has a memory ({states})" if states else None


def _no_second_derivative(drive: Drive) -> str | None:
    law = drive.friction
    return f"the friction law {law.name} has no second derivative there" if law.nonsmooth else None


def _asymmetry(drive: Drive) -> str | None:
    law = drive.friction
    forward, backward = law.limits
    speeds = np.geomspace(1e-3, 1e3, 13) * drive.speed_scale
    ahead = law.coefficient(speeds, np.ones(speeds.shape))
    back = law.coefficient(-speeds, -np.ones(speeds.shape))
    if forward == backward and np.array_equal(ahead, -back):
        return None
    return f"the friction law {law.name} differs between forward and backward slip"


def _motor(drive: Drive) -> str | None:
    return None if drive.motor is None else "the motor of the drive has a mass"


ONE_MASS = Requirement("an ideal motor", _motor)
"""The far end of the spring moves exactly at the feed, and the control force acts on the slide."""

SPRING = Requirement(
    "a spring", lambda drive: None if drive.has_spring else "the drive has stiffness = 0 N/m"
)
"""The stiffness is above zero: the drive has a natural frequency."""

AUTONOMOUS = Requirement("a constant belt speed and a constant normal force", _signals)
"""Belt speed and load are constant."""

STATIC = Requirement("a friction law without memory", _memory)
"""Friction depends on the relative speed only: without control the motion is planar."""

SMOOTH = Requirement("friction that is smooth in steady slip", _no_second_derivative)
"""Friction in steady slip has derivatives of the first three orders."""

SYMMETRIC = Requirement("friction that is the same in both directions", _asymmetry)
"""The coefficient is an odd function of the relative speed."""

ONE_DEGREE = (ONE_MASS, SPRING, AUTONOMOUS)
"""Only the slide moves, about one equilibrium."""

PLANAR = (*ONE_DEGREE, STATIC, SYMMETRIC)
"""Displacement and velocity determine the motion, and either direction is as good."""
