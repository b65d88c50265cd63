import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from geometry_msgs.msg import WrenchStamped
from PIL import Image
from rclpy.node import Node
from sensor_msgs.msg import JointState

from stickslip_ros.app.main import main
from stickslip_ros.bags.recorder import QosProfile, Recorder
from stickslip_ros.messages.codec import pack_joint_state
from stickslip_ros.testing import ClosedLoop
from tests.bags.runs import STAMPS, STATES, motion, record

REFERENCE = Path(__file__).parents[2] / "bags" / "reference"


@pytest.fixture
def command(capsys):
    """Call the entry script in this process; return exit status, output and error output."""

    def call(*arguments):
        with pytest.raises(SystemExit) as exit_:
            main([str(argument) for argument in arguments])
        return exit_.value.code, *capsys.readouterr()

    return call


def test_two_runs_are_set_side_by_side(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record(tmp_path / "first")
    record(tmp_path / "second", states=STAMPS[:500])
    bags = "first", "second"
    status, out, _ = command("report", *bags)
    assert status == 0
    assert out.index("first") < out.index("second")
    row = next(line for line in out.splitlines() if "samples" in line)
    assert row.split()[-2:] == ["1000", "500"]
    status, out, _ = command("report", *bags, "--json", "--from", "1", "--to", "4")
    reports = json.loads(out)["reports"]
    assert [report["bag"] for report in reports] == ["first", "second"]
    assert [report["samples"] for report in reports] == [300, 300]


def test_what_is_missing_is_said(command, tmp_path):
    record(tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    status, out, _ = command("report", tmp_path / "bag")
    assert status == 0
    assert out.splitlines()[-1].startswith("metadata.yaml is missing")


def test_a_damaged_bag_is_repaired(command, tmp_path):
    record(tmp_path / "bag")
    file = tmp_path / "bag" / "bag_0.mcap"
    cut = file.read_bytes()[:-3000]
    file.write_bytes(cut)
    before = json.loads(command("report", tmp_path / "bag", "--json")[1])
    status, out, _ = command("repair", tmp_path / "bag", tmp_path / "sound")
    assert status == 0
    assert "is incomplete: " in out
    after = json.loads(command("report", tmp_path / "sound", "--json")[1])
    assert not before["complete"]
    assert after["complete"]
    same = before.keys() - {"complete", "missing", "bag"}
    assert {key: after[key] for key in same} == {key: before[key] for key in same}
    assert file.read_bytes() == cut
    status, out, _ = command("repair", tmp_path / "sound", tmp_path / "again", "--json")
    assert json.loads(out)["missing"] == []


def texts(picture):
    return [element.text for element in ElementTree.parse(picture).iter() if element.text]


def test_a_picture_changes_nothing_of_the_report(command, tmp_path):
    plain = json.loads(command("report", REFERENCE, "--json")[1])
    picture = tmp_path / "run.svg"
    status, out, error = command("report", REFERENCE, "--plot", picture, "--json")
    assert (status, error) == (0, "")
    assert json.loads(out) == plain
    shown = texts(picture)
    assert "amplitude (µm)" in shown
    assert any("stick-slip, not steady: decaying, amplitude 325.8 µm" in text for text in shown)
    for bag_lacks in ("the drive is not known", "no cycle was completed"):
        assert bag_lacks not in shown


def test_a_picture_is_of_the_part_that_is_measured(command, tmp_path):
    picture = tmp_path / "run.svg"
    part = ("--from", "1", "--to", "1.02")
    command("report", REFERENCE, *part, "--plot", picture)
    assert "no cycle was completed" in texts(picture)
    assert "1.01" in texts(picture)


def test_a_part_without_a_cycle_says_so(command):
    out = command("report", REFERENCE, "--to", "0.05")[1]
    assert "no whole cycle was completed in 0.049 s: the natural period is 62.83 ms" in out


def test_a_picture_says_what_a_bag_lacks(command, tmp_path):
    record(tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    picture = tmp_path / "run.svg"
    assert command("report", tmp_path / "bag", "--plot", picture)[0] == 0
    shown = texts(picture)
    assert any(text.startswith("metadata.yaml is missing") for text in shown)
    assert "it is not recorded what drive it was: no equilibrium, no friction law" in shown


@pytest.mark.parametrize(
    "parameters",
    [
        pytest.param({}, marks=pytest.mark.long),
        pytest.param({"mass": "100.0"}, marks=pytest.mark.long),
        {"mass": "[" * 100_000},
        pytest.param({"mass": '"heavy"', "friction.law": '"none"'}, marks=pytest.mark.long),
        {"mass": "-1", "belt_speed": "NaN"},
    ],
)
def test_parameters_that_are_none_are_no_drive(command, tmp_path, parameters):
    with Recorder(tmp_path / "bag") as recorder:
        channel = recorder.add_topic(STATES, "sensor_msgs/msg/JointState", QosProfile(depth=10))
        recorder.add_metadata("stickslip_ros/plant", parameters)
        for stamp in STAMPS[:100]:
            position, velocity = motion(stamp / 1e9)
            values = (position, 0.0), (velocity, 20.0), (0.0, 0.0)
            recorder.write(channel, pack_joint_state(stamp, *values), stamp)
    picture = tmp_path / "run.svg"
    assert command("report", tmp_path / "bag", "--plot", picture)[0] == 0
    assert "the drive is not known" in texts(picture)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["report", *"abcdefg", "--plot", "out.png"], "draws at most 6 bags, and 7 were given"),
        (["report", "bag", "--plot", "out.gif"], "must end in one of .png, .svg, .pdf"),
        (["report", "bag", "--plot", "none/out.png"], "there is no directory none"),
        (["report", "empty", "--plot", "out.png"], "holds no .mcap file"),
        (["report", "nothing"], "the bag nothing does not exist"),
        (["report", "bag", "--namespace", "/other"], "no joint_states and no control_force in"),
        (["report", "bag", "--from", "50"], "bag holds no samples from 50 s on"),
        (["report", "bag", "--from", "1e300"], "from 1e+300 s on"),
        (["report", "bag", "--from", "-1"], "'-1' is not a time in seconds"),
        (["report", "text"], "not an MCAP file"),
        (["repair", "bag"], "OUT"),
        (["repair", "bag", "bag"], "exists already"),
        (["repair", "bag", "bag/inside"], "would lie within bag"),
        (["repair", "text", "out"], "not an MCAP file"),
        (["repair", "empty", "out"], "holds no .mcap file"),
        (["repair", "bag", "text/out"], "not a directory"),
    ],
)
def test_invalid_input_is_refused_in_a_line(command, tmp_path, monkeypatch, arguments, complaint):
    monkeypatch.chdir(tmp_path)
    record(tmp_path / "bag")
    (tmp_path / "text").write_text("these are not the bytes of a bag")
    (tmp_path / "empty").mkdir()
    status, out, error = command(*arguments)
    assert (status, out) == (2, "")
    assert complaint in error.splitlines()[-1]
    assert not list(tmp_path.glob("out*"))


