"""The LuGre law with the constants of its paper, table I (IEEE TAC 40(3), 1995)."""

from math import sqrt

import numpy as np
import pytest

from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Exponential, LuGre
from stickslip_ros.motion import RecordedMotion
from tests.motion.memory_reference import Law, MemoryDrive

LAW = LuGre(Exponential(1.5, 1.0, 1e-3, 0.4, 2.0), 1e5, sqrt(1e5))


def test_it_is_not_passive() -> None:
    """It would need a viscous coefficient above D (1.5/1.0 - 1) = 158."""
    assert LAW.passivity_margin == pytest.approx(0.4 - 158.1, abs=0.02)
    assert "viscous = 0.4 s/m is 157.7 s/m below" in (LAW.warning() or "")
    assert LuGre(LAW.curve, 1e5, 0.7).warning() is None


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
