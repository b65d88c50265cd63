"""Motions that a run settles on: against reference cycles, and independent of earlier motions."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime, Trend
from stickslip_ros.model.control import Washout
from stickslip_ros.model.friction import Coulomb, Exponential, Linear, LuGre
from stickslip_ros.studies import settling
from stickslip_ros.studies.settling import (
    LONGEST,
    ControlledDrive,
    MotionState,
    Settled,
    SettlingOptions,
)
from stickslip_ros.studies.simulate import simulate
from tests.drives import FEED_DRIVE, LIMIT_CYCLES, PAPER
from tests.studies.studies import EXPONENTIAL, free, paper

REST = MotionState(0.0, 0.0)

WEAK = ("washout_controller.linear_gain=-0.05", "washout_controller.cubic_gain=0.0")
"""A controller under which the paper's drive still vibrates."""


def settle(
    case: ControlledDrive, start: MotionState = REST, options: SettlingOptions | None = None
) -> Settled:
    return settling.settle(case, start, options or SettlingOptions(cycles=6))


def test_a_start_after_that_no_study_waits_for_is_refused() -> None:
    waiting = paper(f"washout_controller.start_after={10 * LONGEST}")
    with pytest.raises(InvalidInputError, match=r"start_after = .* s: in a study it must be at"):
        ControlledDrive.from_scenario(waiting)


def test_a_motion_begins_with_the_memory_that_another_one_ended_with() -> None:
    """On a belt at rest bent bristles hold the spring: without them the slide would move."""
    law = LuGre(Exponential(0.4, 0.25, 0.1), bristle_stiffness=100.0, bristle_damping=5.0)
    case = ControlledDrive(replace(PAPER, belt_speed=0.0, friction=law))
    bent = MotionState(-0.2, 0.0, None, (0.002,))
    end = settle(case, bent).end
    assert end.position == pytest.approx(bent.position, rel=1e-9)
    assert end.memory == pytest.approx(bent.memory, rel=1e-9)
    assert settle(case, replace(bent, memory=None)).end.position > -0.199
    # Of another law the memory does not count.
    other = replace(case, drive=replace(case.drive, friction=Coulomb(0.4)))
    assert settle(other, bent).end.memory == ()
    assert MotionState.from_json([-0.2, 0.0, None, [0.002]]) == bent
    assert MotionState.from_json([-0.2, 0.0, [0.1]]) == MotionState(-0.2, 0.0, (0.1,))


def _case(*overrides: str, continuous: bool = False, **drive: Any) -> ControlledDrive:
    case = ControlledDrive.from_scenario(
        paper("plant.rate=20.0", *overrides), continuous=continuous
    )
    return replace(case, drive=replace(case.drive, **drive))


@pytest.mark.parametrize(
    ("overrides", "continuous"),
    [
        ((), False),
        ((*WEAK, "plant.force_delay=0.123"), False),
        (("washout_controller.force_limit=0.05", "plant.rate=50.0"), False),
        ((*WEAK, "washout_controller.start_after=20.0", "plant.belt_speed=-0.3"), False),
        (WEAK, True),
    ],
    ids=["rest", "delayed", "limited", "late", "continuous"],
)
def test_a_loop_settles_on_what_simulate_measures(
    overrides: tuple[str, ...], continuous: bool
) -> None:
    scenario = paper("plant.belt_speed=0.3", "plant.rate=25", "analyzer.window=6", *overrides)
    case = ControlledDrive.from_scenario(scenario, continuous=continuous)
    transient = 100.0 if continuous else 20.0
    settled = settle(case, options=SettlingOptions(transient, 6)).measures
    duration = (transient + 7.0) * scenario.plant.as_drive().natural_period
    duration += scenario.washout_controller.start_after
    measures = simulate(scenario, duration, continuous=continuous)
    assert settled.regime is measures.regime
    near = 1e-9 if continuous else 1e-4
    assert settled.midpoint == pytest.approx(measures.midpoint, abs=near)
    assert settled.amplitude == pytest.approx(measures.amplitude, abs=near)
    assert settled.stick_fraction == pytest.approx(measures.stick_fraction, abs=20.0 * near)
    assert settled.period == pytest.approx(measures.period, rel=near)