def test_a_run_that_has_come_to_rest_does_not_read_as_a_regime(command):
    _, out, _ = command("report", REFERENCE)
    assert "stick-slip, not steady: decaying\n" in out
    found = json.loads(command("report", REFERENCE, "--json")[1])
    assert (found["steady"], found["trend"]) == (False, "decaying")


class Refused(Node):
    """Answers each state with 128.6 N that no plant takes."""

    force, shift = 128.6, 1

    def __init__(self):
        super().__init__("refused")
        self.publisher = self.create_publisher(WrenchStamped, "control_force", 1000)
        self.create_subscription(JointState, "joint_states", self.answer, 10)

    def answer(self, state):
        message = WrenchStamped(header=state.header)
        message.header.stamp.nanosec += self.shift
        message.wrench.force.x = self.force
        self.publisher.publish(message)


class NotFinite(Refused):
    """Answers each state with a force that is not finite."""

    force, shift = float("inf"), 0


def recorded(bag, controller, pace="lockstep"):
    overrides = ("plant.reply_timeout=0.1", f"plant.pace={pace}")
    with ClosedLoop("feed_drive", *overrides, controller=controller, bag=bag) as loop:
        return loop.run(0.5)


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
def test_of_forces_that_were_all_refused_none_acted(command, tmp_path, pace):
    result = recorded(tmp_path / "bag", Refused, pace)
    assert (result.peak_force, result.peak_applied_force) == (128.6, 0.0)
    assert len(result.dropped_forces.stamp) == len(result.forces.stamp) > 1
    report = json.loads(command("report", tmp_path / "bag", "--json")[1])
    assert (report["peak_force"], report["resting_force"]) == (128.6, 128.6)
    assert (report["peak_applied_force"], report["resting_applied_force"]) == (0.0, 0.0)
    assert report["dropped_forces"] == len(result.forces.stamp)
    rows = [line.rsplit("  ", 1) for line in command("report", tmp_path / "bag")[1].splitlines()]
    figures = {row[0].strip(): row[-1].strip() for row in rows}
    assert figures["peak control force sent"] == "128.6 N"
    assert figures["peak control force acting"] == "0 N"
    assert figures["final control force acting"] == "0 N"
    assert figures["dropped forces"] == str(report["dropped_forces"])


