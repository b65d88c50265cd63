"""Design: its task, and gains of any law that hold in simulation, or why there are none."""

import re
from functools import cache
from math import inf, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip_ros as ss
from benchmarks.design import compare
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.control import Washout
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.case_outcome import Disturbance
from stickslip_ros.studies.design import Design, Task, design
from stickslip_ros.studies.design_trial import Trial
from stickslip_ros.studies.spread import drawn
from tests.scenarios.files import scenario_file

WASHOUT = Washout(3.0, -2.0, 0.0)


def test_of_a_scenario_it_is_that_scenario_with_the_gains(tmp_path: Path) -> None:
    for number, (belt_speed, belt_speeds, expected) in enumerate(
        ((0.04, None, 0.04), (-0.04, None, -0.04), (0.04, (0.01, 0.03), 0.03),
         (-0.04, (0.05, 0.06), -0.05))
    ):  # fmt: skip
        overrides = (f"plant.belt_speed={belt_speed}", "plant.mass=90", "analyzer.window=7")
        scenario = load_scenario("feed_drive", overrides)
        text = Design(Task.from_scenario(scenario, belt_speeds), WASHOUT).parameter_file or ""
        (folder := tmp_path / str(number)).mkdir()
        read = load_scenario(scenario_file(folder, text))
        assert (read.plant.mass, read.plant.stiffness, read.analyzer.window) == (90.0, 1e6, 7)
        assert read.plant.belt_speed == expected
        assert read.controller.control_law == WASHOUT
        names = {name for name, value in scenario.as_dict()["plant"].items() if value != []}
        assert all(f'"{name}":' in text for name in names)


def test_the_range_of_belt_speeds() -> None:
    scenario = load_scenario("feed_drive")
    with pytest.raises(InvalidInputError, match="2 m/s to 1 m/s: the lower must be first"):
        Task.from_scenario(scenario, (2.0, 1.0))
    for belt_speeds in ((0.0, 1.0), (-1.0, 1.0), (0.1, inf)):
        with pytest.raises(InvalidInputError, match="must be above 0, at most"):
            Task.from_scenario(scenario, belt_speeds)
    with pytest.raises(InvalidInputError, match="must be given"):
        Task.from_scenario(scenario.overridden(["plant.belt_speed=0"]))
    with pytest.raises(InvalidInputError, match="gains are for a moving belt"):
        Task.from_scenario(load_scenario("axis", controller="pid"))
    for speed in (0.04, -0.04):
        about = scenario.overridden([f"plant.belt_speed={speed}"])
        assert Task.from_scenario(about).belt_speeds == pytest.approx((0.036, 0.044))


def test_a_proposal_holds_in_simulation_and_its_file_has_the_gains() -> None:
    drive = ss.scenario("feed_drive", "plant.force_delay=0.001", controller="velocity_feedback")
    found = ss.design(drive, (0.03, 0.04))
    assert found.remark is None
    assert all(check.held for check in found.design.checks)
    assert len(found.design.checks) == 10
    gain = found.scenario.controller.control_law.velocity_gain
    assert f'"velocity_gain": {gain}' in found.design.parameter_file
    margin = found.design.tuned.phase_margin
    assert margin is not None
    assert 0.0 < margin < pi
    radius = max(np.abs(poles).max() for poles in found.poles.values())
    assert -np.log(radius) * 1000.0 == pytest.approx(found.design.tuned.decay_rate, rel=1e-6)
    frame = found.to_pandas()
    assert frame["belt_speed"].tolist() == [check.belt_speed for check in found.checks]
    assert frame.attrs["units"]["peak_force"] == "N"
    assert found.plot().axes


MACHINE = {
    "plant.mass": 250.0, "plant.stiffness": 8e6, "plant.damping": 900.0,
    "plant.normal_force": 2500.0,
    "plant.friction.static": 0.18, "plant.friction.minimum": 0.11,
    "plant.friction.minimum_speed": 0.025, "plant.rate": 2000.0, "plant.force_delay": 0.0005,
    "plant.sensor.position_resolution": 5e-7, "plant.sensor.velocity": "difference",
    "plant.belt_speed": 0.01,
}  # fmt: skip


