"""The analyzer node on the real middleware."""

import json
import re
from dataclasses import replace
from itertools import pairwise
from math import cos, sin
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from stickslip_ros.api.recordings import recorded_drive
from stickslip_ros.measures.cycle_measures import Cycle, Regime, without_cycles
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.analyzing.live_measures import LiveMeasures
from stickslip_ros.nodes.base.endpoints import qos_profile
from stickslip_ros.nodes.base.managed import ERROR, WARN, DroppedMessages
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.codec import (
    joint_state_columns,
    pack_joint_state,
    pack_wrench,
    unpack_header,
)
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.record.topics import (
    AMPLITUDE,
    CONTROL_FORCE,
    DECAY_RATE,
    DIAGNOSTICS,
    JOINT_STATES,
    ONSET_SPEED,
    RECORDED,
    STICK_FRACTION,
)
from stickslip_ros.scenarios.parameters import AnalyzerParameters
from stickslip_ros.stamps import NANOSECONDS
from tests.nodes.graph import PATIENCE, Graph
from tests.record.runs import full_disk

_FIGURES = r"stick_slip: amplitude 0\.\d+, frequency 0\.\d+, stick fraction 0\.\d{1,3}"


def run_to_the_end(
    graph: Graph, bag: Path, window: int = 20, **plant_parameters: object
) -> tuple[int, str]:
    """Run plant and analyzer until the plant pauses by itself, and the analyzer has closed.

    Return level and message of the last diagnosis of the analyzer before that.
    """
    analyzer = graph.add_active(AnalyzerNode, bag=str(bag), window=window)
    parameters = {"wait_for": ["analyzer"], "expects_control": False, **plant_parameters}
    plant = graph.add(PlantNode, **parameters)
    recorded = graph.listen(RECORDED, raw=True)
    graph.wait_until(lambda: plant.active, "plant active")
    graph.wait_until(lambda: not plant.active, "plant pauses")
    last = plant.diagnose()[2]["newest_stamp"]
    graph.wait_until(lambda: recorded and unpack_header(recorded[-1]) == last, "all is recorded")
    graph.wait_until(
        lambda: last in analyzer._activation.measures.watch._kept.stamp[-1:], "all is measured"
    )
    level, message, _ = analyzer.diagnose()
    graph.deactivate("analyzer")
    return level, message


