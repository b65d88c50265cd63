"""The LuGre law with the constants of its paper, table I (IEEE TAC 40(3), 1995)."""

from math import sqrt

import numpy as np
import pytest

from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Exponential, LuGre
from stickslip_ros.physics.motion import Motion, RecordedMotion
from tests.physics.motion.memory_reference import Law, MemoryDrive
from tests.physics.parts import Pid

LAW = LuGre(Exponential(1.5, 1.0, 1e-3, 0.4, 2.0), 1e5, sqrt(1e5))
FREE = Drive(1.0, 0.0, 0.0, 1.0, 0.0, LAW)
PID = Pid(3.0, 4.0, 6.0)


def test_it_is_not_passive() -> None:
    """It would need a viscous coefficient above D (1.5/1.0 - 1) = 158."""
    assert LAW.passivity_margin == pytest.approx(0.4 - 158.1, abs=0.02)
    assert "viscous = 0.4 s/m is 157.7 s/m below" in (LAW.warning() or "")
    assert LuGre(LAW.curve, 1e5, 0.7).warning() is None


def periods(times: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Times between upward crossings of the reference."""
    upward = np.flatnonzero((positions[1:] > 1.0) & (positions[:-1] <= 1.0))
    share = (1.0 - positions[upward]) / (positions[upward + 1] - positions[upward])
    return np.diff(times[upward] + share * (times[upward + 1] - times[upward]))


def test_a_pid_controller_hunts_and_sampling_hardly_changes_its_period() -> None:
    times = np.arange(0.0, 130.0, 0.01)
    continuous = RecordedMotion(FREE, 0.0, 0.0, PID)
    exact = [0.0]
    for _ in times[1:]:
        continuous.advance(0.01)
        exact.append(continuous.position)
    sampled, integral, found = Motion(FREE, 0.0, 0.0), 0.0, [0.0]
    for _ in times[1:]:
        for _ in range(10):  # 1 kHz
            error = sampled.position - 1.0
            integral += 1e-3 * error
            sampled.force = -(3.0 * error + 4.0 * integral + 6.0 * sampled.velocity)
            sampled.advance(1e-3)
        found.append(sampled.position)
    hunting, own = periods(times, np.array(exact)), periods(times, np.array(found))
    assert hunting[-1] == pytest.approx(hunting[-2], rel=1e-3)  # a limit cycle
    assert own[-1] == pytest.approx(hunting[-1], rel=0.01)
    assert np.ptp(exact[-3000:]) > 0.1


@pytest.mark.long
def test_its_stick_slip_under_a_spring_is_that_of_scipy() -> None:
    drive = Drive(1.0, 0.0, 2.0, 1.0, 0.1, LAW)
    times = np.linspace(0.0, 14.0, 8)
    curve = LAW.curve
    size = Law(lambda w: float(curve.dry.coefficient(-abs(w), -1.0)), 1e5, sqrt(1e5), 0.4)
    expected = MemoryDrive(1.0, 0.0, 2.0, 1.0, 0.1, size, size).run(0.0, 0.0, times)
    motion, found = RecordedMotion(drive, 0.0, 0.0), [(0.0, 0.0)]
    for duration in np.diff(times):
        motion.advance(float(duration))
        found.append((motion.position, motion.velocity))
    difference = np.abs(np.array(found) - expected) / np.ptp(expected, axis=0)
    assert difference.max() < 1e-8
