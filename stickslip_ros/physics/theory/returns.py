"""From one cycle to the next: where the belt lets the slide go, and how long it may be gone."""

from collections.abc import Iterator
from math import copysign

from stickslip_ros.physics.drive import Drive
from stickslip_ros.physics.knots import Knots
from stickslip_ros.physics.motion import Motion


def release_position(drive: Drive) -> float:
    """Return the displacement (m) at which the belt lets go of the slide, there being no control.

    There friction is at its limit and the slide not yet accelerated: k x + c v_belt = N mu_s.
    """
    limit = copysign(drive.normal_force * drive.friction.static, drive.belt_speed)
    return (limit - drive.damping * drive.belt_speed) / drive.stiffness


def longest_return(drive: Drive) -> float:
    """Return a time (s) in which a slide comes back, or never; the belt moves.

    It may ride the belt, and creep at a like speed, as far as static friction can bend the spring.
    """
    stretch = 2.0 * drive.friction.static * drive.length_scale
    return 4.0 * drive.natural_period + 2.0 * stretch / abs(drive.belt_speed)


def follow(motion: Motion) -> Iterator[Knots]:
    """Yield the knots of a recording `motion` from now on, each time further, until it is late."""
    drive = motion.drive
    knots, now = Knots.empty(), 0.0
    while now < longest_return(drive) and not motion.unbounded:
        step = max(now, drive.natural_period) / 4.0
        motion.advance(step)
        now += step
        knots = Knots.concatenate(knots, motion.take_knots())
        yield knots