@pytest.mark.parametrize("continuous", [False, True], ids=["sampled", "continuous"])
def test_the_filter_is_carried_on(continuous: bool) -> None:
    # Neither steady nor at rest after the first half.
    case = _case(
        "washout_controller.corner_frequency=0.05",
        "washout_controller.linear_gain=-0.02",
        "washout_controller.cubic_gain=0.0",
        "plant.belt_speed=0.3",
        continuous=continuous,
    )
    start, short = MotionState(0.1, 0.05), SettlingOptions(3.0, 1, extensions=0)
    once, half = settle(case, start, replace(short, patience=2)), settle(case, start, short).end
    halves, rested = (settle(case, each, short) for each in (half, replace(half, control=None)))
    # What the force was at the last sample is forgotten, and a sample is a small part of d.
    exact = 1e-9 if continuous else 1e-3
    assert halves.end.position == pytest.approx(once.end.position, abs=exact)
    assert halves.end.velocity == pytest.approx(once.end.velocity, abs=exact)
    assert halves.end.control == pytest.approx(once.end.control, abs=exact)
    assert rested.end.control != pytest.approx(once.end.control, abs=10 * exact)


def test_on_a_belt_at_rest_the_slide_sticks_where_friction_holds_it() -> None:
    settled = settle(ControlledDrive(replace(PAPER, belt_speed=0.0)), MotionState(0.3, 0.0))
    assert settled.measures.regime is Regime.STUCK
    assert settled.measures.midpoint == 0.3
    assert settled.steady
    moved = settle(ControlledDrive(replace(PAPER, belt_speed=0.0)), MotionState(3.0, 0.0))
    assert moved.measures.regime is Regime.STUCK
    assert abs(moved.end.position) < 0.4


def test_the_turning_points_of_a_limit_cycle_and_of_an_equilibrium() -> None:
    cycle = next(cycle for cycle in LIMIT_CYCLES if cycle.belt_speed == 0.4)
    for drive, length in ((PAPER, 1.0), (FEED_DRIVE, 1e-3)):
        found = settle(ControlledDrive(drive)).turning_points / length
        assert len(found) >= 10
        assert np.abs(found - cycle.midpoint) == pytest.approx(cycle.amplitude, abs=1e-8)
        assert np.diff(np.sign(np.diff(found))).all()
    rest = settle(ControlledDrive(replace(PAPER, belt_speed=0.6))).turning_points
    assert rest == pytest.approx([0.4 - 0.45 * 0.6 + 0.6 * 0.6**3])


def test_a_motion_may_run_away_after_the_transient() -> None:
    drive = replace(PAPER, belt_speed=0.2, friction=Linear(0.4, 0.9))
    settled = settle(ControlledDrive(drive), options=SettlingOptions(1.0, 10))
    assert settled.measures.regime is Regime.UNBOUNDED
    assert len(settled.turning_points) == 0


def test_however_slow_the_belt_is_its_cycles_are_waited_for() -> None:
    for belt_speed, cycles in ((1e-3, 6), (-1e-3, 6), (3e-4, 6), (2e-4, 4), (1e-6, 4), (1e-12, 4)):
        settled = settle(ControlledDrive(replace(PAPER, belt_speed=belt_speed)))
        assert settled.measures.regime is Regime.STICK_SLIP
        assert settled.measures.cycles >= cycles
        assert settled.steady or cycles < 6


def test_a_slide_that_only_rode_the_belt_is_not_in_equilibrium() -> None:
    washout = Washout(corner_frequency=2.0, linear_gain=0.0, cubic_gain=0.0)
    settled = settle(ControlledDrive(replace(PAPER, belt_speed=1e-6), washout))
    assert settled.measures.regime is None
    assert not settled.steady


NEAR_HOPF = ((0.48623, 0.09960403562), (0.48667, 0.09052509850))
"""Belt speeds, and amplitudes of the stable limit cycles there, as shooting and runs of 20,000 s
give them."""


@pytest.mark.parametrize(("belt_speed", "amplitude"), NEAR_HOPF)
def test_near_a_hopf_point_a_motion_is_steady_when_its_amplitude_will_not_change(
    belt_speed: float, amplitude: float
) -> None:
    """It decays by 0.1 % in 24 cycles there, and by 0.15 % or 0.41 % after 200 periods."""
    case = ControlledDrive(replace(PAPER, belt_speed=belt_speed))
    short = settle(case, options=SettlingOptions(extensions=0)).measures
    assert (short.steady, short.trend) == (False, Trend.DECAYING)
    settled = settle(case, options=SettlingOptions())
    assert settled.steady
    assert settled.measures.amplitude == pytest.approx(amplitude, rel=2e-4)
    run = simulate(free(f"plant.belt_speed={belt_speed}", "plant.rate=1"), 1256.0)
    assert (run.steady, run.trend) == (False, Trend.DECAYING)