def test_it_records_the_bytes_it_hears_measures_them_and_logs_each_figure_once(
    graph: Graph, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    amplitudes, fractions = graph.listen(AMPLITUDE), graph.listen(STICK_FRACTION)
    run_to_the_end(graph, tmp_path / "bag", window=2, belt_speed=0.2, duration=100.0)
    graph.wait_until(lambda: len(heard) == 10_001 and len(amplitudes) > 5, "all is heard")

    with Recording(tmp_path / "bag") as recording:
        recorded = [m for _, _, m in recording.messages("/test/joint_states")]
        stored = recording.metadata("stickslip_ros/report")
        plant = recording.metadata("stickslip_ros/plant")
        assert recording.complete
    assert recorded == [bytes(message) for message in heard]
    assert joint_state_columns(recorded)[0].stamp[-1] == 101_000_000_000
    report = report_of_recording(tmp_path / "bag")
    assert (report["samples"], report["lost_samples"]) == (10_001, 0)
    assert json.loads(stored["amplitude"]) == pytest.approx(report["amplitude"], rel=1e-12)
    assert amplitudes[-1].data == pytest.approx(0.318603222, rel=1e-4)
    assert fractions[-1].data == pytest.approx(0.285506954, abs=2e-3)
    assert json.loads(plant["belt_speed"]) == 0.2
    lines = [
        line.partition("[test.analyzer]: ")[2]
        for line in capfd.readouterr().err.splitlines()
        if "amplitude" in line and "report: " not in line
    ]
    assert lines[-1].startswith("stick_slip: amplitude 0.3186, ")
    assert all(re.fullmatch(_FIGURES, line) for line in lines)
    assert all(one != next_one for one, next_one in pairwise(lines))


def test_it_warns_before_a_falling_feed_reaches_the_onset(graph: Graph, tmp_path: Path) -> None:
    """Of feed_drive, but slower: tapped every 50 s, down to 51 / 50 mm/s; onset at 48.9 / 50."""
    slower = 50
    taps = tmp_path / "taps.csv"
    rows = [(t + 1e-3 * k, 100.0 * (k == 1)) for t in range(1, 14) for k in range(3)]
    taps.write_text("".join(f"{slower * t!r},{f / slower**2!r}\n" for t, f in [(0.0, 0.0), *rows]))
    decays, onsets = graph.listen(DECAY_RATE), graph.listen(ONSET_SPEED)
    forces = {"stiffness": 1e6 / slower**2, "normal_force": 1000.0 / slower**2}
    drive = {"mass": 100.0, "damping": 200.0 / slower, "belt_speed": 0.058 / slower, **forces}
    friction = {"friction.static": 0.4, "friction.minimum": 0.25}
    friction["friction.minimum_speed"] = 0.05 / slower
    falls = {"belt.kind": "ramp", "belt.amplitude": -0.007 / slower}
    falls["belt.duration"] = 14.0 * slower
    tapped = {"disturbance.kind": "table", "disturbance.file": str(taps)}
    encoder = {"sensor.position_resolution": 5e-7, "rate": 1000.0 / slower}
    parameters = drive | friction | falls | tapped | encoder
    level, message = run_to_the_end(graph, tmp_path / "bag", duration=14.5 * slower, **parameters)
    with Recording(tmp_path / "bag") as recording:
        rates, speeds = (
            [deserialize_message(data, Float64).data for *_, data in recording.messages(topic)]
            for topic in ("/test/stability/decay_rate", "/test/stability/onset_speed")
        )
    assert len(rates) > 8
    assert rates[0] > rates[-1] > 0.0
    assert speeds[-1] == pytest.approx(0.0489 / slower, rel=0.03)
    graph.wait_until(lambda: decays and onsets, "decay and onset are heard")
    assert {each.data for each in decays} <= {*rates}
    assert {each.data for each in onsets} <= {*speeds}
    assert level == WARN
    assert message.startswith("vibration may start near this feed: decay ")
    assert message.endswith(f"feed {51 / slower:.3g} mm/s")


@pytest.mark.parametrize("kind", ["number", "array", "effort"])
def test_it_measures_a_joint_of_another_machine(graph: Graph, tmp_path: Path, kind: str) -> None:
    """Best effort, several joints, numbers or efforts as forces; its bag needs no options."""
    effort = kind == "effort"
    message = Float64MultiArray(data=[9.0, -3.0]) if kind == "array" else Float64(data=-3.0)
    force_type = "effort" if effort else f"std_msgs/msg/{type(message).__name__}"
    machine = {"joint": "axis", "belt_speed": 0.5, "force_type": force_type, "force_number": 2}
    analyzer = graph.add_active(AnalyzerNode, bag=str(tmp_path / "bag"), **machine)
    best_effort = qos_profile(JOINT_STATES, reliability=ReliabilityPolicy.BEST_EFFORT)
    states = graph.observer.create_publisher(JointState, "joint_states", best_effort)
    topic = "other" if effort else "control_force"
    forces = graph.observer.create_publisher(type(message), topic, best_effort)
    wanted = [states] if effort else [states, forces]
    graph.wait_until(lambda: all(each.get_subscription_count() for each in wanted), "it reads")
    for number in range(200):
        x, v = sin(0.1 * number), cos(0.1 * number)
        state = JointState(
            name=["wrist", "axis"], position=[9.0, x], velocity=[0.0, v], effort=[0.0, -3.0]
        )
        state.header.stamp.sec, state.header.stamp.nanosec = divmod(
            NANOSECONDS + number * NANOSECONDS // 10, NANOSECONDS
        )
        states.publish(state)
        forces.publish(message)
    graph.wait_until(
        lambda: (
            analyzer._activation.measures.meter.motion.samples == 200
            and (analyzer._activation.measures.meter.force.peak_force or 0.0) == 3.0
        ),
        "all is measured",
    )
    graph.deactivate("analyzer")
    report = report_of_recording(tmp_path / "bag")
    assert (report["samples"], report["peak_force"], report["missing"]) == (200, 3.0, [])
    assert report["amplitude"] == pytest.approx(1.0, rel=1e-3)
    with Recording(tmp_path / "bag") as recording:
        assert recording.joint_states.belt_velocity[0] == 0.5


def test_it_says_that_a_joint_must_be_chosen(graph: Graph) -> None:
    analyzer = graph.add_active(AnalyzerNode)
    states = graph.publisher(JOINT_STATES, 1)
    state = JointState(name=["wrist", "axis"], position=[9.0, 1.0])
    state.header.stamp.sec = 5
    states.publish(state)
    graph.wait_until(lambda: analyzer.dropped.complaint, "it complains")
    assert "of the joints wrist, axis: --joint NAME must choose one" in analyzer.dropped.complaint


def test_it_keeps_the_counts_of_late_forces_of_each_activation_of_the_plant(
    graph: Graph, tmp_path: Path
) -> None:
    analyzer = graph.add_active(AnalyzerNode, bag=str(tmp_path / "bag"))
    plant = graph.publisher(DIAGNOSTICS, 1)

    def tell(name: str, state: str, first_stamp: int, *counts: int) -> None:
        keys = "state", "first_stamp", "samples", "late_forces", "missed_deadlines"
        values = zip(keys, map(str, (state, first_stamp, *counts)), strict=True)
        entries = [KeyValue(key=key, value=value) for key, value in values]
        plant.publish(DiagnosticArray(status=[DiagnosticStatus(name=name, values=entries)]))

    tell("/test/plant", "inactive", 1, 900, 800, 700)  # of a recording before this one
    tell("/test/plant", "active", 2, 100, 10, 4)
    tell("/other/plant", "active", 2, 100, 90, 90)
    tell("/test/plant", "deactivating", 2, 200, 30, 5)
    tell("/test/plant", "inactive", 2, 200, 30, 5)
    tell("/test/plant", "active", 3, 50, 1, 0)
    graph.wait_until(lambda: (analyzer._activation._timing.total or [0])[0] == 250, "all is heard")
    assert kept_timing(tmp_path / "bag") == {  # also if it is killed now
        "samples": "250", "late_forces": "31", "missed_deadlines": "5",
    }  # fmt: skip
    assert "12 % of the forces came late" in analyzer.diagnose()[2]["notes"]
    tell("/test/plant", "active", 3, 150, 1, 0)
    graph.wait_until(lambda: analyzer._activation._timing.total.samples == 350, "the last is heard")
    graph.deactivate("analyzer")
    assert (kept_timing(tmp_path / "bag") or {})["samples"] == "350"


def kept_timing(bag: Path) -> dict[str, str] | None:
    with Recording(bag) as recording:
        return recording.metadata("stickslip_ros/timing")


def test_it_keeps_the_curves_in_files_that_parameters_name(graph: Graph, tmp_path: Path) -> None:
    files = {
        "forward": "0,0.4\n0.5,0.25\n",
        "reverse": "0,0.42\n0.5,0.24\n",
        "belt": "0,0\n9,0.05\n",
    }
    paths = {name: str(tmp_path / f"{name}.csv") for name in files}
    for name, text in files.items():
        Path(paths[name]).write_text(text)
    run_to_the_end(
        graph, tmp_path / "bag", duration=2.0,
        **{
            "friction.law": "table", "friction.file": paths["forward"],
            "friction.reverse.file": paths["reverse"],
            "belt.kind": "table", "belt.file": paths["belt"],
        },
    )  # fmt: skip
    with_files = recorded_drive(tmp_path / "bag")
    for path in paths.values():
        Path(path).unlink()
    without = recorded_drive(tmp_path / "bag")
    assert without == with_files
    assert float(without.friction.coefficient(-0.5, -1.0)) == 0.24
    assert without.belt.at(4.5) == pytest.approx(0.025, rel=1e-12)


def test_no_sample_counts_as_recorded_before_the_parameters_are(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that is over in an instant ends once its last sample is recorded."""
    monkeypatch.setattr("stickslip_ros.nodes.analyzer.ANSWER_TIME", PATIENCE)
    answered: list[bool] = []

    def note(_: object) -> None:
        answered.append(analyzer._activation._parameter_calls.has_answered("plant"))

    graph.subscribe(RECORDED, note)
    graph.add(PlantNode, autostart=False)
    states = graph.publisher(JOINT_STATES)
    analyzer = graph.add_active(AnalyzerNode, bag=str(tmp_path / "bag"))
    graph.wait_until(lambda: states.get_subscription_count() > 0, "analyzer listens")
    states.publish(pack_joint_state(1_000_000_000, (0.0, 0.0), (0.0, 0.4), (0.0, 0.0)))
    graph.wait_until(lambda: answered, "the sample is recorded")
    assert answered[0]


def test_a_timer_that_is_due_when_it_stops_does_nothing(graph: Graph) -> None:
    analyzer = graph.add_active(AnalyzerNode)
    due = [timer.callback for timer in analyzer._activation._periodic]
    assert len(due) == 2
    analyzer.trigger_deactivate()
    for callback in due:  # the executor had seen it, and not yet called back
        callback()


def test_activated_again_it_opens_a_further_bag(graph: Graph, tmp_path: Path) -> None:
    analyzer = graph.add(AnalyzerNode, bag=str(tmp_path / "bag"))
    for name in ("bag", "bag_2", "bag_3"):
        graph.wait_until(lambda: analyzer.active, "analyzer active")
        assert analyzer.diagnose()[2]["bag"] == str(tmp_path / name)
        analyzer.trigger_deactivate()
        assert analyzer.diagnose()[2] == {"bag": str(tmp_path / name)}
        assert (tmp_path / name / "metadata.yaml").is_file()
        analyzer.trigger_activate()
    analyzer.trigger_deactivate()
    analyzer.set_parameters_atomically([Parameter("bag", value=str(tmp_path / "other"))])
    analyzer.trigger_activate()
    assert analyzer.diagnose()[2]["bag"] == str(tmp_path / "other")
    analyzer.trigger_deactivate()
    analyzer.set_parameters_atomically([Parameter("bag", value="")])
    analyzer.trigger_activate()
    assert "bag" not in analyzer.diagnose()[2]


def test_restarted_it_records_beside_the_bag_that_was_left(graph: Graph, tmp_path: Path) -> None:
    for name in ("bag", "bag_2"):
        (tmp_path / name).mkdir()
    analyzer = graph.add_active(AnalyzerNode, bag=str(tmp_path / "bag"), bag_exists="next")
    assert analyzer.diagnose()[2]["bag"] == str(tmp_path / "bag_3")
    assert list((tmp_path / "bag").iterdir()) == []


def test_a_message_without_a_proper_stamp_does_not_end_the_recording(
    graph: Graph, tmp_path: Path
) -> None:
    graph.add_active(AnalyzerNode, bag=str(tmp_path / "bag"))
    force = graph.publisher(CONTROL_FORCE, 1)
    for stamp in (-1_000_000_000, 0, 5_000_000_000, 3_000_000_000):
        force.publish(pack_wrench(stamp, 1.0))
    graph.deactivate("analyzer")
    with Recording(tmp_path / "bag") as recording:
        recorded = [stamp for _, stamp, _ in recording.messages("/test/control_force")]
        assert recording.complete
    assert recorded == [5_000_000_000, 3_000_000_000]


def test_a_controller_that_the_middleware_names_late_is_asked_for_its_parameters(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    named = AnalyzerNode.get_publishers_info_by_topic
    looks = 0

    def named_late(node: AnalyzerNode, topic: str) -> list[TopicEndpointInfo]:
        nonlocal looks
        publishers = named(node, topic)
        looks += bool(publishers)
        for publisher in publishers if looks < 3 else []:
            publisher.node_name = "_NODE_NAME_UNKNOWN_"
        return publishers

    monkeypatch.setattr(AnalyzerNode, "get_publishers_info_by_topic", named_late)
    graph.add(WashoutControllerNode)
    graph.add(AnalyzerNode, bag=str(tmp_path / "bag"))

    def kept() -> bool:
        if not (tmp_path / "bag").is_dir():
            return False
        with Recording(tmp_path / "bag") as recording:
            return recording.metadata("stickslip_ros/washout_controller") is not None

    graph.wait_until(kept, "the parameters are in the bag")
    assert looks >= 3


def test_what_has_arrived_when_it_stops_is_recorded_although_nothing_has_run(
    graph: Graph, tmp_path: Path
) -> None:
    analyzer = graph.add_active(AnalyzerNode, bag=str(tmp_path / "bag"))
    states = graph.publisher(JOINT_STATES, 1)
    stamps = [1_000_000_000 + n * 1_000_000 for n in range(500)]
    for stamp in stamps:
        states.publish(pack_joint_state(stamp, (0.0, 0.0), (0.0, 0.4), (0.0, 0.0)))
    assert states.wait_for_all_acked(Duration(seconds=PATIENCE))
    analyzer.trigger_deactivate()
    with Recording(tmp_path / "bag") as recording:
        assert recording.joint_states.stamp.tolist() == stamps


def test_a_disk_that_is_full_before_the_topics_are_in_the_bag_leaves_none(
    graph: Graph, tmp_path: Path
) -> None:
    analyzer = graph.add(AnalyzerNode, bag=str(tmp_path / "bag"), autostart=False)
    analyzer.trigger_configure()
    with full_disk(4096):
        for _ in range(3):
            analyzer.trigger_activate()
    assert not analyzer.active
    assert list(tmp_path.iterdir()) == []
    analyzer.trigger_activate()
    assert analyzer.active
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_on_a_full_disk_it_says_so_and_goes_on_measuring(graph: Graph, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    analyzer = graph.add_active(AnalyzerNode, bag=str(bag), flush_period=0.01)
    diagnostics, amplitudes = graph.listen(DIAGNOSTICS), graph.listen(AMPLITUDE)
    parameters = {"expects_control": False, "duration": 60.0, "wait_for": ["analyzer"]}
    plant = graph.add(PlantNode, autostart=False, **parameters)
    plant.trigger_configure()

    def run() -> None:
        graph.wait_until(lambda: plant.active or plant.trigger_activate(), "plant active")
        graph.wait_until(lambda: not plant.active, "plant pauses")

    def complaints() -> set[str]:
        return {s.message for heard in diagnostics for s in heard.status if s.level == ERROR}

    with full_disk(100_000):
        run()
        graph.wait_until(lambda: len(amplitudes) >= 7, "it goes on measuring")
        graph.wait_until(complaints, "it says so")
    graph.deactivate("analyzer")  # the middleware, too, needs files, in memory
    (complaint,) = complaints()
    assert str(bag) in complaint
    assert "File too large" in complaint
    with Recording(bag) as recording:
        stamps = [stamp for _, stamp, _ in recording.messages("/test/joint_states")]
        assert not recording.complete
    assert stamps == [1_000_000_000 + n * 10_000_000 for n in range(len(stamps))]
    assert 0 < len(stamps) < 6001

    graph.wait_until(plant.missing_peers, "the plant knows that nobody listens")
    analyzer.trigger_activate()
    run()
    graph.deactivate("analyzer")
    assert analyzer.lifecycle_state == "inactive"
    report = report_of_recording(tmp_path / "bag_2")
    assert report["complete"]
    assert report["samples"] == 6001


def test_it_imports_what_only_noise_needs_as_soon_as_the_plant_has_some(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    imported: list[None] = []
    monkeypatch.setattr(
        "stickslip_ros.nodes.analyzing.live_measures.import_for_noise",
        lambda: imported.append(None),
    )
    run_to_the_end(graph, tmp_path / "bag", duration=1.0, **{"sensor.position_noise": 1e-6})
    assert len(imported) == 1


@pytest.mark.parametrize(
    ("regime", "share", "end"),
    [(Regime.STICK_SLIP, 0.25, "stick fraction 0.25"), (None, None, "stick fraction not known")],
)
def test_the_text_has_what_is_known(
    regime: Regime | None, share: float | None, end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    cycle = without_cycles(Cycle(1e-3, 0.1, 0.0, 0.0, 0.0, 0.0), regime, 4)
    found = replace(cycle, period=0.5, frequency=2.0, stick_fraction=share)
    live = LiveMeasures(AnalyzerParameters(), DroppedMessages.__new__(DroppedMessages))
    monkeypatch.setattr(live.meter.motion, "measures", lambda *, quick: found)
    live.cycles = 4
    name = "stick_slip" if regime else "regime not known"
    assert live.text() == f"{name}: amplitude 1 mm, frequency 2 Hz, {end}"
    live.assume_plant(dict.fromkeys(("mass", "stiffness", "normal_force"), 1.0))
    assert live.text() == f"{name}: amplitude 0.001, frequency 2, {end}"
