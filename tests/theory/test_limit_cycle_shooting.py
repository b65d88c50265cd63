"""Limit cycles by shooting: where they are, and their Floquet multipliers, stable or not."""

from dataclasses import replace
from math import exp

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Exponential, FrictionLaw, Linear, Stribeck
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.simulation import simulate_continuous
from stickslip_ros.theory.cycle_bounds import largest_cycle, least_cycle
from stickslip_ros.theory.limit_cycles import limit_cycle_of_run, limit_cycles
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.shooting import LimitCycle, shoot
from stickslip_ros.theory.sticking import sticking_onset
from tests import drives
from tests.drives import FEED_DRIVE, LIMIT_CYCLES, PAPER, settled

# Rest is stable, and so is stick-slip: between them there is an unstable cycle of pure slip.
SUDDEN = replace(PAPER, friction=Exponential(0.4, 0.25, 0.05, 0.0))
# Friction falls faster than the damping rises: far out everything runs away.
FALLING = replace(PAPER, belt_speed=0.2, damping=0.2, friction=Linear(0.4, 0.45))
GAINS = Washout(2.0, -0.5, 0.0)


def returns(drive: Drive, cycle: LimitCycle, offset: float = 0.0) -> float:
    """Where the plain motion is one period after the cycle's turning point, moved by `offset`."""
    motion = Motion(drive, cycle.position + offset, 0.0)
    motion.advance(cycle.period)
    return motion.position


def ends_in(drive: Drive, position: float, periods: int = 150) -> Regime | None:
    return settled(RecordedMotion(drive, position, 0.0), periods, 3.0).regime


def check(found: list[LimitCycle], cycle: drives.LimitCycle, length: float, time: float) -> None:
    (only,) = found
    measures = only.measures
    assert only.stable
    assert only.period == pytest.approx(cycle.period * time, rel=1e-9)
    assert measures.period == pytest.approx(only.period, rel=1e-12)
    assert measures.amplitude == pytest.approx(cycle.amplitude * length, abs=1e-9 * length)
    assert measures.velocity_amplitude == pytest.approx(
        cycle.velocity_amplitude * length / time, abs=1e-9 * length / time
    )
    assert measures.midpoint == pytest.approx(cycle.midpoint * length, abs=1e-9 * length)
    assert measures.stick_fraction == pytest.approx(cycle.stick_fraction, abs=1e-9)
    assert measures.regime is (Regime.STICK_SLIP if cycle.stick_fraction else Regime.PURE_SLIP)
    if cycle.stick_fraction:
        assert only.multipliers == (0.0,)


@pytest.mark.parametrize("cycle", LIMIT_CYCLES, ids=lambda cycle: f"belt speed {cycle.belt_speed}")
def test_the_reference_cycles_and_no_others(cycle: drives.LimitCycle) -> None:
    drive = replace(PAPER, belt_speed=cycle.belt_speed)
    check(limit_cycles(drive), cycle, 1.0, 1.0)
    mirrored = limit_cycles(replace(drive, belt_speed=-cycle.belt_speed))
    check(mirrored, cycle._replace(midpoint=-cycle.midpoint), 1.0, 1.0)
    in_si = replace(FEED_DRIVE, belt_speed=cycle.belt_speed / 10.0)
    check(limit_cycles(in_si), cycle, 1e-3, 1e-2)


@pytest.mark.parametrize("drive", [replace(PAPER, belt_speed=0.46), SUDDEN, FALLING])
def test_multipliers_are_what_a_small_change_of_the_start_grows_to(drive: Drive) -> None:
    cycles = limit_cycles(drive)
    assert cycles
    step = 1e-6
    for cycle in cycles:
        assert returns(drive, cycle) == pytest.approx(cycle.position, abs=1e-11)
        slope = (returns(drive, cycle, step) - returns(drive, cycle, -step)) / (2.0 * step)
        assert cycle.multipliers == pytest.approx([slope], abs=1e-8)


def test_an_unstable_cycle_lies_between_rest_and_stick_slip() -> None:
    unstable, stable = limit_cycles(SUDDEN)
    assert not unstable.stable
    assert unstable.measures.regime is Regime.PURE_SLIP
    assert stable.stable
    assert stable.measures.regime is Regime.STICK_SLIP
    assert stable.multipliers == (0.0,)
    assert ends_in(SUDDEN, unstable.position + 1e-4) is Regime.EQUILIBRIUM
    assert ends_in(SUDDEN, unstable.position - 1e-4) is Regime.STICK_SLIP