@pytest.mark.long
def test_where_the_body_that_is_fed_back_has_no_gains_the_other_one_is() -> None:
    values = MACHINE | {"plant.motor.kind": "mass", "plant.motor.mass": 200.0}
    values |= {"plant.motor.damping": 500.0, "plant.motor.friction": 60.0}
    values |= {
        name.replace("plant.", "plant.motor."): value
        for name, value in MACHINE.items()
        if "sensor" in name
    }
    drive = load_scenario("feed_drive", controller="cascade").changed(values)
    found = design(Task(drive, (0.002, 0.03), 2000.0))
    assert found.scenario is not None
    assert found.scenario.control_law.velocity_feedback == "motor"
    assert all(check.held for check in found.checks)
    assert "velocity_feedback is motor: with table there are no gains" in (found.remark or "")
    for check in found.checks:
        assert 0.6 < check.disturbed_force / check.predicted_peak_force <= 1.02


def test_gains_beyond_a_limit_are_no_proposal_and_it_is_told_by_how_much() -> None:
    """The mean friction of 429 N is more than the limit, and the integral carries it."""
    drive = load_scenario("feed_drive", controller="pid").changed(MACHINE)
    found = ss.design(drive, 0.002, force_limit=300.0)
    assert found.controller is None
    assert "the peak force is 4" in (found.remark or "")
    assert "must be at most 300 N" in (found.remark or "")
    first, *_ = found.parts()
    assert "nothing to propose: no gains keep all limits" in str(first)


@pytest.mark.long
def test_a_grid_of_gains_is_not_faster() -> None:
    found = compare(58)  # of which a reserve would cost most of the rate
    assert found.decay_rate is not None
    assert found.found
    assert all(found.held)
    assert max(found.force_ratios) < 1.02


def spread_task(law: str, force_limit: float, spread: float) -> Task:
    scenario = load_scenario("feed_drive", controller=law)
    return Task(scenario, (0.04, 0.04), force_limit, spread)


def test_gains_for_a_spread_keep_the_limits_of_all_drives_that_are_searched_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("stickslip_ros.studies.design._SEARCHED", 5)
    monkeypatch.setattr("stickslip_ros.studies.design._TRIED", 3)
    task = spread_task("pid", 480.0, 0.2)
    found, alone = design(task), design(spread_task("pid", 480.0, 0.0))
    missed: list[int] = []
    for seed in range(5):
        scenario = task.scenario.changed(drawn(task.scenario, seed, 0.2))
        step = [Disturbance.parse("step", task.scenario)]
        other = Trial(Task(scenario, (0.04, 0.04), 480.0), step)
        assert other.loops.slowest(found.controller).decay_rate(found.controller) > 0.0
        assert other.loops.missed(found.controller) == ()
        assert all(check.held for check, _ in other.checks(found.controller))
        missed += [seed] * bool(other.loops.missed(alone.controller))
    assert missed
    assert alone.drawn is None
    assert (found.drawn.held, found.drawn.drives) == (3, 3)
    assert found.drawn.held_interval == pytest.approx((0.025 ** (1 / 3), 1.0))  # all of n
    seeds = [drawn(task.scenario, seed, 0.2) for seed in range(5, 8)]
    assert found.drawn.worst in seeds
    assert found.drawn.check.decay_rate < found.tuned.decay_rate


def test_where_no_gains_hold_all_drives_it_is_told_which_one_excludes_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("stickslip_ros.studies.design._SEARCHED", 3)
    monkeypatch.setattr("stickslip_ros.studies.design._TRIED", 1)
    found = design(spread_task("pid", 320.0, 0.2))
    assert design(spread_task("pid", 320.0, 0.0)).controller is not None
    assert found.controller is None
    remark = found.remark or ""
    assert "must be at most 320 N, of drawn drive" in remark
    (named,) = {int(number) for number in re.findall(r"drawn drive (\d)", remark)}
    forces = [drawn(found.task.scenario, seed, 0.2)["plant.normal_force"] for seed in range(3)]
    assert f"plant.normal_force={max(forces):.4g}" in remark
    assert forces[named] == max(forces)
    assert re.search(r"a force limit of about \d{3} N is sufficient", remark)


