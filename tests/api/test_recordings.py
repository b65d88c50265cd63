"""Recorded runs, and models of recordings, as objects."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.api.recordings import recorded_drive
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.slips import SlipThreshold
from stickslip_ros.record.codec import pack_joint_state
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.recorder import Recorder
from stickslip_ros.record.report import report_of_recording
from tests.record.runs import SECOND, STAMPS, STATES, motion, record, write_bag

REFERENCE = Path(__file__).parents[2] / "bags" / "reference"


@pytest.fixture(scope="module")
def found() -> ss.RecordedRun:
    """The reference bag."""
    return ss.read_bag(str(REFERENCE))


def test_it_has_what_the_bag_has(found: ss.RecordedRun) -> None:
    report = report_of_recording(REFERENCE)
    with Recording(REFERENCE) as recording:
        states, forces = recording.joint_states, recording.control_forces
    assert found.report == report
    assert found.measures.amplitude == report["amplitude"]
    assert found.missing == []
    for name, column in vars(states).items():
        assert np.array_equal(getattr(found.samples, name), column, equal_nan=True)
    assert np.array_equal(found.forces.stamp, forces.stamp)
    assert np.array_equal(found.forces.force, forces.force)
    assert found.drive == ss.scenario("feed_drive").plant.as_drive()


def test_its_table_has_the_columns_of_a_simulated_run(found: ss.RecordedRun) -> None:
    frame = found.to_pandas()
    simulated = ss.simulate("feed_drive", duration=0.1).to_pandas()
    assert list(frame.columns) == [*simulated.columns, "stamp"]
    assert frame.index.name == "time"
    assert frame.index[-1] == 3.0
    assert np.array_equal(frame["position"], found.samples.position)
    answered = frame["control_force"].notna().to_numpy()
    assert np.array_equal(found.samples.stamp[answered], found.forces.stamp)
    assert np.array_equal(frame["control_force"][answered], found.forces.force)
    data = found.to_xarray()
    assert np.array_equal(data["velocity"], found.samples.velocity)
    assert data["stamp"].attrs["units"] == "ns"


def test_the_motion_of_a_motor_is_in_its_table(found: ss.RecordedRun) -> None:
    own = found.samples
    behind = replace(own, motor_position=2.0 * own.position, motor_velocity=2.0 * own.velocity)
    data = replace(found, samples=behind).to_xarray()
    assert np.array_equal(data["motor_velocity"], 2.0 * own.velocity)
    assert data["motor_position"].attrs["units"] == "m"


def test_a_part_is_that_of_the_report() -> None:
    found = ss.read_bag(REFERENCE, start=1.0, end=2.0)
    assert found.report == report_of_recording(REFERENCE, start=1.0, end=2.0)
    assert len(found.samples) == 1000
    assert len(found.forces) == 1000
    with pytest.raises(InvalidInputError, match="is empty"):
        ss.read_bag(REFERENCE, start=2.0, end=1.0)


def test_bags_that_continue_a_run_are_one(tmp_path: Path) -> None:
    bags = [tmp_path / "run", tmp_path / "run_2"]
    for bag, stamps in zip(bags, (STAMPS[:500], STAMPS[600:]), strict=True):
        record(bag, stamps, stamps, tables={"stickslip_ros/analyzer": {"bag_exists": '"next"'}})
    found = ss.read_bag(*bags)
    assert found.samples.stamp.tolist() == STAMPS[:500] + STAMPS[600:]
    assert any("continues the run 1.01 s after" in note for note in found.report["notes"])
    with pytest.raises(InvalidInputError, match=r"run does not continue the run in .*run_2"):
        ss.read_bag(*reversed(bags))


@pytest.mark.parametrize(("name", "drop"), [("paper", "0.001"), ("feed_drive", "1 mm")])
def test_notes_have_the_units_of_the_drive(name: str, drop: str, tmp_path: Path) -> None:
    known = ss.scenario(name).plant.flat() | {"sensor.position_noise": 1.0}
    tables = {"stickslip_ros/plant": {key: json.dumps(value) for key, value in known.items()}}
    noise = np.random.default_rng(1).standard_normal(len(STAMPS))
    positions = motion(np.array(STAMPS) / SECOND)[0] + 0.01 * noise
    states = [
        (STATES, stamp, pack_joint_state(stamp, (x, 0.0), (0.0, 0.04), (0.0, 0.0)))
        for stamp, x in zip(STAMPS, positions.tolist(), strict=True)
    ]
    write_bag(tmp_path / "run", states, tables=tables)
    notes = ss.read_bag(tmp_path / "run", slips=SlipThreshold(1e-3)).report["notes"]
    assert any(note.startswith(f"the least drop of a slip, {drop}, is within") for note in notes)


def test_bad_parameters_or_curves_make_no_drive_nor_does_a_file_of_the_reader(
    tmp_path: Path,
) -> None:
    """The numbers of the file would end up in figures of whoever wrote the bag."""
    own = tmp_path / "own.csv"
    own.write_text("0,0.4\n1,0.3\n")
    table = {"friction.law": '"table"', "friction.file": f'"{own}"'}
    curves = '[[0, 0.4], [0.5, "x"]]', "3", "[[0, 1e999], [1, 1]]", "[[1]]", "["
    everything = ss.scenario("feed_drive").plant.flat()
    given = {name: json.dumps(value) for name, value in everything.items()}
    for number, (parameters, kept) in enumerate(
        [
            (table, {}),
            ({"disturbance.kind": '"table"', "disturbance.file": f'"{own}"'}, {}),
            *(({"mass": mass}, {}) for mass in ("[" * 100_000, "-1", "NaN")),
            *((table, {str(own): curve}) for curve in curves),
        ]
    ):
        bag = tmp_path / f"bag_{number}"
        with Recorder(bag) as recorder:
            recorder.add_metadata("stickslip_ros/plant", given | parameters)
            recorder.add_metadata("stickslip_ros/curves", kept)
        assert recorded_drive(bag) is None


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> ss.Model:
    """Model of a simulated drive, from a table."""
    path = tmp_path_factory.mktemp("logs") / "log.csv"
    drive = ss.scenario("feed_drive", expects_control=False, belt_speed=0.02)
    ss.simulate(drive, duration=1.2).to_pandas().reset_index().to_csv(path, index=False)
    known = {"plant.mass": 100.0, "plant.damping": 200.0, "plant.normal_force": 1000.0}
    return ss.identify(path, law="stribeck", fixed=known)


def test_the_scenario_of_a_model(model: ss.Model, tmp_path: Path) -> None:
    saved = model.save(tmp_path / "drive.yaml")
    assert saved.plant.stiffness == pytest.approx(1e6, rel=1e-6)
    assert ss.stability(saved).closed_loop["stable"] is False  # without gains


def test_a_recording_is_predicted(model: ss.Model, tmp_path: Path) -> None:
    drive = ss.scenario("feed_drive", expects_control=False, belt_speed=0.03)
    path = tmp_path / "other.csv"
    ss.simulate(drive, duration=1.0).to_pandas().reset_index().to_csv(path, index=False)
    error = model.check(path)["free_run_error"]
    assert error < 1e-6
    path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    assert model.check(path, decimal=",", start=0.1)["free_run_error"] == pytest.approx(
        model.check(path, start=0.1)["free_run_error"]
    )
    with pytest.raises(InvalidInputError, match="force = 'torque' is invalid"):
        model.check(path, force="torque")