def test_an_unstable_cycle_separates_stick_slip_from_running_away() -> None:
    stable, unstable = limit_cycles(FALLING)
    assert stable.measures.regime is Regime.STICK_SLIP
    # It overtakes the belt without sticking.
    assert unstable.measures.velocity_amplitude > 5.0 * FALLING.belt_speed
    assert unstable.measures.stick_fraction == 0.0
    assert abs(unstable.multipliers[0]) > 2.0
    assert ends_in(FALLING, unstable.position + 1e-4) is Regime.STICK_SLIP
    assert ends_in(FALLING, unstable.position - 1e-4) is Regime.UNBOUNDED


@pytest.mark.parametrize("below", [1e-2, 1e-4])
def test_two_cycles_close_together_are_both_found(below: float) -> None:
    """Just below the onset speed the unstable cycle and the one that sticks nearly touch."""
    onset = sticking_onset(SUDDEN).exact
    unstable, stable = limit_cycles(replace(SUDDEN, belt_speed=onset * (1.0 - below)))
    assert not unstable.stable
    assert stable.measures.regime is Regime.STICK_SLIP
    assert limit_cycles(replace(SUDDEN, belt_speed=onset * (1.0 + below))) == []


WITHOUT_CYCLE = {
    "belt at rest": replace(PAPER, belt_speed=0.0),
    "above the Hopf speed": replace(PAPER, belt_speed=0.5),
    "overdamped": replace(PAPER, damping=3.0),
    "damped": replace(PAPER, friction=Coulomb(0.4)),
    "a continuum of orbits": replace(PAPER, friction=Coulomb(0.4), damping=0.0),
    "runs away": replace(PAPER, friction=Linear(0.4, 0.9)),
    "runs away without turning": replace(PAPER, friction=Linear(0.4, 2.5)),
}


@pytest.mark.parametrize("drive", WITHOUT_CYCLE.values(), ids=WITHOUT_CYCLE)
def test_where_there_is_no_limit_cycle(drive: Drive) -> None:
    assert limit_cycles(drive) == []
    assert shoot(drive, 0.0, drive.natural_period) is None
    assert limit_cycle_of_run(drive, 0.0) is None


LAWS = st.one_of(
    st.builds(Stribeck, st.just(0.4), st.floats(0.1, 0.39), st.floats(0.1, 2.0)),
    st.builds(Linear, st.floats(0.1, 0.6), st.floats(0.05, 1.0)),
    st.builds(Exponential, st.just(0.4), st.floats(0.1, 0.39), st.floats(0.05, 2.0), st.just(0.0)),
)


@pytest.mark.long
@settings(max_examples=25)
@given(LAWS, st.floats(0.005, 1.0), st.floats(0.05, 1.5), st.sampled_from([1.0, -1.0]))
def test_cycles_close_and_are_stable_in_turns(
    law: FrictionLaw, damping: float, speed: float, direction: float
) -> None:
    """Of nested cycles in the plane with nothing between, one attracts and the other repels."""
    drive = replace(PAPER, friction=law, damping=damping, belt_speed=direction * speed)
    cycles = limit_cycles(drive)
    expansion = expand(drive)
    stable = expansion.stable
    for cycle in cycles:
        assert cycle.stable is not stable
        stable = cycle.stable
        assert returns(drive, cycle) == pytest.approx(cycle.position, rel=1e-9, abs=1e-9)
    distances = [float(expansion.equilibrium[0]) - cycle.position for cycle in cycles]
    assert distances == sorted(distances)
    assert all(distance > 0.0 for distance in distances)


def test_the_cycle_under_washout_control_is_what_a_long_run_leaves() -> None:
    cycle = limit_cycle_of_run(PAPER, 0.0, control=GAINS)
    assert cycle.stable
    motion = RecordedMotion(PAPER, 0.0, 0.0, control=GAINS)
    run = simulate_continuous(motion, Washout(2.0, -0.5, 0.0), 1200.0, CycleMeter(10))
    assert cycle.period == pytest.approx(run.period, rel=1e-10)
    assert cycle.measures.amplitude == pytest.approx(run.amplitude, rel=1e-10)
    assert cycle.measures.midpoint == pytest.approx(run.midpoint, rel=1e-10)


