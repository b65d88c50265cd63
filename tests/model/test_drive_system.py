"""The modes of a drive at an instant."""

from array import array
from dataclasses import replace

import pytest

from stickslip_ros.model.drive_layout import SIGN, SPEED
from stickslip_ros.model.hybrid import Instant
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.model.signals import sine
from tests.drives import PAPER


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_slide_that_has_passed_a_moving_belt_slips_the_other_way(sign: float) -> None:
    belt = sine(0.5 * PAPER.belt_speed, frequency=0.1 / PAPER.natural_period)
    system = drive_system(replace(PAPER, belt=belt))
    instant = Instant(memoryview(array("d", [0.0, 0.0])), [0.0], time=3.0)
    belt_speed = system.belt_speed(system.starting_mode(instant), instant.time)
    instant.state[SPEED] = belt_speed + 1e-3 * sign
    mode = system.starting_mode(instant)
    assert mode.switches[SIGN] == sign
    assert system.settled(mode, instant) is mode
    instant.state[SPEED] = belt_speed - 1e-3 * sign
    assert system.settled(mode, instant).switches[SIGN] == -sign