def test_a_vibration_that_takes_too_long_to_decay_is_not_steady() -> None:
    """Its amplitude changes from cycle to cycle by less than its encoder tells."""
    coarse = "plant.sensor.position_resolution=0.003"
    case = ControlledDrive.from_scenario(free("plant.belt_speed=0.4889", coarse))
    measures = settle(case, options=SettlingOptions()).measures
    assert (measures.steady, measures.trend) == (False, Trend.DECAYING)


def test_a_vibration_that_grows_out_of_rest_is_not_steady() -> None:
    drive = replace(PAPER, belt_speed=0.485)
    small = MotionState(drive.equilibrium_position + 1e-5, 0.0)
    growing = settle(ControlledDrive(drive), small, SettlingOptions(20.0, 6))
    assert growing.measures.regime is Regime.EQUILIBRIUM
    assert not growing.steady
    at_rest = settle(ControlledDrive(replace(PAPER, belt_speed=0.6)), small)
    assert at_rest.measures.regime is Regime.EQUILIBRIUM
    assert at_rest.steady


UNSTABLE_CYCLE = 0.3154795877
"""How far from rest the unstable cycle of the exponential law turns, m, at 1.175 m/s."""


@pytest.mark.parametrize(
    ("beyond", "regime"), [(-1e-3, Regime.EQUILIBRIUM), (1e-3, Regime.STICK_SLIP)]
)
def test_with_patience_a_start_near_an_unstable_cycle_ends_where_it_belongs(
    beyond: float, regime: Regime
) -> None:
    case = ControlledDrive.from_scenario(paper(*EXPONENTIAL, "plant.belt_speed=1.175"))
    start = MotionState(case.drive.equilibrium_position + UNSTABLE_CYCLE + beyond, 0.0)
    soon = settle(case, start, SettlingOptions(50.0, extensions=0))
    assert soon.measures.regime is Regime.PURE_SLIP
    late = settle(case, start, SettlingOptions(50.0, patience=80))
    assert late.measures.regime is regime
    assert late.steady


def test_patience_ends_when_the_motion_is_steady() -> None:
    # Without that it would be followed for a billion periods.
    settled = settle(ControlledDrive(PAPER), options=SettlingOptions(1000.0, patience=1_000_000))
    assert settled.steady


def test_options_that_cannot_be_are_refused() -> None:
    options: list[tuple[dict[str, Any], str]] = [
        ({"transient": -1.0}, "-1 natural periods: must be from 0 to 1e"),
        ({"transient": float("nan")}, "nan natural periods: must be from 0"),
        ({"transient": 2 * LONGEST}, r"2e\+06 natural periods: must be from 0 to 1e\+06"),
        ({"cycles": 0}, "0 cycles to measure: must be from 1 to"),
        ({"patience": 0}, "patience of 0 transients: must be from 1 to"),
        ({"extensions": -1}, "-1 extensions: must be from 0 to"),
    ]
    for values, message in options:
        with pytest.raises(InvalidInputError, match=message):
            SettlingOptions(**values)


def test_continuous_control_refuses_what_it_does_not_have() -> None:
    for name, value in (
        ("washout_controller.force_limit", "1.0"),
        ("plant.force_delay", "0.1"),
        ("plant.force_jitter", "0.1"),
        ("plant.disturbance.kind", "step"),
        ("plant.sensor.position_noise", "1e-06"),
        ("plant.actuator.limit", "300.0"),
    ):
        scenario = paper(f"{name}={value}")
        with pytest.raises(InvalidInputError, match=f"{name} = {value} is refused: .*contin"):
            ControlledDrive.from_scenario(scenario, continuous=True)


def test_without_control_and_disturbance_nothing_is_sampled() -> None:
    without = "plant.expects_control=false"
    assert ControlledDrive.from_scenario(paper(without)) == ControlledDrive(PAPER)
    disturbed = paper(without, "plant.disturbance.kind=step")
    assert ControlledDrive.from_scenario(disturbed).sampled is not None
    assert ControlledDrive.from_scenario(paper()).sampled is not None
    assert ControlledDrive.from_scenario(paper(), continuous=True).sampled is None
