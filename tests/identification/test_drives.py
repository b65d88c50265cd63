"""Drives on a spring: the constants of noisy runs come out within their intervals.

docs/identification.md has a table of more seeds.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

import stickslip_ros as ss
from benchmarks import identification as study
from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.even_clock import evenly_spaced
from stickslip_ros.identification.filtered import filtered
from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.fit import OUT_OF_TIME
from stickslip_ros.identification.identified_law import LAG
from stickslip_ros.identification.identify import identify
from stickslip_ros.identification.laws import KNOWN_LAWS
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.refinement import repetition_of
from stickslip_ros.identification.sentences import notes, unidentified
from stickslip_ros.identification.time_limit import TimeLimit
from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Directional, FrictionLaw, Table
from stickslip_ros.model.signals import table
from stickslip_ros.motion import Motion
from stickslip_ros.show.identification_table import identification_tables
from tests.identification.axis_record import record as axis_record

_FAR = 4.5
"""Standard errors that an estimate is away at most: five constants of some records, all right."""


@pytest.fixture(scope="module")
def stick() -> Findings:
    """Stick-slip on a belt of one speed, of which the mass is known."""
    fixed = {"normal_force": study.NORMAL_FORCE, "mass": study.MASS}
    return identify([study.record("stribeck", "stick", seed=7, duration=2.5)], "stribeck", fixed)


def check_errors(found: Findings, true: Mapping[str, float], *names: str) -> None:
    """Check that constants, or those of some names, are within their errors."""
    assert found.fitted
    for name in names or found.fitted:
        each = found.fitted[name]
        assert abs(each.value - true[name]) < _FAR * each.standard_error, name


def check_constants(found: Findings, true: Mapping[str, float]) -> None:
    """Check that constants are within their errors, and that these are small."""
    check_errors(found, true)
    for name, each in found.fitted.items():
        assert each.standard_error < 0.05 * max(abs(true[name]), 1e-3), name
    assert notes(found) == []


def test_a_search_ends_with_the_best_so_far() -> None:
    """The law with the best regression is fitted in any case."""
    own = study.record("stribeck", "stick", seed=7, duration=1.0)
    fixed = {"normal_force": study.NORMAL_FORCE, "mass": study.MASS}
    found = identify([own], fixed=fixed, time_limit=1e-3)
    assert found.law == "stribeck"
    assert {"stribeck", "exponential", "stiction", "table", "coulomb"} <= {*found.left}
    assert found.candidates[0].remark == OUT_OF_TIME
    assert {estimate.standard_error for estimate in found.fitted.values()} == {inf}
    assert "limit of work" in unidentified(found)["stiffness"]


def test_time_passes_with_work_alone() -> None:
    limit = TimeLimit(10.0)
    limit.begin_stage(0.5)
    limit.begin_part(0.5)
    limit.spend(2.0)
    assert not limit.is_over
    limit.spend(1.0)
    assert limit.is_over
    limit.begin_part(1.0)
    assert not limit.is_over
    limit.spend(2.0)
    assert limit.is_over


@pytest.mark.parametrize(
    ("law", "delay", "lag"),
    [
        ("coulomb", 2e-3, 0.0),
        pytest.param("stribeck", 0.0, 3e-3, marks=pytest.mark.long),
        pytest.param("stribeck", 1.4e-3, 1e-3, marks=pytest.mark.long),
    ],
)
def test_a_force_that_is_late(law: str, delay: float, lag: float) -> None:
    """Errors without that scatter so much that hardly any constant seems to be needed."""
    own = study.record(law, "taps", 1, 1.0, delay, lag)
    found = identify([own], law, {"normal_force": study.NORMAL_FORCE})
    true = study.truth(law, "taps") | {"force_delay": delay, LAG: lag}
    check_errors(found, true)
    assert found.fitted["mass"].standard_error < 0.002 * study.MASS
    assert (found.chosen.delay > 0.0) == (delay > 0.0)
    assert (LAG in found.fitted) == (lag > 0.0)


def test_a_disturbance_is_not_late() -> None:
    own = study.record("coulomb", "taps", 1, 0.5)
    drive = Drive(study.MASS, 0.0, study.STIFFNESS, 1000.0, 0.0, study.LAWS["coulomb"])
    shifted = replace(own, force=np.concatenate([np.zeros(2), own.force[:-2]]))
    late, known = (
        next(Predictor(each).followed(drive, [slice(0, 500)], np.zeros((1, 2)), delay))[0]
        for each, delay in ((own, 2.0 * study.PERIOD), (shifted, 0.0))
    )
    assert np.ptp(known) > 1e-5
    assert late == pytest.approx(known, abs=1e-12)


@pytest.mark.parametrize("lag", [5e-4, 5e-3])
def test_a_force_that_lags_moves_the_slide_as_that_of_its_actuator(lag: float) -> None:
    """Positions of a slide that slips differ by less than a thousandth of an encoder's step."""
    force = 100.0 * np.random.default_rng(0).choice([-1.0, 1.0], 300)
    law = study.LAWS["coulomb"]
    drive = Drive(study.MASS, 200.0, study.STIFFNESS, study.NORMAL_FORCE, 0.1, law)
    motion = Motion(replace(drive, actuator=Actuator(time_constant=lag)), 0.0, 0.0)
    position = np.empty(len(force))
    for number, each in enumerate(force.tolist()):
        position[number] = motion.position
        motion.set_forces(each, 0.0)
        motion.advance(study.PERIOD)
    record = Record("late", study.PERIOD, position, np.full(len(force), 0.1), force)
    whole = [slice(0, len(force))]
    found, _ = next(Predictor(record).lagging(lag).followed(drive, whole, np.zeros((1, 2)), 0.0))
    assert np.ptp(position) > 1e-4
    assert found == pytest.approx(position, abs=1e-3 * study.RESOLUTION)