def test_a_drawn_drive_that_is_not_held_is_counted_and_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("stickslip_ros.studies.design._SEARCHED", 0)
    monkeypatch.setattr("stickslip_ros.studies.design._TRIED", 8)
    drive = ss.scenario("feed_drive", controller="velocity_feedback")
    found = ss.design(drive, (0.03, 0.04), force_limit=60.0, spread=0.3)
    assert 0 < found.design.drawn.held < 8
    assert not found.design.drawn.check.held
    text = f"holds {found.design.drawn.held} of 8 drawn drives (95 % interval from "
    assert text in str(found)
    assert "the worst: plant.mass=" in str(found)
    assert "the simulated drive is not held at 30 mm/s" in str(found)
    assert found.to_dict()["drawn"]["worst"] == found.design.drawn.worst
    # What grows cannot be simulated until it has settled.
    weak = Trial(task(AT_40), []).worst(Washout(11.0, -1.0, 0.0))
    assert not weak.held
    assert re.match(r"at 40 mm/s a small deviation grows with [\d.]+ 1/s", weak.reason)
    # With drives to search for, one of them says why there is nothing to propose.
    monkeypatch.setattr("stickslip_ros.studies.design._SEARCHED", 8)
    monkeypatch.setattr("stickslip_ros.studies.design._ATTEMPTS", 1)
    nothing = ss.design(drive, (0.03, 0.04), force_limit=60.0, spread=0.3)
    assert nothing.controller is None
    assert re.match(r"of drawn drive \d \(plant.mass=.*the simulated drive", nothing.remark)


def test_an_axis_without_a_spring_gets_gains_for_a_feed() -> None:
    axis = load_scenario("axis", controller="pid")
    found = design(Task.from_scenario(axis, (0.01, 0.01)))
    assert found.remark is None
    assert [check.held for check in found.checks] == [True, True]
    assert found.tuned.decay_rate > 0.0


def task(
    belt_speeds: tuple[float, float] = (0.036, 0.044), force_limit: float = inf, **values: Any
) -> Task:
    """Return a task for the feed drive with other values of the plant; "__" stands for a point."""
    changed = {f"plant.{name.replace('__', '.')}": value for name, value in values.items()}
    return Task(load_scenario("feed_drive").changed(changed), belt_speeds, force_limit)


@cache
def designed(**values: Any) -> Design:
    """Return the design of a task; several tests look at the same one."""
    return design(task(**values))


AT_40 = (0.04, 0.04)


def proposal(found: Design) -> Washout:
    assert found.controller is not None, found.remark
    return found.controller


def unlimited(found: Design, **values: float) -> ss.Scenario:
    """Return a scenario with the proposal, whose force is not limited."""
    assert found.scenario is not None
    return ss.scenario(found.scenario, force_limit=inf, window=5, **values)


@pytest.mark.long
def test_a_proposal_brings_the_drive_to_rest_about_as_predicted() -> None:
    """From its own limit cycle, at speeds that were checked and between them."""
    found = designed(force_limit=100.0)
    start = 2.0 + proposal(found).start_after
    longest = max(check.settling_time or 0.0 for check in found.checks)
    for speed in (*found.task.belt_speeds, sum(found.task.belt_speeds) / 2.0):
        scenario = unlimited(found, belt_speed=speed, start_after=start)
        run = ss.simulate(scenario, start + 5.0 * longest + 1.0)
        assert run.measures.regime is Regime.EQUILIBRIUM
        assert 0.0 < np.abs(run.trajectory.control_force).max() <= found.task.force_limit
    for check in (each for each in found.checks if each.disturbance == "vibration"):
        assert check.vibrates
        # A large vibration dies out as nonlinearly as the friction is: here faster.
        assert 0.3 < check.settling_time / check.predicted_settling_time < 1.0
        assert check.peak_force == pytest.approx(check.predicted_peak_force, rel=0.02)
        assert check.predicted_peak_force <= 100.0
    assert len({check.belt_speed for check in found.checks}) == len(found.checks) // 3 > 3
    assert "margin" not in (found.remark or "")


def test_a_tighter_limit_is_slower_and_in_the_end_there_is_nothing() -> None:
    law = "velocity_feedback"
    nothing = design(spread_task(law, 20.0, 0.0))
    assert nothing.parameter_file is None
    hint = re.search(r"a force limit of about (\S+) N is sufficient", nothing.remark or "")
    found = [design(spread_task(law, limit, 0.0)) for limit in (100.0, float(hint[1]))]
    rates = [min(check.decay_rate for check in each.checks) for each in found]
    assert rates == sorted(rates, reverse=True)


