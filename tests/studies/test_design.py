"""Gains for a drive, and whether they meet the stated requirements."""

import re
from dataclasses import replace
from functools import lru_cache
from math import inf
from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.loop.controller import Controller
from stickslip_ros.physics.loop.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.physics.loop.simulation import simulate_sampled
from stickslip_ros.physics.measures.cycle_measures import Measures, Regime
from stickslip_ros.physics.measures.cycle_meter import CycleMeter
from stickslip_ros.physics.model.control import Washout
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Coulomb, Exponential, FrictionLaw, Linear
from stickslip_ros.physics.motion import RecordedMotion
from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.samples import Sample
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.design import Design, Task, design, margins
from tests.physics.drives import FEED_DRIVE
from tests.scenarios.files import scenario_file

FEED = Task(FEED_DRIVE, 1000.0, 0.0, inf, (0.036, 0.044))


designed = lru_cache(design)
"""Several tests look at the same design."""


class RecordingController(Controller):
    """Keeps the largest force it asked for."""

    peak = 0.0

    def answer(self, sample: Sample) -> float | None:
        force = super().answer(sample)
        self.peak = max(self.peak, abs(force or 0.0))
        return force


def controlled(
    drive: Drive, task: Task, controller: Washout, duration: float
) -> tuple[Measures, float]:
    """Run the drive from rest, the controller coming on as it says; return measures and peak."""
    motion = RecordedMotion(drive, 0.0, 0.0)
    loop = SampledLoop(motion, task.rate, LOCKSTEP_START, force_delay=task.force_delay)
    washout = RecordingController(controller)
    measures = simulate_sampled(loop, motion, washout, duration, CycleMeter(5))
    return measures, washout.peak


def proposal(found: Design) -> Washout:
    assert found.controller is not None, found.remark
    return found.controller


def check_from_its_own_limit_cycle(task: Task) -> None:
    """Check that the proposal brings the drive to rest, at speeds that were checked and others."""
    found = designed(task)
    controller = proposal(found)
    for speed in (*task.belt_speeds, sum(task.belt_speeds) / 2.0):
        drive = replace(task.drive, belt_speed=speed)
        start = 2.0 + controller.start_after
        longest = max(check.settling_time or 0.0 for check in found.checks)
        late = replace(controller, start_after=start, force_limit=inf)
        measures, peak = controlled(drive, task, late, start + 5.0 * longest + 1.0)
        assert measures.regime is Regime.EQUILIBRIUM
        assert 0.0 < peak <= task.force_limit


def test_a_proposal_brings_the_drive_to_rest_about_as_predicted() -> None:
    task = replace(FEED, force_limit=100.0)
    found = designed(task)
    check_from_its_own_limit_cycle(task)
    for check in found.checks:
        assert check.vibrates
        # A large vibration dies out as nonlinearly as the friction is: here faster.
        assert 0.3 < check.settling_time / check.predicted_settling_time < 1.0
        assert check.peak_force == pytest.approx(check.predicted_peak_force, rel=0.02)
        assert check.predicted_peak_force <= 100.0
    assert len({check.belt_speed for check in found.checks}) == len(found.checks) > 3
    assert "margin" not in (found.remark or "")


def test_late_and_over_a_wide_range_too_it_brings_the_drive_to_rest() -> None:
    check_from_its_own_limit_cycle(replace(FEED, force_delay=0.005, force_limit=150.0))
    check_from_its_own_limit_cycle(replace(FEED, belt_speeds=(0.008, 0.04), force_limit=300.0))


def test_nothing_near_a_proposal_is_much_faster() -> None:
    task = replace(FEED, belt_speeds=(0.04, 0.04))
    gains = proposal(designed(task))
    loop = LinearSampledLoop.from_drive(FEED_DRIVE, 1000.0)
    corners = gains.corner_frequency * np.linspace(0.5, 2.0, 31)
    linear = gains.linear_gain * np.linspace(0.5, 2.0, 31)
    assert loop.decay_rate(gains) > 0.95 * loop.decay_rates(corners, linear).max()