def test_of_forces_that_are_not_finite_none_acted(command, tmp_path):
    recorded(tmp_path / "bag", NotFinite)
    report = json.loads(command("report", tmp_path / "bag", "--json")[1])
    assert (report["peak_force"], report["peak_applied_force"]) == (None, 0.0)


def test_forces_that_all_acted_are_reported_once(command, tmp_path):
    recorded(tmp_path / "bag", "washout")
    report = json.loads(command("report", tmp_path / "bag", "--json")[1])
    assert report["peak_applied_force"] == report["peak_force"] is not None
    assert report["resting_applied_force"] == report["resting_force"]
    assert report["dropped_forces"] == 0
    rows = command("report", tmp_path / "bag")[1].splitlines()
    assert [row.split("  ")[0] for row in rows if "control force" in row] == [
        "peak control force",
        "final control force",
    ]


def test_a_bag_that_does_not_tell_what_was_dropped_claims_nothing_of_what_acted(command):
    report = json.loads(command("report", REFERENCE, "--json")[1])
    assert report["peak_force"] == pytest.approx(114.87062132727189)
    for name in ("peak_applied_force", "resting_applied_force", "dropped_forces"):
        assert report[name] is None
    rows = command("report", REFERENCE)[1].splitlines()
    assert [row.split("  ")[0] for row in rows if "control force" in row] == [
        "peak control force",
        "final control force",
    ]


def test_several_bags_are_drawn_in_one_figure(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record(tmp_path / "first")
    record(tmp_path / "second", states=STAMPS[:500])
    plain = command("report", "first", "second", "--json")[1]
    status, out, error = command("report", "first", "second", "--json", "--plot", "runs.svg")
    assert (status, out, error) == (0, plain, "")
    shown = texts(tmp_path / "runs.svg")
    assert "Runs compared, first; second" in shown
    assert shown.count("first") >= 2  # above its column, and in the legend


@pytest.mark.parametrize(
    ("options", "width", "height"),
    [
        ((), 1560, 1300),
        (("--size", "10x8"), 1300, 1040),
        (("--size", "10x8", "--dpi", "50"), 500, 400),
        (("--style", "paper-double"), 2125, 2338),
        (("--style", "paper-double", "--size", "8x9", "--dpi", "100"), 800, 900),
    ],
)
def test_a_figure_has_the_size_that_is_asked_for(command, tmp_path, options, width, height):
    picture = tmp_path / "run.png"
    assert command("report", REFERENCE, "--plot", picture, *options)[0] == 0
    with Image.open(picture) as image:
        assert image.size == (width, height)


def test_a_figure_has_no_title_if_none_is_wanted(command, tmp_path):
    picture = tmp_path / "run.svg"
    command("report", REFERENCE, "--plot", picture)
    assert str(REFERENCE) in " ".join(texts(picture))
    command("report", REFERENCE, "--plot", picture, "--no-title")
    assert "stick-slip" not in " ".join(texts(picture))


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (("--size", "6"), "'6' is not WIDTHxHEIGHT in inches, each from 2 to 50"),
        (("--size", "0x4"), "'0x4' is not"),
        (("--size", "nanx4"), "'nanx4' is not"),
        (("--size", "6x4x2"), "'6x4x2' is not"),
        (("--size", "2x2"), "--size 2x2: is too small for this figure"),
        (("--dpi", "0"), "'0' is not a whole number of dots per inch from 20 to 600"),
        (("--dpi", "1e3"), "'1e3' is not"),
        (("--size", "50x50", "--dpi", "600"), "--size 50x50 --dpi 600: would be 9e+08 pixels"),
    ],
)
def test_a_figure_that_is_nonsense_is_refused(command, tmp_path, options, complaint):
    status, out, error = command("report", REFERENCE, "--plot", tmp_path / "run.png", *options)
    assert (status, out) == (2, "")
    assert complaint in error.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "options", [("--size", "6x4"), ("--dpi", "100"), ("--style", "paper"), ("--no-title",)]
)
@pytest.mark.parametrize(
    "arguments",
    [
        ("simulate", "paper"),
        ("report", REFERENCE),
        ("stability", "paper"),
        ("design", "paper"),
        ("basin", "paper"),
        ("sweep", "paper", "--over", "plant.mass=1:2:2"),
    ],
)
def test_options_of_a_figure_need_a_figure(command, arguments, options):
    status, out, error = command(*arguments, *options)
    assert (status, out) == (2, "")
    assert f"{' '.join(options)}: needs --plot FILE, which is not given" in error