def test_the_cubic_gain_is_within_what_the_friction_law_bears() -> None:
    """The law's own, (mu_s - mu_m) N / (2 v_m^3), is 6e5 N s^3/m^3."""
    found = designed(belt_speeds=AT_40, force_limit=100.0)
    assert 0.0 <= proposal(found).cubic_gain <= 3e5
    # From any speed it comes back, even with a force that is not limited.
    for speed in (0.3, -3.0, 30.0):
        free = unlimited(found, initial_velocity=speed, start_after=0.0)
        assert ss.simulate(free, 8.0).measures.regime is Regime.EQUILIBRIUM


@pytest.mark.parametrize(
    "friction",
    [
        {"friction__law": "coulomb"},
        {"friction__law": "exponential", "friction__kinetic": 0.25, "friction__decay_speed": 0.1},
    ],
)
def test_a_law_that_does_not_grow_with_speed_gets_no_cubic_gain(friction: dict[str, Any]) -> None:
    found = designed(belt_speeds=AT_40, damping=100.0, force_limit=200.0, **friction)
    assert proposal(found).cubic_gain == 0.0


def test_on_a_slow_belt_too_the_vibration_is_seen() -> None:
    """At 0.2 mm/s the slide sticks for dozens of natural periods in each cycle."""
    found = designed(belt_speeds=(0.0002, 0.0002))
    check, *_ = found.checks
    assert check.vibrates
    assert proposal(found).linear_gain < 0.0


@pytest.mark.parametrize("belt_speed", [40.0, 0.05])
def test_where_nothing_vibrates_it_is_told(belt_speed: float) -> None:
    found = designed(belt_speeds=(belt_speed, belt_speed))
    remark = found.remark or ""
    assert remark.startswith("nothing vibrates")
    assert "(belt speeds are in m/s)" in remark
    assert ("with a very small margin" in remark) is (belt_speed == 0.05)
    assert not any(check.vibrates for check in found.checks)


def test_where_there_is_nothing_to_propose_it_says_why() -> None:
    linear = {"friction__law": "linear", "friction__slope": 9.0}
    tasks: list[tuple[dict[str, Any], str]] = [
        ({"rate": 10.0, "force_limit": 1.0}, "no gains make the loop stable"),
        ({"force_delay": 1.0}, "1000 periods late"),
        (linear, "diverges"),
    ]
    for values, reason in tasks:
        found = designed(**values)
        assert found.controller is None
        assert found.parameter_file is None
        assert reason in (found.remark or "")


def test_what_a_limited_force_cannot_do_is_said() -> None:
    friction = {"friction__law": "linear", "friction__slope": 4.5}
    found = designed(force_limit=600.0, belt_speeds=AT_40, **friction)
    assert proposal(found).cubic_gain == 0.0
    assert "needs more force than the limit" in (found.remark or "")


def test_it_is_the_same_every_time_and_progress_reaches_the_end() -> None:
    shares: list[float] = []
    first = design(task(AT_40, 100.0), shares.append)
    second = designed(belt_speeds=AT_40, force_limit=100.0)
    assert (first.controller, first.checks) == (second.controller, second.checks)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_it_is_tried_with_sensor_and_actuator_and_tells_what_they_leave() -> None:
    """It stays within the limit of the actuator, even if the controller has none."""
    encoder = {"sensor_position_resolution": 1e-6, "sensor_velocity": "difference"}
    scenario = ss.scenario("feed_drive", **encoder, actuator_limit=200.0)
    check, *_ = ss.design(scenario, belt_speed=(0.03, 0.03)).checks
    assert check.disturbance == "vibration"
    assert 0.0 < check.rest.amplitude < 5e-6
    assert 0.0 < check.rest.rms_force < check.rest.peak_force
    assert check.settling_time is not None
    assert check.peak_force < 200.0


@pytest.mark.long
def test_a_coarse_actuator_leaves_a_vibration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stickslip_ros.studies.design._ATTEMPTS", 1)
    coarse = ss.scenario("feed_drive", actuator_limit=200.0, actuator_resolution=20.0)
    remark = ss.design(coarse, belt_speed=(0.04, 0.04)).remark
    assert "does not decay to 1 % with the noise and rounding of sensor and actuator" in remark
    monkeypatch.undo()
    check, *_ = designed(belt_speeds=AT_40, force_limit=100.0).checks
    assert check.rest is None
