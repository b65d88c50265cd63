"""Bags of other machines: joints, topics, stamps and forces as their drivers have them."""

import random
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from std_msgs.msg import Float64, Float64MultiArray

import stickslip_ros as ss
from benchmarks.measures_under_noise import motion
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.measures.slips import SlipThreshold
from stickslip_ros.record.bag_layout import BagLayout
from stickslip_ros.record.codec import pack_wrench
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import report_of_recording
from tests.examples import examples
from tests.record.runs import joint_state, write_bag

BELT = 0.04
EPOCH, STEP = 3 * 10**9, 1_000_000
STATES, COMMANDS = "/machine/joint_states", "/machine/commands"
TIME = 1e-3 * np.arange(300)
POSITION, VELOCITY = 0.01 * np.sin(9.0 * TIME), 0.09 * np.cos(9.0 * TIME)


def record(directory: Path, noise: float, *, velocities: bool) -> Path:
    """Record the motion of feed_drive as a joint of another machine tells it."""
    position, velocity, _ = motion(BELT)
    position = position[:2000] + noise * np.random.default_rng(1).standard_normal(2000)
    motions = enumerate(zip(position.tolist(), velocity.tolist(), strict=False))
    write_bag(directory, [axis(i, x, [v] * velocities) for i, (x, v) in motions])
    return directory


@pytest.mark.parametrize(("noise", "velocities"), [(1e-6, False), (0.0, True)])
def test_a_single_joint_is_the_slide(tmp_path: Path, noise: float, velocities: bool) -> None:
    bag = record(tmp_path / "bag", noise, velocities=velocities)
    run = ss.read_bag(bag, belt_speed=BELT, slips=SlipThreshold(1e-4))
    report = run.report
    assert run.measures.regime == report["regime"] == "stick_slip"
    assert (report["samples"], report["complete"]) == (2000, True)
    error = report["errors"]["stick_fraction"]
    assert error < 2e-3
    assert report["stick_fraction"] == pytest.approx(0.1001, abs=3.0 * error if noise else 2e-3)
    assert report["period"] == pytest.approx(0.0639242, rel=1e-5)
    assert (report["position_noise"] is not None) == (noise > 0.0)
    assert report["slips"]["count"] == pytest.approx(2.0 / 0.0639, abs=1)
    with Recording(bag, belt_speed=BELT) as recording:
        whole = recording.joint_states
        pieces = [block.joint_states for block in recording.blocks()]
    joined = pieces[0].followed_by(*pieces[1:])
    assert joined.velocity == pytest.approx(whole.velocity)
    assert np.all(whole.belt_velocity == BELT)
    if not velocities:
        assert whole.velocity[1:] == pytest.approx(np.diff(whole.position) / 1e-3, rel=1e-6)


def state(
    stamp: int,
    names: list[str],
    position: list[float],
    velocity: list[float] | None = None,
    effort: list[float] | None = None,
) -> bytes:
    message = joint_state(stamp, position, velocity or [], effort or [], names)
    return serialize_message(message)


def recorded(number: int) -> int:
    return EPOCH + number * STEP


def axis(
    number: int,
    position: list[float] | float,
    velocity: list[float] | float = 0.0,
    effort: list[float] | None = None,
    *,
    name: str = "axis",
    stamp: int | None = None,
) -> tuple[str, int, bytes]:
    """Return a joint state, one of `number`, of a single joint, as it is recorded."""
    values = [each if isinstance(each, list) else [each] for each in (position, velocity)]
    at = recorded(number) if stamp is None else stamp
    return STATES, recorded(number), state(at, [name], *values, effort)


def test_of_several_joints_one_must_be_chosen(tmp_path: Path) -> None:
    messages = [
        (STATES, recorded(i), state(recorded(i), ["elbow", "axis"], [0.1, x], [0.0, v]))
        for i, (x, v) in enumerate(zip(POSITION.tolist(), VELOCITY.tolist(), strict=True))
    ]
    write_bag(tmp_path / "bag", messages)
    with pytest.raises(BagError, match="are of the joints elbow, axis: --joint NAME must choose"):
        report_of_recording(tmp_path / "bag", belt_speed=BELT)
    with pytest.raises(BagError, match=r"joint = 'wrist' is refused: .* of the joints elbow, axis"):
        ss.read_bag(tmp_path / "bag", joint="wrist")
    run = ss.read_bag(tmp_path / "bag", joint="axis", belt_joint="elbow")
    assert np.array_equal(run.samples.position, POSITION)
    assert np.array_equal(run.samples.velocity, VELOCITY)
    assert not run.samples.belt_velocity.any()


