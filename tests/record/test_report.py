import pytest

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.record.codec import pack_reference
from stickslip_ros.record.recorder import Recorder
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.samples import Reference
from tests.record.runs import PERIOD, SECOND, STAMPS, STATES, motion, record, state, write_bag


def test_a_bag_with_references_tells_the_following_error_to_the_newest_one(tmp_path):
    states = [(STATES, stamp, state(stamp)) for stamp in STAMPS]
    behind = 0.25
    sent = [
        ("/feed_drive/reference", stamp, pack_reference(stamp, Reference(position + behind)))
        for stamp, position in ((stamp, motion(stamp / SECOND)[0]) for stamp in STAMPS[300:])
    ]
    write_bag(tmp_path / "bag", sorted([*states, *sent], key=lambda message: message[1]))
    report = report_of_recording(tmp_path / "bag")
    assert report["rms_following_error"] == pytest.approx(behind)
    assert report["peak_following_error"] == pytest.approx(behind)
    assert (report["reversals"], report["reversal_height"]) == (7, None)
    part = report_of_recording(tmp_path / "bag", end=3.0)
    assert "rms_following_error" not in part
    write_bag(tmp_path / "late", sorted([*states, *sent[::100]], key=lambda message: message[1]))
    held = report_of_recording(tmp_path / "late")
    position = [motion(stamp / SECOND)[0] for stamp in STAMPS[300:]]
    ahead = [x - position[row // 100 * 100] for row, x in enumerate(position)]
    assert held["peak_following_error"] == pytest.approx(max(abs(behind - x) for x in ahead))


def test_a_run_and_its_parts_are_measured(tmp_path):
    record(tmp_path / "bag")
    report = report_of_recording(tmp_path / "bag")
    assert report["amplitude"] == pytest.approx(3.0, rel=1e-6)
    assert report["frequency"] == pytest.approx(1.0 / PERIOD, rel=1e-6)
    assert (report["samples"], report["lost_samples"]) == (1000, 0)
    assert (report["complete"], report["missing"]) == (True, [])
    part = report_of_recording(tmp_path / "bag", start=2.0, end=7.5)
    assert (part["samples"], part["duration"]) == (550, pytest.approx(5.49))
    assert part["peak_force"] == pytest.approx(5.0 + 7.49)
    for empty in ({"start": 20.0}, {"start": 3.0, "end": 3.0}):
        with pytest.raises(InvalidInputError, match=r"holds no samples from|is empty"):
            report_of_recording(tmp_path / "bag", **empty)


@pytest.mark.parametrize(
    ("late", "missed", "in_time", "note"),
    [
        ("10", "0", True, ""),
        ("617", "3", False, "the regime is doubtful: 62 % of the forces came late"),
        ("10", "500", True, "50 % of the samples missed their deadlines: lower rate"),
    ],
)
def test_late_forces_and_missed_deadlines_are_told(tmp_path, late, missed, in_time, note):
    report = report_of_recording(timed_bag(tmp_path, late, missed))
    assert (report["late_forces"], report["missed_deadlines"]) == (int(late), int(missed))
    assert report["in_time"] is in_time
    assert [said[: len(note)] for said in report["notes"]] == [note] * bool(note)


@pytest.mark.parametrize(
    ("late", "missed"), [("1001", "0"), ("-1", "0"), ("0", "nan"), ("0", "9" * 5000), ("", "0")]
)
def test_of_counts_that_no_plant_has_nothing_is_claimed(tmp_path, late, missed):
    known = ("late_forces", "missed_deadlines", "in_time")
    record(tmp_path / "old")
    for bag in (timed_bag(tmp_path, late, missed), tmp_path / "old"):
        report = report_of_recording(bag)
        assert [report[name] for name in known] == [None] * 3
        assert report["notes"] == []


def timed_bag(tmp_path, late, missed):
    """Return a bag of a plant that counted so many late forces and missed deadlines."""
    counts = {"samples": "1000", "late_forces": late, "missed_deadlines": missed}
    record(tmp_path / "timed", tables={"stickslip_ros/timing": counts})
    return tmp_path / "timed"


def test_forces_ahead_of_the_first_joint_state_are_measured(tmp_path):
    record(tmp_path / "bag", states=STAMPS[500:])
    assert report_of_recording(tmp_path / "bag")["samples"] == 500
    resting = report_of_recording(tmp_path / "bag", end=1.0)
    assert resting["peak_force"] == pytest.approx(5.0 + 5.99)


def test_what_is_lost_is_counted_by_the_stamps(tmp_path):
    record(tmp_path / "bag", states=STAMPS[:300] + STAMPS[307:])
    report = report_of_recording(tmp_path / "bag")
    assert (report["samples"], report["lost_samples"]) == (993, 7)


def test_what_a_bag_does_not_hold_is_not_measured_and_it_is_said(tmp_path):
    record(tmp_path / "forces", states=[])
    report = report_of_recording(tmp_path / "forces")
    assert report["peak_force"] == pytest.approx(14.99)
    assert (report["amplitude"], report["samples"], report["complete"]) == (None, 0, False)
    assert report["missing"] == ["the bag holds no joint states: the motion is unknown"]
    record(tmp_path / "states", forces=[])
    report = report_of_recording(tmp_path / "states")
    assert report["amplitude"] == pytest.approx(3.0, rel=1e-6)
    assert (report["peak_force"], report["complete"], report["notes"]) == (None, True, [])
    expects = {"stickslip_ros/plant": {"expects_control": "true"}}
    record(tmp_path / "controlled", forces=[], tables=expects)
    (note,) = report_of_recording(tmp_path / "controlled")["notes"]
    assert note.startswith("the plant expects control, and no control force was recorded")


def test_a_bag_of_nothing_of_ours_is_refused_with_its_topics(tmp_path):
    write_bag(tmp_path / "bag", [("/a/temperature", 1, bytes(12))])
    with pytest.raises(BagError, match=r"no joint_states and no control_force .*/a/temperature"):
        report_of_recording(tmp_path / "bag")
    with pytest.raises(BagError, match="in /b that can be read"):
        report_of_recording(tmp_path / "bag", namespace="/b")


def test_a_growing_bag_is_measured_as_far_as_it_goes(tmp_path):
    with Recorder(tmp_path / "bag") as recorder:
        channel = recorder.add_topic(STATES, "sensor_msgs/msg/JointState", 1)
        for count, stamp in enumerate(STAMPS, 1):
            recorder.write(channel, state(stamp), stamp)
            if count in (400, 800):
                recorder.flush()
                report = report_of_recording(tmp_path / "bag")
                assert report["samples"] == count
                assert not report["complete"]
                assert any("still running" in sentence for sentence in report["missing"])
    assert report_of_recording(tmp_path / "bag")["complete"]
