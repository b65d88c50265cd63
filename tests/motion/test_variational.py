"""Derivatives of a motion by its start and by constants, through stick and slip.

The references are differences of the motion itself, which is exact to about 1e-13.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive, in_units_of
from stickslip_ros.model.friction import (
    Coulomb,
    Dahl,
    Directional,
    Exponential,
    FrictionLaw,
    Linear,
    LuGre,
    MaxwellSlip,
    Stribeck,
    Table,
)
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.model.signals import table
from stickslip_ros.motion import Motion
from stickslip_ros.motion.variational import ShootingMotion, VariationalMotion
from tests.drives import PAPER

CURVE = Exponential(static=0.4, kinetic=0.25, decay_speed=0.02, viscous=0.5)
LAWS: dict[str, FrictionLaw] = {
    "stribeck": Stribeck(static=0.4, minimum=0.25, minimum_speed=0.05),
    "coulomb": Coulomb(static=0.3, viscous=0.8),
    "exponential": CURVE,
    "directional": Directional(Coulomb(static=0.3, viscous=0.8), Coulomb(static=0.2, viscous=0.5)),
    "dahl": Dahl(static=0.3, bristle_stiffness=1e4),
    "lugre": LuGre(CURVE, bristle_stiffness=2e4, bristle_damping=1.0),
    "maxwell_slip": MaxwellSlip(CURVE, bristle_stiffness=2e4, elements=2),
}
START = (1e-4, -0.01)
PERIOD = 1e-3
FORCES = np.repeat(60.0 * np.random.default_rng(0).normal(size=30), 10).tolist()
BELT = table([(0.0, 0.02), (0.1, 0.02), (0.2, -0.03), (0.3, 0.06)])


def drive_of(law: str, *, moves: bool) -> Drive:
    """Return a drive that sticks and slips, on a belt of constant speed or one that reverses."""
    drive = Drive(100.0, 100.0, 1e6, 1000.0, 0.02, LAWS[law], bias_force=3.0)
    return replace(drive, belt_speed=0.0, belt=BELT) if moves else drive


def positions(drive: Drive, start: tuple[float, float] = START) -> FloatArray:
    """Return the positions of the slide after each period."""
    return followed(Motion(drive, *start), lambda motion: motion.position)


def followed(motion: Any, read: Callable[[Any], Any]) -> FloatArray:
    """Return what is read of a motion after each period."""
    found: list[Any] = []
    for force in FORCES:
        motion.force = force
        motion.advance(PERIOD)
        found.append(read(motion))
    return np.array(found)


@pytest.mark.parametrize(
    ("law", "moves"),
    [
        pytest.param(law, i % 2 == 0, marks=[pytest.mark.long] * (law != "coulomb"))
        for i, law in enumerate(LAWS)
    ],
)
def test_derivatives_are_those_of_differences(law: str, moves: bool) -> None:
    drive = drive_of(law, moves=moves)
    scaled = in_units_of(drive, drive)
    motion, system = VariationalMotion(scaled, *START), drive_system(scaled)
    rows = followed(motion, lambda own: own.derivatives[0].copy())
    order, names = len(system.states), system.free_constants
    for number, name in enumerate(names):
        size = 1e-6 * max(abs(system.constants[name]), 1e-3)
        found = (positions(moved(drive, name, size)) - positions(moved(drive, name, -size))) / (
            2.0 * size * drive.length_scale
        )
        own = rows[:, order + number]
        assert np.abs(own - found).max() <= 1e-5 * np.abs(own).max(), name
    step = 1e-9
    for axis, scale in enumerate((drive.length_scale, drive.speed_scale)):
        above, below = list(START), list(START)
        above[axis] += step
        below[axis] -= step
        found = positions(drive, (above[0], above[1])) - positions(drive, (below[0], below[1]))
        found *= scale / drive.length_scale / (2.0 * step)
        assert np.abs(rows[:, axis] - found).max() < 1e-4 * np.abs(rows[:, axis]).max()


def moved(drive: Drive, name: str, change: float) -> Drive:
    """Return the drive with a constant that is changed by some of its units."""
    units = {
        "mass": drive.mass,
        "stiffness": drive.stiffness,
        "damping": drive.normal_force / drive.speed_scale,
        "bias_force": drive.normal_force,
    }
    if name in units:
        return replace(drive, **{name: getattr(drive, name) + change * units[name]})
    return replace(drive, friction=moved_law(drive, drive.friction, name.split(".")[1:], change))


def moved_law(drive: Drive, law: Any, path: list[str], change: float) -> Any:
    """Return a law with a constant that is changed by some of its units."""
    if len(path) > 1:
        return replace(law, **{path[0]: moved_law(drive, getattr(law, path[0]), path[1:], change)})
    scaled = replace(law, **{path[0]: 1.0}).scaled(drive.speed_scale, drive.length_scale)
    unit = 1.0 / getattr(scaled, path[0])
    return replace(law, **{path[0]: getattr(law, path[0]) + change * unit})


def test_a_bias_of_zero_needs_no_equations_of_its_own() -> None:
    """Fits begin without one, and ask for derivatives by it all the same."""
    none, some = (replace(PAPER, bias_force=force) for force in (0.0, 5.0))
    systems = [drive_system(in_units_of(PAPER, drive)) for drive in (none, some)]
    assert len({system.structure for system in systems}) == 1
    assert [system.constants["bias_force"] != 0.0 for system in systems] == [False, True]
    assert len({drive_system(drive).structure for drive in (none, some)}) == 2


def test_the_motion_is_that_without_derivatives() -> None:
    drive = drive_of("lugre", moves=True)
    motion = VariationalMotion(in_units_of(drive, drive), *START)
    own = followed(motion, lambda motion: motion.position)
    assert np.abs(own - positions(drive)).max() < 1e-12 * np.ptp(own)


SLOW = replace(PAPER, belt_speed=0.3)
STARTED = [
    PAPER,
    replace(PAPER, friction=Exponential(0.4, 0.25, 0.05, 0.0)),
    # It overtakes the belt.
    replace(PAPER, belt_speed=0.2, damping=0.2, friction=Linear(0.4, 0.45)),
    *(
        replace(SLOW, friction=law)
        for law in (
            Directional(Coulomb(0.3), Coulomb(0.6)),
            Table(((0.0, 0.4), (0.5, 0.28))),
            Dahl(0.4, 20.0),
            MaxwellSlip(Coulomb(0.4), 5.0, elements=1, attraction=5.0),
        )
    ),
]


@pytest.mark.parametrize("drive", STARTED, ids=lambda drive: drive.friction.name)
@pytest.mark.parametrize(
    "gains",
    [None, pytest.param(Washout(0.7, -0.3, -0.2), marks=pytest.mark.long)],
    ids=["open", "controlled"],
)
def test_derivatives_by_the_start_alone(drive: Drive, gains: Washout | None) -> None:
    motion = ShootingMotion(drive, gains)
    # Fast enough to overtake the belt, and to stick in the end.
    own = [0.001] * len(drive.friction.states)
    start = np.array([0.1, -1.3, *own, 0.2])[: len(motion.state)]
    landings, step = 0, 1e-6

    def end(state: FloatArray, duration: float) -> FloatArray:
        motion.start(state)
        motion.advance(duration)
        return motion.state

    for duration in np.arange(0.7, 21.0 if not own else 3.0, 1.4):
        steps = step * np.eye(len(start))
        found = [end(start + each, duration) - end(start - each, duration) for each in steps]
        end(start, duration)
        landings += motion.sticking
        assert motion.shot.matrix == pytest.approx(
            np.transpose(found) / (2.0 * step), rel=1e-5 if own else 0.0, abs=1e-7 if own else 3e-8
        )
    assert landings > 0 or own
