"""Theory of drives whose friction has a memory, against formulas and against the motion itself."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    Dahl,
    ElastoPlastic,
    Exponential,
    FrictionLaw,
    LuGre,
    MaxwellSlip,
)
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.theory.critical_gains import critical_gains, limit_cycle_from_hopf
from stickslip_ros.theory.hopf import hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycles
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.shooting import LimitCycle, shoot
from tests.drives import settled

CURVE = Exponential(static=0.4, kinetic=0.25, decay_speed=0.02)
FEED = Drive(100.0, 200.0, 1e6, 1000.0, 0.04, LuGre(CURVE, 1e5, 100.0))
"""The slide of a machine tool, with bristles of 4 um."""
MAXWELL_SLIP = replace(FEED, friction=MaxwellSlip(CURVE, 1e5, 3, 1000.0))
ELASTO_PLASTIC = replace(FEED, friction=ElastoPlastic(CURVE, 1e5, 100.0))
GAINS = Washout(20.0, linear_gain=-3000.0, cubic_gain=0.0)

LAWS = [FEED.friction, ELASTO_PLASTIC.friction, MAXWELL_SLIP.friction, Dahl(0.4, 1e5)]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_the_jacobian_is_the_derivative_of_the_motion(law: FrictionLaw) -> None:
    """A small deviation from the equilibrium moves as the matrix exponential says."""
    drive = replace(FEED, friction=law)
    expansion = expand(drive)
    rest, scales = expansion.equilibrium, drive.scales
    units = np.array(
        [
            drive.length_scale,
            drive.speed_scale,
            *(1.0 / scales.factor(u) for u in law.states.values()),
        ]
    )
    time, size = 2e-3, 1e-4
    values, vectors = np.linalg.eig(expansion.jacobian)
    grown = np.exp(values * time * drive.angular_frequency)
    expected = (vectors * grown @ np.linalg.inv(vectors)).real
    # An element that slips would stick if the test made it slower.
    for column in (0,) if isinstance(law, MaxwellSlip) else (0, 1):
        ends: list[np.ndarray] = []
        for sign in (1.0, -1.0):
            x, y, *memory = ((rest + sign * size * np.eye(len(rest))[column]) * units).tolist()
            motion = RecordedMotion(drive, x, y)
            motion.restart(x, y, memory)
            motion.advance(time)
            ends.append(np.array([motion.position, motion.velocity]) / units[:2])
        found = (ends[0] - ends[1]) / (2.0 * size)
        np.testing.assert_allclose(found, expected[:2, column], rtol=2e-4, atol=2e-4)


def test_stiff_bristles_have_the_hopf_speed_of_the_curve() -> None:
    (static,) = hopf_points(replace(FEED, friction=CURVE))
    *_, point = hopf_points(replace(FEED, friction=LuGre(CURVE, 1e8, sqrt(1e8 / 10.0))))
    assert point.belt_speed == pytest.approx(static.belt_speed, rel=1e-4)
    assert point.crossing_speed == pytest.approx(static.crossing_speed, rel=1e-3)
    assert point.first_lyapunov_coefficient == pytest.approx(
        static.first_lyapunov_coefficient, rel=1e-2
    )


@pytest.mark.parametrize("corner_frequency", [20.0, 1000.0])
@pytest.mark.parametrize("law", LAWS[:3], ids=lambda law: law.name)
def test_the_critical_gain_divides_stable_from_unstable(
    law: FrictionLaw, corner_frequency: float
) -> None:
    drive, gains = replace(FEED, friction=law), replace(GAINS, corner_frequency=corner_frequency)
    found = critical_gains(drive, gains)
    for ratio, stable in ((1.0 + 1e-7, True), (1.0 - 1e-7, False)):
        expansion = expand(drive, replace(gains, linear_gain=ratio * found.linear))
        assert bool(np.all(expansion.eigenvalues.real < 0.0)) is stable


@pytest.mark.parametrize(
    "drive",
    [
        FEED,
        *(pytest.param(each, marks=pytest.mark.long) for each in (ELASTO_PLASTIC, MAXWELL_SLIP)),
    ],
    ids=lambda drive: drive.friction.name,
)
def test_the_stable_cycle_is_that_of_a_long_run(drive: Drive) -> None:
    cycles = [cycle for cycle in limit_cycles(drive) if cycle.stable]
    assert len(cycles) == 1
    run = settled(RecordedMotion(drive, 0.0, 0.0), 50.0, 50.0, window=10)
    measures = cycles[0].measures
    found = measures.amplitude, measures.period
    assert found == pytest.approx((run.amplitude, run.period), rel=1e-9)
    assert measures.stick_fraction == pytest.approx(run.stick_fraction, rel=1e-6)


def by_differences(drive: Drive, cycle: LimitCycle) -> float:
    """The derivative of the next turning point by this one: the dominant multiplier."""
    ends: list[float] = []
    size = 1e-5 * cycle.measures.amplitude
    for sign in (1.0, -1.0):
        motion = RecordedMotion(drive, cycle.position + sign * size, 0.0)
        motion.restart(cycle.position + sign * size, 0.0, cycle.memory)
        motion.take_breakpoints()
        motion.advance(1.4 * cycle.period)
        points = motion.take_breakpoints()
        turns = np.flatnonzero((points.velocity == 0.0) & (points.time > 0.7 * cycle.period))
        rising = points.position[turns][points.velocity[np.minimum(turns + 1, len(points) - 1)] > 0]
        ends.append(float(rising[0]))
    return (ends[0] - ends[1]) / (2.0 * size)


def test_the_multiplier_of_an_unstable_cycle() -> None:
    """The vibration starts subcritically: just above the Hopf speed there are two cycles."""
    *_, point = hopf_points(FEED)
    drive = replace(FEED, belt_speed=1.02 * point.belt_speed)
    unstable, stable = limit_cycles(drive)
    assert stable.stable
    assert not unstable.stable
    assert abs(unstable.multipliers[0]) > 1.0
    assert by_differences(drive, unstable) == pytest.approx(unstable.multipliers[0].real, rel=1e-3)


def test_a_cycle_from_the_hopf_point_of_the_gain() -> None:
    critical = critical_gains(FEED, GAINS)
    assert critical.first_lyapunov_coefficient > 0.0
    gains = replace(GAINS, linear_gain=1.01 * critical.linear)
    cycle = limit_cycle_from_hopf(FEED, gains)
    assert not cycle.stable
    again = shoot(
        FEED,
        cycle.position,
        cycle.period,
        control=gains,
        filter_state=cycle.filter_states,
        memory=cycle.memory,
    )
    assert again.position == pytest.approx(cycle.position, rel=1e-9)
    assert len(cycle.multipliers) == 3