def test_margins_lead_to_the_edge_of_stability() -> None:
    loop = LinearSampledLoop.from_drive(FEED_DRIVE, 1000.0, 0.0025)
    gains = Washout(20.0, -3000.0, 0.0)
    found = margins([loop], gains)
    for factor in (found.gain_down, found.gain_up):
        at_edge = replace(gains, linear_gain=factor * gains.linear_gain)
        assert loop.spectral_radius(at_edge) == pytest.approx(1.0, abs=1e-9)
    late = replace(loop, force_delay=0.0025 + found.delay)
    assert late.spectral_radius(gains) == pytest.approx(1.0, abs=1e-9)


def test_margins_are_the_tightest_of_the_range() -> None:
    """The highest speed is stable without control, the lowest is the worst."""
    task = replace(FEED, belt_speeds=(0.001, 0.06))
    found = designed(task)
    tightest = found.margins
    for speed in np.linspace(*task.belt_speeds, 9).tolist():
        loop = LinearSampledLoop.from_drive(replace(FEED_DRIVE, belt_speed=speed), FEED.rate)
        one = margins([loop], proposal(found))
        assert (one.gain_down or 0.0) <= tightest.gain_down < 1.0
        assert (one.gain_up or inf) >= (tightest.gain_up or inf) > 1.0
        assert (one.delay or inf) >= (tightest.delay or inf) > 0.0


def test_without_damping_no_share_of_the_gain_is_unstable() -> None:
    loop = LinearSampledLoop.from_drive(
        replace(FEED_DRIVE, friction=Coulomb(0.4), damping=0.0), 1000.0
    )
    assert margins([loop], Washout(20.0, -3000.0, 0.0)).gain_down is None


def test_a_tighter_limit_is_slower_and_in_the_end_there_is_nothing() -> None:
    task, rates = replace(FEED, belt_speeds=(0.04, 0.04)), []
    for limit in (600.0, 200.0, 100.0):
        found = designed(replace(task, force_limit=limit))
        rates.append(min(check.decay_rate for check in found.checks))
    assert rates == sorted(rates, reverse=True)
    found = designed(replace(task, force_limit=20.0))
    assert found.controller is None
    assert found.parameter_file is None
    assert "force limit of 20 N is too small" in (found.remark or "")


def test_the_cubic_gain_is_within_what_the_friction_law_bears() -> None:
    """The law's own, (mu_s - mu_m) N / (2 v_m^3), is 6e5 N s^3/m^3."""
    controller = proposal(designed(replace(FEED, force_limit=100.0)))
    assert 0.0 <= controller.cubic_gain <= 3e5
    # From any speed it comes back, even with a force that is not limited.
    for speed in (0.3, -3.0, 30.0):
        motion = RecordedMotion(FEED_DRIVE, 0.0, speed)
        loop = SampledLoop(motion, 1000.0, LOCKSTEP_START)
        free = replace(controller, force_limit=inf, start_after=0.0)
        measures = simulate_sampled(loop, motion, Controller(free), 8.0, CycleMeter(5))
        assert measures.regime is Regime.EQUILIBRIUM


@pytest.mark.parametrize("friction", [Coulomb(0.4), Exponential(0.4, 0.25, 0.1, 0.0)])
def test_a_law_that_does_not_grow_with_speed_gets_no_cubic_gain(friction: FrictionLaw) -> None:
    drive = replace(FEED_DRIVE, friction=friction, damping=100.0)
    found = designed(replace(FEED, drive=drive, force_limit=200.0))
    assert proposal(found).cubic_gain == 0.0


def test_on_a_slow_belt_too_the_vibration_is_seen() -> None:
    """At 0.2 mm/s the slide sticks for dozens of natural periods in each cycle."""
    found = designed(replace(FEED, belt_speeds=(0.0002, 0.0002)))
    (check,) = found.checks
    assert check.vibrates
    assert proposal(found).linear_gain < 0.0


@pytest.mark.parametrize(
    ("belt_speed", "said"),
    [
        (40.0, "40 m/s is 818.4 times the critical speed of 0.04888 m/s (belt speeds are in m/s)"),
        (0.05, "(belt speeds are in m/s), with a very small margin"),
    ],
)
def test_where_nothing_vibrates_the_gains_are_zero(belt_speed: float, said: str) -> None:
    found = designed(replace(FEED, belt_speeds=(belt_speed, belt_speed)))
    controller = proposal(found)
    assert (controller.linear_gain, controller.cubic_gain) == (0.0, 0.0)
    remark = found.remark or ""
    assert remark.startswith("nothing vibrates")
    assert remark.endswith(said)
    (check,) = found.checks
    assert not check.vibrates
    assert check.settling_time is None


