"""A motion that would take too long is refused after bounded work."""

from dataclasses import replace

import pytest

from stickslip_ros.errors import RunError
from stickslip_ros.motion import Motion
from tests.drives import PAPER

STIFF = replace(PAPER, damping=1e9)


@pytest.fixture(autouse=True)
def _little_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stickslip_ros.motion.hybrid_motion._SPARE_STEPS", 1000)


def test_it_is_refused_and_with_another_drive_goes_on_where_it_was() -> None:
    motion = Motion(PAPER, 0.3, 0.1)
    motion.drive = STIFF
    with pytest.raises(RunError, match="too stiff"):
        motion.advance(0.1)
    assert not motion.unbounded
    position, velocity = motion.position, motion.velocity
    motion.drive = PAPER
    assert motion.position == position
    assert motion.velocity == pytest.approx(velocity, rel=1e-12)
    motion.advance(1.0)
    fresh = Motion(PAPER, position, velocity)
    fresh.advance(1.0)
    assert motion.position == pytest.approx(fresh.position, rel=1e-9)


def test_a_long_motion_that_is_not_stiff_is_followed_to_its_end() -> None:
    motion = Motion(PAPER, 0.0, 0.0)
    motion.advance(20_000.0)
    assert not motion.unbounded


def test_a_stick_however_long_is_followed_to_its_end() -> None:
    motion = Motion(replace(PAPER, belt_speed=1e-20), 0.0, 1e-20)
    motion.advance(1e19)
    assert motion.sticking
    assert motion.position == pytest.approx(0.1)
