"""The slots of a drive: where each part has its states and its switches."""

from collections.abc import Iterable, Sequence
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import Drive

POSITION, SPEED, MEMORY = 0, 1, 2
"""Indices of X and Y in a state, and of the first state of the law's memory."""

SIGN = 0
"""Index of sgn(v_r) in the switches; 0 in stick."""


class DriveStates(NamedTuple):
    """The states of each part, in a state; X and Y come before them."""

    memory: slice
    """Those of the friction law."""
    control: slice
    actuator: slice
    motor: slice
    """Position and velocity of a motor of finite mass."""


class DriveSwitches(NamedTuple):
    """Of each part the values of its switches, or where they are in those of a drive."""

    law: Any
    belt: Any
    load: Any
    motor: Any
    """That of a motor with dry friction: sgn(X' - v_belt), 0 where it sticks."""


def states_of(
    drive: Drive, control: ContinuousControl | None
) -> tuple[tuple[str, ...], DriveStates]:
    """Return the names of the states of a drive under continuous control, and their slots."""
    parts = (
        [f"friction.{name}" for name in drive.friction.states],
        () if control is None else control.states,
        [f"actuator.{name}" for name in drive.actuator.states],
        () if drive.motor is None else ("motor.x", "motor.y"),
    )
    names = ("x", "y", *(name for part in parts for name in part))
    return names, DriveStates(*_slots(parts, MEMORY))


def switches_of(drive: Drive) -> tuple[tuple[str, ...], DriveSwitches]:
    """Return the names of the switches of a drive, and their slots."""
    motor = ("sign",) if drive.motor is not None and drive.motor.sticks else ()
    parts = DriveSwitches(drive.friction.switches, drive.belt.switches, drive.load.switches, motor)
    names = (f"{part}.{name}" for part, switches in parts._asdict().items() for name in switches)
    return ("sign", *names), DriveSwitches(*_slots(parts, SIGN + 1))


def _slots(parts: Iterable[Sequence[str]], first: int) -> Iterable[slice]:
    return (slice(*ends) for ends in pairwise(accumulate(map(len, parts), initial=first)))