def test_what_the_analyzer_used_holds_beside_other_options(tmp_path: Path) -> None:
    messages = [
        (STATES, at, state(at, ["elbow", "axis"], [0.1, x], [0.0, 1.0], [2.0, 3.0]))
        for at, x in zip(LOG, POSITION.tolist(), strict=True)
    ]
    kept = {"joint": '"axis"', "belt_joint": '"elbow"', "force_type": '"effort"'}
    write_bag(tmp_path / "bag", messages, tables={"stickslip_ros/analyzer": kept})
    for layout, effort in (({}, 3.0), ({"time": "log"}, 3.0), ({"joint": "elbow"}, 2.0)):
        run = ss.read_bag(tmp_path / "bag", **layout)
        assert np.array_equal(run.samples.position == 0.1, [effort == 2.0] * len(TIME))
        assert set(run.forces.force) == {effort}


def test_joints_in_messages_of_their_own_are_several(tmp_path: Path) -> None:
    both = [axis(i, x, name=n) for i, x in enumerate(POSITION.tolist()) for n in ("left", "right")]
    write_bag(tmp_path / "bag", both)
    with pytest.raises(BagError, match="joints left, right: --joint NAME must choose one"):
        report_of_recording(tmp_path / "bag", belt_speed=BELT)
    report = report_of_recording(tmp_path / "bag", belt_speed=BELT, layout=BagLayout(joint="right"))
    assert report["samples"] == len(TIME)
    assert "300 joint states on /machine/joint_states tell nothing of right" in report["notes"][0]


LOG = [recorded(number) for number in range(len(TIME))]