@pytest.mark.long
def test_static_above_kinetic_friction_is_recovered() -> None:
    """A slide that never sticks tells no static friction."""
    fixed = {"normal_force": study.NORMAL_FORCE, "mass": study.MASS}
    found, moving = (
        identify([study.record("stiction", kind, 1, 2.0)], "stiction", fixed)
        for kind in ("ramp", "stick")
    )
    true = study.truth("stiction", "ramp")
    check_errors(found, true)
    assert found.fitted["friction.static"].standard_error < 1e-3
    assert "fit alike" in unidentified(moving)["friction.static"]


@pytest.mark.long
@pytest.mark.parametrize("exponent", [1.5, 2.0])
def test_the_exponent_of_a_decay(exponent: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 1 and 2 the better one is taken; others are fitted."""
    law = replace(study.LAWS["exponential"], exponent=exponent)
    monkeypatch.setitem(study.LAWS, "exponential", law)
    known = {"normal_force": study.NORMAL_FORCE, "mass": study.MASS}
    found = identify([study.record("exponential", "ramp", 0, 1.5)], "exponential", known)
    assert found.drive.friction.exponent == pytest.approx(exponent, abs=0.1)
    assert ("friction.exponent" in found.fitted) == (exponent == 1.5)
    check_errors(found, study.truth("exponential", "ramp"))


def test_what_stick_slip_at_one_belt_speed_tells(stick: Findings) -> None:
    """A slide on a belt that moves forward slips backward."""
    check_constants(stick, study.truth("stribeck", "stick"))
    assert "several belt speeds" in unidentified(stick)["damping"]
    assert "both directions" in unidentified(stick)["bias_force"]
    assert stick.chosen.directions == [-1.0]


def test_rows_near_sticking_are_not_those_of_measured_friction(stick: Findings) -> None:
    columns = filtered(stick.records[0], decimated=False)
    assert 50 < np.count_nonzero(columns.settled) < np.count_nonzero(columns.slipping)
    errors = stick.chosen.errors(stick.records[0])
    law = study.LAWS["stribeck"]
    true = study.NORMAL_FORCE * np.array(
        [float(law.coefficient(each, np.sign(each))) for each in errors.relative_speed.tolist()]
    )
    assert np.quantile(np.abs(-errors.friction - true), 0.9) < 8.0


def test_on_a_belt_that_moves_backward_the_slide_slips_forward() -> None:
    own = study.record("stribeck", "stick", 1, 2.5)
    back = replace(own, position=-own.position, belt_velocity=-own.belt_velocity)
    late = replace(back, belt_velocity=np.where(np.arange(2500) < 5, 0.0, back.belt_velocity))
    found = identify([late], "stribeck", {"mass": 100.0})
    assert found.chosen.directions == [1.0]
    assert found.drive.belt_speed == float(back.belt_velocity[-1])


def test_the_model_predicts_a_record_that_it_was_not_fitted_to(stick: Findings) -> None:
    error = stick.check(study.record("stribeck", "stick", 2, 2.5))["free_run_error"]
    assert error < 2e-6


def test_records_that_no_drive_has_made_are_noted() -> None:
    """Positions in mm, and a belt whose velocity is missing."""
    own = study.record("stribeck", "stick", 1, 2.0)
    wrong = replace(own, position=1e3 * own.position, belt_velocity=0.0 * own.belt_velocity)
    found = identify([wrong], "coulomb", fixed={"mass": 100.0, "stiffness": 1e6})
    assert "does not describe the recordings" in notes(found)[0]
    assert "check the units of time" in notes(found)[-1]


def test_what_no_motion_depends_on_is_not_told() -> None:
    """With a mass that is far too large every predicted motion is out of bounds."""
    own = study.record("stribeck", "stick", 1, 2.0)
    found = identify([own], "coulomb", {"mass": 1e5})
    assert np.isinf(found.fitted["stiffness"].standard_error)
    assert "one of many values that fit alike" in unidentified(found)["stiffness"]
    tables = identification_tables(found, found.check(own), [], notes(found))
    shown = "\n".join(str([*each.rows]) for each in tables if not isinstance(each, str))
    assert "unbounded" in shown
    assert "inf" not in shown


@pytest.mark.long
def test_sticking_that_the_filter_blurs_is_seen() -> None:
    """At 150 Hz the filter passes 15 Hz, as much as the vibration has."""
    scenario = ss.scenario("feed_drive", controller=None, rate=150.0)
    for belt_speed, stuck in ((0.04, True), (0.046, False)):
        run = ss.simulate(ss.scenario(scenario, belt_speed=belt_speed), duration=3.0)
        assert (run.measures.stick_fraction > 0.0) is stuck
        position = run.to_pandas()["position"].to_numpy()
        own = Record("log", 1.0 / 150.0, position, np.full(len(position), belt_speed))
        found = identify([own], "stribeck", {"mass": 100.0})
        assert ("friction.static" in unidentified(found)) is not stuck


def test_a_missing_input_is_noted() -> None:
    own = study.record("coulomb", "ramp", 1, 1.0)
    half = replace(own, disturbance=np.where(np.arange(1000) < 500, own.disturbance, 0.0))
    assert "an input may be missing" in notes(identify([half], "coulomb"))[0]


def test_what_is_refused() -> None:
    sticking, own = study.record("stribeck", "stick", 1, 2.0), study.record("coulomb", "ramp", 1)
    wrong = replace(own, force=-own.force, disturbance=-own.disturbance)
    static, kinetic = {"friction.static": 400.0}, {"friction.kinetic": 250.0}
    for record, law, fixed, message in (
        (sticking, "stribeck", {}, r"--fix plant\.mass"),
        (wrong, "stribeck", {}, r"comes out as 0.* sign"),
        (sticking, "exponential", static, r"only plant\.friction\.kinetic"),
        (sticking, "auto", kinetic, "with the law auto"),
        (axis_record("coulomb"), "maxwell_slip", {}, "without a spring"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            identify([record], law, fixed)


@pytest.mark.long
def test_friction_without_a_law() -> None:
    found = identify([study.record("stribeck", "ramp", 3, 1.0)], "table")  # nor a normal force
    assert {"mass", "stiffness"} <= found.fitted.keys()
    curve = found.curves[0]
    law = study.LAWS["stribeck"]
    true = [-study.NORMAL_FORCE * float(law.coefficient(w, 1.0)) for w in curve.speed.tolist()]
    recorded = curve.speed < 0.8 * curve.speed.max()
    assert curve.force[recorded] == pytest.approx(np.array(true)[recorded], abs=4.0)
    assert (curve.standard_error > 0.0).all()
    assert isinstance(found.drive.friction, Table)


def test_friction_by_direction() -> None:
    law = Directional(Coulomb(static=0.25, viscous=0.6), Coulomb(static=0.35, viscous=0.9))
    found = identify([reversing(law)], "coulomb", {"normal_force": 1000.0, "damping": 0.0})
    assert [each.label for each in found.candidates] == ["coulomb", "coulomb by direction"]
    assert found.chosen.by_direction
    assert found.chosen.directions == [1.0, -1.0]
    assert "by direction" in unidentified(found)["bias_force"]
    for number, (group, each) in enumerate(
        (("friction.", law.forward), ("friction.reverse.", law.reverse))
    ):
        true = {group + name: getattr(each, name) for name in ("static", "viscous")}
        check_errors(found, true, *true)
        curve = found.curves[number]
        force = 1000.0 * (each.static + each.viscous * curve.speed)
        assert curve.force == pytest.approx(force, rel=0.01)
        assert (curve.standard_error > 0.0).all()


def test_friction_that_is_alike_in_both_directions_has_one_law() -> None:
    alike = identify([reversing(Coulomb(static=0.3, viscous=0.8))], "coulomb", {"damping": 0.0})
    assert not alike.chosen.by_direction
    assert "bias_force" not in unidentified(alike)


def reversing(law: FrictionLaw) -> Record:
    """Return a run on a belt that moves to and fro, with taps."""
    random = np.random.default_rng(5)
    times = np.arange(0.0, 1.51, 0.25)
    speeds = 0.03 * (-1.0) ** np.arange(len(times))
    belt = table(list(zip(times.tolist(), speeds.tolist(), strict=True)))
    drive = Drive(100.0, 0.0, 1e6, 1000.0, 0.0, law, belt=belt)
    force, position, _ = tapped(drive, 1500, 150, 1e-6, random)
    return Record(
        "to and fro", 1e-3, position, np.interp(1e-3 * np.arange(1500), times, speeds), force
    )


def tapped(
    drive: Drive, count: int, every: int, resolution: float, random: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the forces of taps, and positions and velocities of a drive under them, at 1 kHz."""
    motion = Motion(drive, 1e-4, 0.0)
    force, position, velocity = np.zeros(count), np.empty(count), np.empty(count)
    for number in range(0, count, every):
        force[number : number + 20] = random.uniform(-150.0, 150.0)
    for number in range(count):
        position[number] = round(motion.position / resolution) * resolution
        velocity[number] = motion.velocity + 1e-4 * random.normal()
        motion.force = float(force[number])
        motion.advance(1e-3)
    return force, position, velocity


def test_a_measured_velocity_tells_more() -> None:
    drive = Drive(100.0, 0.0, 1e6, 1000.0, 0.03, study.LAWS["coulomb"])
    force, position, velocity = tapped(drive, 3000, 200, 5e-6, np.random.default_rng(2))
    without = Record("log", 1e-3, position, np.full(3000, 0.03), force)
    fits = [
        identify([each], "coulomb", {"normal_force": 1000.0})
        for each in (without, replace(without, velocity=velocity))
    ]
    errors = [each.fitted["friction.static"].standard_error for each in fits]
    assert errors[1] < 0.8 * errors[0]
    for found in fits:
        check_errors(found, {"friction.static": study.LAWS["coulomb"].static}, "friction.static")


@pytest.mark.long
def test_laws_that_the_record_cannot_tell_apart_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    two = [KNOWN_LAWS["stribeck"], KNOWN_LAWS["exponential"]]
    monkeypatch.setattr("stickslip_ros.identification.identify.COMPETING", two)
    found = identify([study.record("stribeck", "narrow", 1, 1.2)], fixed={"normal_force": 1000.0})
    alike = "stribeck and exponential predict held-out parts alike"
    assert alike in unidentified(found)["friction.law"]
    assert "run with relative speeds from rest" in unidentified(found)["friction.law"]


def test_errors_that_repeat_are_noted() -> None:
    """A cycle of a whole number of samples: rounding is the same in each."""
    phase = np.arange(2000) / 50.0 * 2.0 * np.pi
    random = np.random.default_rng(0)
    assert repetition_of(np.sin(phase) + 0.1 * random.normal(size=2000)) == 50
    assert repetition_of(random.normal(size=2000)) is None
    assert repetition_of(np.arange(2000.0)) is None
    smooth = np.convolve(random.normal(size=20_000), np.ones(150), "valid")
    near = np.correlate(smooth[:-20], smooth[20:])[0] / np.sum(smooth**2)
    assert near > 0.8
    assert repetition_of(smooth) is None  # coloured only


def test_only_errors_of_positions_are_compared() -> None:
    own = study.record("coulomb", "ramp", 1, 2.0)
    velocity = np.gradient(own.position, own.period)
    velocity += 1e-3 * np.random.default_rng(0).normal(size=len(velocity))
    best = identify([replace(own, velocity=velocity)], "coulomb").chosen
    assert 2 * np.count_nonzero(best.task.of_positions) == len(best.residual)
    positions = own.position[best.task.segments[0].samples]
    assert (best.task.positions[: len(positions)] == positions).all()


def test_missing_samples_are_not_measured() -> None:
    own = study.record("stribeck", "stick", 2, 2.5)
    position = own.position.copy()
    position[::3] = np.nan
    stamp = np.rint(1e9 * own.period * np.arange(len(position))).astype(np.int64)
    columns = {"position": position, "belt_velocity": own.belt_velocity}
    found = identify(evenly_spaced("log", stamp, columns), "stribeck", {"mass": study.MASS})
    assert "33 % of the samples of log are missing" in notes(found)[0]
    true = study.truth("stribeck", "stick")
    check_errors(found, true, "stiffness", "friction.minimum_speed")


@pytest.mark.long
def test_long_recordings_are_used_in_parts() -> None:
    own = study.record("coulomb", "taps", 1, duration=32.0)
    found = identify([own], "coulomb", {"normal_force": study.NORMAL_FORCE})
    assert "of the samples were used" in notes(found)[0]
    assert found.fitted["mass"].value == pytest.approx(study.MASS, rel=1e-3)


_STUDY = json.loads(
    (Path(study.__file__).parent / "identification.json").read_text(encoding="utf-8")
)


def test_the_study_of_100_seeds() -> None:
    for case in _STUDY["cases"]:
        assert case["seeds"] >= study.SEEDS
        if case["kind"] == "narrow":
            assert case["told"] <= 0.15
            continue
        assert case["right"] >= 0.95
        assert case["told"] >= 0.9
        for name, each in case["constants"].items():
            assert 0.88 <= each["covered"] <= 1.0, (case["law"], case["kind"], name)
            assert abs(each["bias"]) < each["standard_error"], (case["law"], case["kind"], name)


@pytest.mark.long
def test_bristles_are_told_and_their_constants_recovered() -> None:
    found = identify(
        [study.record("lugre", "taps", 0, 0.6)], fixed={"normal_force": study.NORMAL_FORCE}
    )
    assert found.law == "lugre"
    assert "friction.law" not in unidentified(found)
    assert "friction.bristle_stiffness" in found.fitted
    true = study.truth("lugre", "taps")
    check_errors(found, true)


@pytest.mark.long
def test_several_records_tell_more_than_one() -> None:
    records = [study.record("exponential", "ramp", seed, duration=2.0) for seed in (1, 2)]
    one, both = identify(records[:1], "exponential"), identify(records, "exponential")
    assert both.fitted["mass"].standard_error < one.fitted["mass"].standard_error