def test_where_there_is_nothing_to_propose_it_says_why() -> None:
    for task, reason in (
        (replace(FEED, rate=10.0, force_limit=1.0), "no linear gain"),
        (replace(FEED, force_delay=1.0), "1000 periods late"),
        (replace(FEED, drive=replace(FEED_DRIVE, friction=Linear(0.4, 9.0))), "diverges"),
    ):
        found = designed(task)
        assert found.controller is None
        assert found.parameter_file is None
        assert reason in (found.remark or "")


@pytest.mark.long
@pytest.mark.parametrize(
    "task",
    [
        replace(FEED, force_limit=135.0, force_delay=0.0015, belt_speeds=(0.02, 0.04)),
        replace(FEED, force_limit=0.0),
    ],
)
def test_the_force_that_it_says_would_do_does(task: Task) -> None:
    hint = re.search(r"a force limit of about (\S+) N is sufficient", designed(task).remark or "")
    enough = float(hint[1])
    assert enough > task.force_limit
    assert design(replace(task, force_limit=enough)).controller is not None
    assert design(replace(task, force_limit=0.95 * enough)).controller is None


def test_next_to_no_margin_is_said() -> None:
    late = designed(replace(FEED, force_delay=0.018, belt_speeds=(0.02, 0.04)))
    assert late.margins.delay == pytest.approx(2e-4, rel=0.1)
    assert "the margin is very small: an additional delay of 0.0001" in (late.remark or "")


def test_what_a_limited_force_cannot_do_is_said() -> None:
    drive = replace(FEED_DRIVE, friction=Linear(0.4, 4.5))
    found = designed(replace(FEED, drive=drive, force_limit=600.0, belt_speeds=(0.04, 0.04)))
    assert proposal(found).cubic_gain == 0.0
    assert "needs more force than the limit" in (found.remark or "")


def test_it_is_the_same_every_time_and_progress_reaches_the_end() -> None:
    shares: list[float] = []
    first = design(replace(FEED, force_limit=200.0), shares.append)
    second = designed(replace(FEED, force_limit=200.0))
    assert (first.controller, first.checks) == (second.controller, second.checks)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


WASHOUT = Washout(3.0, -2.0, 0.0)


def test_without_a_scenario_the_parameter_file_has_the_gains_alone(tmp_path: Path) -> None:
    text = Design(FEED, WASHOUT).parameter_file
    assert load_scenario(scenario_file(tmp_path, text)).controller.control_law == WASHOUT


def test_of_a_scenario_it_is_that_scenario_with_the_gains(tmp_path: Path) -> None:
    for number, (belt_speed, belt_speeds, expected) in enumerate(
        ((0.04, None, 0.04), (-0.04, None, -0.04), (0.04, (0.01, 0.03), 0.03),
         (-0.04, (0.05, 0.06), -0.05))
    ):  # fmt: skip
        overrides = (f"plant.belt_speed={belt_speed}", "plant.mass=90", "analyzer.window=7")
        scenario = load_scenario("feed_drive", overrides)
        text = Design(Task.from_scenario(scenario, belt_speeds), WASHOUT).parameter_file
        (folder := tmp_path / str(number)).mkdir()
        read = load_scenario(scenario_file(folder, text))
        assert (read.plant.mass, read.plant.stiffness, read.analyzer.window) == (90.0, 1e6, 7)
        assert read.plant.belt_speed == expected
        assert read.controller.control_law == WASHOUT
        names = {name for name, value in scenario.as_dict()["plant"].items() if value != []}
        assert all(f'"{name}":' in text for name in names)


def test_the_range_of_belt_speeds() -> None:
    scenario = load_scenario("feed_drive")
    for belt_speeds in ((2.0, 1.0), (0.0, 1.0), (-1.0, 1.0), (0.1, inf)):
        with pytest.raises(InvalidInputError, match="the lower first"):
            Task.from_scenario(scenario, belt_speeds)
    with pytest.raises(InvalidInputError, match="must be given"):
        Task.from_scenario(scenario.overridden(["plant.belt_speed=0"]))
    for speed in (0.04, -0.04):
        about = scenario.overridden([f"plant.belt_speed={speed}"])
        assert Task.from_scenario(about).belt_speeds == pytest.approx((0.036, 0.044))