@pytest.mark.parametrize(
    ("stamps", "names", "reason"),
    [
        ([0] * 300, ["axis"], "0, which nobody filled in"),
        ([at * (i % 2) for i, at in enumerate(LOG)], ["axis"], "0, .* in: 150 of 300 are 0"),
        ([at // 10**9 * 10**9 for at in LOG], ["axis"], "of whole seconds"),
        ([at - at % (2 * STEP) for at in LOG], ["axis"], "rounded to 2 ms"),
        (
            [at - at % (2 * STEP) for at in LOG],
            ["slide", "belt"],
            "rounded to 2 ms, or those of several plants",
        ),
    ],
)
def test_stamps_that_stand_are_refused_and_the_log_has_others(
    tmp_path: Path, stamps: list[int], names: list[str], reason: str
) -> None:
    messages = [
        (STATES, log, state(at, names, [x] * len(names), [0.0] * len(names)))
        for log, at, x in zip(LOG, stamps, POSITION.tolist(), strict=True)
    ]
    write_bag(tmp_path / "bag", messages)
    with pytest.raises(BagError, match=f"are {reason}.* --time log takes the times"):
        report_of_recording(tmp_path / "bag")
    with Recording(tmp_path / "bag", layout=BagLayout(time="log")) as recording:
        assert recording.joint_states.stamp.tolist() == LOG
        assert recording.missing == []


def test_of_two_sources_that_take_turns_one_must_be_chosen(tmp_path: Path) -> None:
    messages = []
    for i, x in enumerate(POSITION.tolist()):
        messages += [axis(i, x), axis(i, x + 1, stamp=recorded(i) + 400_000)]
    write_bag(tmp_path / "bag", messages)
    with pytest.raises(BagError, match=r"two sources take turns .* --states-topic .*ates\[1\]'"):
        report_of_recording(tmp_path / "bag")
    for number in (1, 2):
        run = ss.read_bag(tmp_path / "bag", states_topic=f"{STATES}[{number}]")
        assert np.array_equal(run.samples.position, POSITION + (number - 1))


@pytest.mark.parametrize("every", [3, 10, 60])
def test_what_jumps_away_and_back_is_of_another_source(tmp_path: Path, every: int) -> None:
    messages = []
    for i, x in enumerate(POSITION.tolist()):
        messages += [axis(i, x)]
        if i % every == every // 2:
            messages += [axis(i, 5.0, stamp=recorded(i) + 400_000)]
    write_bag(tmp_path / "bag", messages)
    run = ss.read_bag(tmp_path / "bag")
    assert np.array_equal(run.samples.position, POSITION)
    assert f"{300 // every} joint states on {STATES} jump away" in run.report["notes"][0]


def test_joint_states_between_updates_of_the_position_are_left_out(tmp_path: Path) -> None:
    sent = [i for i in range(300) if i % 70]  # of an update that is lost the next one tells
    write_bag(tmp_path / "bag", [axis(i, POSITION[i - i % 5].item(), []) for i in sent])
    run = ss.read_bag(tmp_path / "bag")
    assert np.array_equal(run.samples.position, POSITION[5::5])
    assert run.samples.velocity[1:-1] == pytest.approx(VELOCITY[10:-5:5], abs=0.02)
    assert f"236 joint states on {STATES} lie between updates" in run.report["notes"][0]


def test_a_belt_may_have_messages_of_its_own(tmp_path: Path) -> None:
    messages = []
    for i in range(6):
        messages += [axis(i, 0.1 * i)]
        if i in (2, 4):
            messages += [axis(i, [], 0.1 * i, name="conveyor")]
    write_bag(tmp_path / "bag", messages)
    run = ss.read_bag(tmp_path / "bag", belt_joint="conveyor")
    assert run.samples.belt_velocity.tolist() == [0.2, 0.2, 0.2, 0.2, 0.2, 0.4]


@pytest.mark.parametrize(("every", "left_out"), [(2, 150), (3, 0)])
def test_velocities_that_some_messages_lack(tmp_path: Path, every: int, left_out: int) -> None:
    """Half of them: the other messages are left out. Few: the velocity is of the positions."""
    moves = enumerate(zip(POSITION.tolist(), VELOCITY.tolist(), strict=True))
    messages = [axis(i, x, [v] if i % every == 0 else []) for i, (x, v) in moves]
    write_bag(tmp_path / "bag", messages)
    with Recording(tmp_path / "bag", belt_speed=BELT) as recording:
        block = next(recording.blocks())
        notes = "".join(recording.notes)
    states = block.joint_states
    assert len(states) == len(TIME) - left_out
    assert ("have no velocity and are left out" in notes) == (left_out > 0)
    assert block.velocity_estimated == (left_out == 0)
    assert states.velocity == pytest.approx(VELOCITY[:: 2 if left_out else 1], abs=1e-3)


def test_positions_that_are_not_recorded_are_the_integral_of_the_velocity(tmp_path: Path) -> None:
    messages = [axis(i, [], v) for i, v in enumerate(VELOCITY.tolist())]
    write_bag(tmp_path / "bag", messages, flush_every=70)
    with Recording(tmp_path / "bag") as recording:
        assert recording.joint_states.position == pytest.approx(POSITION, abs=1e-6)
        assert "the position is not recorded" in recording.notes[0]


def command(stamp: int, effort: list[float]) -> bytes:
    return state(stamp, ["wrist", "axis"], [], [], effort)


def array(*values: float) -> bytes:
    return serialize_message(Float64MultiArray(data=values))


@pytest.mark.parametrize(
    ("kind", "topic", "message"),
    [
        ("geometry_msgs/msg/WrenchStamped", COMMANDS, pack_wrench),
        ("std_msgs/msg/Float64", COMMANDS, lambda _, u: serialize_message(Float64(data=u))),
        ("std_msgs/msg/Float64MultiArray", COMMANDS, lambda _, u: array(u)),
        ("std_msgs/msg/Float64MultiArray", f"{COMMANDS}[2]", lambda _, u: array(0.0, u, 1.0)),
        ("sensor_msgs/msg/JointState", COMMANDS, lambda t, u: command(t, [0.5, u])),
        ("sensor_msgs/msg/JointState", COMMANDS, lambda t, u: command(t, [u])),
        ("sensor_msgs/msg/JointState", COMMANDS, lambda _, u: command(0, [u])),
    ],
)
def test_forces_of_any_type(tmp_path: Path, kind: str, topic: str, message) -> None:
    messages = []
    for i in range(5):
        messages += [(STATES, recorded(i), state(recorded(i), ["axis", "wrist"], [0.0, 0.0]))]
        messages += [(COMMANDS, recorded(i), message(recorded(i), 10.0 + i))]
    write_bag(tmp_path / "bag", messages, types={COMMANDS: kind})
    layout = BagLayout("axis", force_topic=topic)
    with Recording(tmp_path / "bag", layout=layout) as recording:
        forces, block = recording.control_forces, next(recording.blocks())
    assert forces.force.tolist() == block.control_forces.force.tolist() == [10, 11, 12, 13, 14]
    assert forces.stamp.tolist() == [recorded(i) for i in range(5)]


def test_the_effort_is_a_force_if_asked_and_no_friction(tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", [axis(i, 0.0, 0.0, [float(i)]) for i in range(5)])
    run = ss.read_bag(tmp_path / "bag", force="effort")
    assert run.forces.force.tolist() == [0, 1, 2, 3, 4]
    assert np.isnan(run.samples.friction_force).all()
    assert len(ss.read_bag(tmp_path / "bag").forces) == 0
    with pytest.raises(
        BagError, match=r"is the friction of our plant: .* --force effort is refused"
    ):
        ss.read_bag("bags/reference", force="effort")


def test_choices_that_a_bag_cannot_meet_are_refused(tmp_path: Path) -> None:
    messages = [axis(0, 0.0, []), (COMMANDS, recorded(0) + 10**10, array(1.0, 2.0))]
    write_bag(tmp_path / "bag", messages, types={COMMANDS: "std_msgs/msg/Float64MultiArray"})
    for options, reason in (
        ({"force": "effort"}, "have no effort of axis: .* --force-topic names"),
        ({"force_topic": "/u"}, "force_topic = '/u' is refused: .* are /machine/commands, /mach"),
        ({"states_topic": COMMANDS}, "states_topic = .* that are sensor_msgs/.*, .* are /mach"),
        ({"force_topic": COMMANDS}, r"has 2 numbers: --force-topic 'NAME\[1\]' takes the first"),
        ({"force": "torque"}, "force = 'torque' is invalid: must be one of topic, effort"),
    ):
        with pytest.raises(InvalidInputError, match=reason):
            ss.read_bag(tmp_path / "bag", **options)


def test_log_times_beside_stamps_of_another_clock_are_refused(tmp_path: Path) -> None:
    number = serialize_message(Float64(data=1.0))
    messages = [axis(i, 0.0, [], stamp=i * STEP + 10) for i in range(3)]
    write_bag(tmp_path / "bag", [(COMMANDS, recorded(0), number), *messages])
    with pytest.raises(BagError, match=r"have no stamps, .* --time log takes the log times"):
        report_of_recording(tmp_path / "bag", layout=BagLayout(force_topic=COMMANDS))
    layout = BagLayout(force_topic=COMMANDS, time="log")
    assert report_of_recording(tmp_path / "bag", layout=layout)["peak_force"] == 1.0


def test_the_joint_of_our_plant_needs_no_option() -> None:
    reference = Path(__file__).parents[2] / "bags" / "reference"
    assert report_of_recording(reference, belt_speed=1.0) == report_of_recording(reference)


def test_on_a_guide_at_rest_the_measures_are_those_of_the_stick_slip(tmp_path: Path) -> None:
    position, velocity, _ = motion(BELT)
    messages = [
        axis(i, 1e-3 * BELT * i - x, BELT - v)
        for i, (x, v) in enumerate(zip(position[:2000].tolist(), velocity.tolist(), strict=False))
    ]
    write_bag(tmp_path / "bag", messages)
    report = report_of_recording(tmp_path / "bag")
    assert report["regime"] == "stick_slip"
    assert report["stick_fraction"] == pytest.approx(0.1001, abs=2e-3)
    assert report["period"] == pytest.approx(0.0639242, rel=1e-4)
    assert "the belt counts as at rest, unless --belt-speed" in report["notes"][0]
    assert "advances at 40 mm/s on a guide at rest" in report["notes"][-1]


def test_a_jump_from_which_the_joint_does_not_come_back_is_said(tmp_path: Path) -> None:
    shifted = POSITION + 0.05 * (TIME >= 0.2)
    write_bag(tmp_path / "bag", [axis(i, x) for i, x in enumerate(shifted.tolist())])
    run = ss.read_bag(tmp_path / "bag")
    assert "the position jumps by 50 mm, 0.2 s after the first sample" in run.report["notes"][0]
    assert np.array_equal(run.samples.position, shifted)


DYNAMIC = (
    "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n"
)
CONTROLLER = "std_msgs/Header header\nstring[] joint_names\n" + "".join(
    f"trajectory_msgs/JointTrajectoryPoint {point}\n"
    for point in ("reference", "feedback", "error")
)


def of_ros2_control(path: Path, kind: str, chance: random.Random | None = None) -> None:
    """Write a bag of a topic of ros2_control, damaged by chance; joint b moves by 1 m/s."""
    store: Any = get_typestore(Stores.ROS2_JAZZY)
    values = {"control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n"}
    definition = DYNAMIC if "Dynamic" in kind else CONTROLLER
    for name, text in (values | {f"control_msgs/msg/{kind}": definition}).items():
        store.register(get_types_from_msg(text, name))
    of = {name.rpartition("/")[2]: each for name, each in store.types.items()}

    def point(*fields: list[float]) -> Any:
        sequences = [np.array(each) for each in (*fields, *[[]] * (4 - len(fields)))]
        return of["JointTrajectoryPoint"](*sequences, of["Duration"](1, 2))

    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/states", f"control_msgs/msg/{kind}", typestore=store)
        for number in range(150):
            stamp, x = recorded(number), number * STEP * 1e-9
            header = of["Header"](of["Time"](*divmod(stamp, 10**9)), "")
            if "Dynamic" in kind:
                interfaces, numbers = ["effort", "velocity", "position"], [7.0, 1.0, x]
                joints = [(["position"], [5.0]), (interfaces, numbers)]
                parts = [[of["InterfaceValue"](names, np.array(each)) for names, each in joints]]
            else:
                feedback = point([5.0, x], [0.0, 1.0], [], [0.0, 7.0])
                parts = [point([8.0, 9.0], [8.0, 3.0]), feedback, point()]
            message = of[kind](header, ["a", "b"], *parts)
            data = bytearray(store.serialize_cdr(message, f"control_msgs/msg/{kind}"))
            if chance:
                data[chance.randrange(len(data))] = chance.randrange(256)
            writer.write(topic, stamp, bytes(data))


KINDS = ("DynamicJointState", "JointTrajectoryControllerState")


@pytest.mark.parametrize("kind", KINDS)
def test_topics_of_ros2_control_are_joint_states(tmp_path: Path, kind: str) -> None:
    of_ros2_control(tmp_path / "bag", kind)
    for topic in (None, "/states"):
        layout = BagLayout(joint="b", states_topic=topic, force="effort")
        with Recording(tmp_path / "bag", layout=layout) as recording:
            states, forces = recording.joint_states, recording.control_forces
            references = recording.references
        assert states.position == pytest.approx(np.arange(150) * STEP * 1e-9)
        if kind != "DynamicJointState":
            assert references.stamp.tolist() == states.stamp.tolist()
            assert ({*references.position}, {*references.velocity}) == ({9.0}, {3.0})
        assert set(states.velocity) == {1.0}
        assert set(forces.force) == {7.0}
    with pytest.raises(BagError, match="are of the joints a, b: --joint NAME must choose one"):
        ss.read_bag(tmp_path / "bag")


@examples(quick=4, thorough=40, deadline=None)
@given(seed=st.integers(0, 2**32), kind=st.sampled_from(KINDS))
def test_damaged_topics_of_ros2_control_are_measured_or_refused(
    tmp_path_factory: pytest.TempPathFactory, seed: int, kind: str
) -> None:
    path = tmp_path_factory.mktemp("machine") / "bag"
    of_ros2_control(path, kind, random.Random(seed))
    with suppress(InvalidInputError):
        report = report_of_recording(path, layout=BagLayout(joint="b"))
        assert report["samples"] <= 150


def machine(chance: random.Random) -> list[tuple[str, int, bytes]]:
    """Return messages of a driver with faults of its own."""
    faults = [fault for fault in range(6) if chance.random() < 0.3]
    messages = []
    for i in range(chance.choice([1, 5, 150, 700])):
        log = recorded(i) + (chance.randrange(STEP) if 0 in faults else 0)
        names = chance.choice([["axis"], ["axis"], ["belt", "axis"], []]) if 1 in faults else ["a"]
        values = [
            [chance.choice([0.01 * i, 1e160, np.nan, -5.0]) if 2 in faults else 0.01 * i]
            * chance.choice([1, len(names), 0] if 3 in faults else [len(names)])
            for _ in range(3)
        ]
        stamp = chance.choice([0, log // 10**9 * 10**9, log]) if 4 in faults else log
        data = state(stamp, names, *values)
        if 5 in faults:
            place = chance.randrange(len(data))
            data = data[:place] + bytes([chance.randrange(256)]) + data[place + 1 :]
        messages.append((STATES, log, data))
    return messages


@examples(quick=15, thorough=80, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    layout=st.builds(
        BagLayout,
        joint=st.sampled_from([None, "axis"]),
        belt_joint=st.sampled_from([None, "belt"]),
        states_topic=st.sampled_from([STATES, f"{STATES}[2]"]),
        time=st.sampled_from(["header", "log"]),
        force=st.sampled_from(["topic", "effort"]),
    ),
)
def test_any_joint_states_are_measured_or_refused(
    tmp_path_factory: pytest.TempPathFactory, seed: int, layout: BagLayout
) -> None:
    messages = machine(random.Random(seed))
    bag = tmp_path_factory.mktemp("machine") / "bag"
    write_bag(bag, messages)
    with suppress(InvalidInputError):
        report = report_of_recording(bag, layout=layout, slips=SlipThreshold(1e-2))
        assert report["samples"] <= len(messages)