def test_shooting_from_a_rough_guess_under_control_in_si_units() -> None:
    cycle = limit_cycle_of_run(PAPER, 0.0, control=GAINS)
    # Time in units of 10 ms, length 1 mm, force 1000 N.
    found = shoot(
        FEED_DRIVE,
        cycle.position * 0.97e-3,
        cycle.period * 1.02e-2,
        control=Washout(200.0, -0.5e4, 0.0),
        filter_state=cycle.filter_state * 1.05e-3,
    )
    assert found.filter_state is not None
    assert found.position == pytest.approx(cycle.position * 1e-3, rel=1e-10)
    assert found.filter_state == pytest.approx(cycle.filter_state * 1e-3, rel=1e-10)
    assert found.period == pytest.approx(cycle.period * 1e-2, rel=1e-10)
    assert found.multipliers == pytest.approx(cycle.multipliers, abs=1e-9)


def test_a_guess_of_two_periods_is_no_cycle() -> None:
    (cycle,) = limit_cycles(PAPER)
    assert shoot(PAPER, cycle.position, cycle.period) == cycle
    assert shoot(PAPER, cycle.position, 2.0 * cycle.period) is None


def test_a_run_that_control_stills_or_that_runs_away_has_no_cycle() -> None:
    assert limit_cycle_of_run(PAPER, 0.0, control=Washout(2.0, -1.5, 0.0)) is None
    assert limit_cycle_of_run(PAPER, 0.0, 5.0, control=Washout(2.0, 0.0, 5.0)) is None
    assert limit_cycle_of_run(FALLING, 4.0) is None


# Against the friction's scales the belt is slow by four digits and more, and the slide creeps.
SLOW = replace(FEED_DRIVE, normal_force=1e6)
CREEPING = replace(PAPER, belt_speed=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("drive", [SLOW, CREEPING], ids=["heavily pressed", "slow belt"])
def test_the_cycle_of_a_slow_belt_is_where_a_run_ends(drive: Drive) -> None:
    (cycle,) = limit_cycles(drive)
    run = limit_cycle_of_run(drive, 0.0)
    assert cycle.multipliers == (0.0,)
    assert cycle.position == pytest.approx(run.position, rel=1e-12)
    assert cycle.period == pytest.approx(run.period, rel=1e-9)


@pytest.mark.parametrize(
    "drive",
    [
        replace(PAPER, damping=1e6),
        replace(PAPER, friction=Stribeck(0.4, 0.25, 1e-3)),
        replace(PAPER, friction=Linear(0.4, 0.02)),
    ],
    ids=["damped", "far up the rising branch", "neutral"],
)
@pytest.mark.parametrize("gains", [None, Washout(2.0, -1.0, -1.0)], ids=["open", "controlled"])
def test_where_no_energy_is_gained_there_is_no_cycle(drive: Drive, gains: Washout | None) -> None:
    assert least_cycle(drive) is None
    assert limit_cycles(drive) == []
    assert limit_cycle_of_run(drive, 0.0, control=gains) is None


@pytest.mark.parametrize("drive", [PAPER, replace(PAPER, belt_speed=0.2), SUDDEN])
def test_cycles_keep_within_the_bounds_that_energy_sets(drive: Drive) -> None:
    least, largest = least_cycle(drive), largest_cycle(drive)
    for cycle in limit_cycles(drive):
        assert least <= drive.equilibrium_position - cycle.position <= largest
    # From beyond, the slide turns nearer, the belt being overtaken or not.
    for distance in (1.01 * largest, 2.0 * largest, 10.0 * largest):
        motion = RecordedMotion(drive, drive.equilibrium_position - distance, 0.0)
        motion.advance(0.25 * drive.natural_period)
        motion.take_breakpoints()
        motion.advance(2.0 * drive.natural_period)
        assert motion.take_breakpoints().position.min() > drive.equilibrium_position - distance


def test_a_cycle_too_stiff_to_follow_is_not_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stickslip_ros.motion.hybrid_motion._SPARE_STEPS", 1000)
    gains = Washout(2.0, -1e6, 0.0)
    assert limit_cycle_of_run(replace(PAPER, belt_speed=0.1), 0.0, control=gains) is None


def test_a_controller_without_gain_leaves_the_cycle_and_adds_its_own_decay() -> None:
    for belt_speed in (0.3, 0.46):
        drive = replace(PAPER, belt_speed=belt_speed)
        (free,) = limit_cycles(drive)
        cycle = limit_cycle_of_run(drive, 0.0, control=Washout(0.2, 0.0, 0.0))
        assert cycle.position == pytest.approx(free.position, rel=1e-10)
        assert cycle.period == pytest.approx(free.period, rel=1e-11)
        both = sorted([abs(free.multipliers[0]), exp(-0.2 * free.period)], reverse=True)
        assert [abs(m) for m in cycle.multipliers] == pytest.approx(both, abs=1e-9)
