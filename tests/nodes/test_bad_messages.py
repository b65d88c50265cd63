"""Reaction of the nodes to wrong messages, too many messages, and additional publishers."""

import random
import resource
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import islice
from math import inf, isfinite, nan
from pathlib import Path

import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from stickslip_ros.errors import BagError
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.managed import OK, WARN
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.codec import (
    pack_header,
    pack_joint_state,
    pack_wrench,
    unpack_header,
    unpack_wrench,
    wrench_columns,
)
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.record.topics import (
    APPLIED_DISTURBANCE,
    CONTROL_FORCE,
    DISTURBANCE_FORCE,
    JOINT_STATES,
    RECORDED,
)
from tests.nodes.graph import PATIENCE, Graph
from tests.nodes.processes import Processes
from tests.nodes.runs import start_loop

SECOND = 1_000_000_000
TOPICS = (JOINT_STATES, CONTROL_FORCE, DISTURBANCE_FORCE, APPLIED_DISTURBANCE, RECORDED)
PADDING = bytes(3)
"""Fast DDS fills a message up to four bytes: one that was cut may arrive complete."""
VALUES = (nan, inf, -inf, 1e308, -1e308, 1e100, 5e-324, 0.1, -3.0)


def messages(seed: int, near: Callable[[], int]) -> Iterator[bytes]:
    """Yield joint states, forces, headers and garbage; many are stamped near an instant (ns)."""
    chance = random.Random(seed)
    while True:
        now = near()
        stamp = chance.choice(
            [now, now + 1, now - SECOND, now + SECOND, now + SECOND**2, 0, 1, -5 * SECOND]
        )
        stamp = max(-(2**31) * SECOND, min(stamp, 2**31 * SECOND - 1))
        value, other = chance.choices(VALUES, k=2)
        names = chance.choices(["slide", "belt", "arm", ""], k=chance.randrange(4))
        state = JointState(name=names, position=[value] * chance.randrange(4), velocity=[other])
        state.header.stamp.nanosec = chance.randrange(2**32)
        message = bytearray(
            chance.choice(
                [
                    pack_joint_state(stamp, (value, 0.0), (other, 0.4), (0.0, 0.0)),
                    pack_wrench(stamp, value),
                    pack_header(stamp),
                    serialize_message(state),
                    chance.randbytes(chance.randrange(1, 200)),
                ]
            )
        )
        for _ in range(chance.choice([0, 0, 1, 5])):
            message[chance.randrange(len(message))] = chance.randrange(256)
        # Fast DDS passes nothing on behind an empty message.
        yield bytes(message[: chance.choice([None, None, chance.randrange(1, len(message) + 1)])])


def too_strong(message: bytes) -> bool:
    """Return whether it is a force that may make the motion run away, which pauses the plant."""
    with suppress(BagError):
        return 1.0 < abs(unpack_wrench(message + PADDING)[1]) < inf
    return False


def resident(process: int) -> int:
    """Return the bytes of memory that a process holds."""
    pages = int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize()


def test_the_plant_says_what_it_dropped_and_waits_for_a_force_that_is_one(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    plant = graph.add(PlantNode, wait_for=["observer"], reply_timeout=1e3)
    force = graph.publisher(CONTROL_FORCE, 1)
    graph.wait_until(lambda: len(heard) == 1, "sample 0")
    assert plant.diagnose()[0] == OK
    for message in (b"\0", b"\xff" * 100, pack_wrench(SECOND, nan), pack_wrench(SECOND, -inf)):
        force.publish(message)
    graph.wait_until(lambda: plant.diagnose()[2]["dropped_messages"] == 4, "four are dropped")
    level, sentence, figures = plant.diagnose()
    assert level == WARN
    assert "4 messages dropped so far, the last: control force -inf N" in sentence
    assert figures["dropped: not finite"] == 2
    assert len(heard) == 1
    force.publish(pack_wrench(SECOND, 0.25))
    graph.wait_until(lambda: len(heard) == 2, "sample 1")

    for topic, message in ((DISTURBANCE_FORCE, pack_wrench(0, nan)), (RECORDED, b"\0\1\0")):
        graph.publisher(topic, 1).publish(message)
    graph.wait_until(lambda: plant.diagnose()[2]["dropped_messages"] == 6, "six are dropped")
    assert len(heard) == 2


def test_of_two_controllers_the_first_answer_counts_and_both_are_named(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    plant = graph.add(PlantNode, wait_for=["observer"], reply_timeout=1e3)
    first, second = (graph.publisher(CONTROL_FORCE, 1) for _ in range(2))
    graph.wait_until(lambda: len(heard) == 1, "sample 0")
    first.publish(pack_wrench(SECOND, 0.25))
    graph.wait_until(lambda: len(heard) == 2, "sample 1")
    second.publish(pack_wrench(SECOND, 99.0))
    graph.wait_until(lambda: plant.diagnose()[2]["dropped_messages"] == 1, "one is dropped")
    assert plant.diagnose()[2]["dropped: already answered stamp"] == 1
    assert plant._motion.force == 0.25
    level, sentence, _ = plant.diagnose()
    assert level == WARN
    assert "2 publishers of /test/control_force: /test/observer (2 times)" in sentence
    graph.observer.destroy_publisher(second)
    graph.wait_until(lambda: "publishers" not in plant.diagnose()[1], "the warning goes")


def test_a_second_plant_is_named_while_it_is_there(graph: Graph, tmp_path: Path) -> None:
    analyzer, controller, _ = start_loop(graph, tmp_path / "bag", pace="realtime")
    assert "publishers" not in controller.diagnose()[1]
    states = graph.publisher(JOINT_STATES, 1)
    disturbances = graph.publisher(APPLIED_DISTURBANCE, 1)
    names = "2 publishers of /test/joint_states: /test/observer, /test/plant"
    graph.wait_until(lambda: names in controller.diagnose()[1], "the controller names both")
    graph.wait_until(lambda: names in analyzer.diagnose()[1], "the analyzer names both")
    assert "/test/applied_disturbance: /test/observer, /test/plant" in analyzer.diagnose()[1]
    for made in (states, disturbances):
        graph.observer.destroy_publisher(made)
    for node in (analyzer, controller):
        graph.wait_until(
            lambda node=node: "publishers" not in node.diagnose()[1], "the warning goes"
        )


def test_the_controller_never_sends_what_is_not_finite(graph: Graph) -> None:
    forces = graph.listen(CONTROL_FORCE, raw=True)
    controller = graph.add_active(
        WashoutControllerNode, wait_for=["observer"], corner_frequency=1e3, cubic_gain=-1e30
    )
    states = graph.publisher(JOINT_STATES, 1)

    def send(number: int, velocity: float) -> None:
        states.publish(pack_joint_state(number * SECOND, (0.0, 0.0), (velocity, 0.4), (0.0, 0.0)))
        graph.wait_until(
            lambda: controller._answered + controller.diagnose()[2]["dropped_messages"] == number,
            f"state {number} is answered or dropped",
        )

    for number, velocity in enumerate([0.1, 1e100, -1e100, 1e308, inf, 0.1, 0.1], start=1):
        send(number, velocity)
    graph.wait_until(lambda: len(forces) == controller._answered, "all forces have come")
    assert all(isfinite(force) for force in wrench_columns(forces)[0].force)
    assert wrench_columns(forces)[0].stamp[-1] == 7 * SECOND


def test_a_stamp_beyond_ros_time_is_dropped(graph: Graph, tmp_path: Path) -> None:
    analyzer = graph.add(AnalyzerNode, bag=str(tmp_path / "bag"))
    controller = graph.add_active(WashoutControllerNode, wait_for=["analyzer"])
    states = graph.publisher(JOINT_STATES, 2)
    late = JointState(name=["slide", "belt"], position=[0.0, 0.0], velocity=[0.1, 0.4])
    late.header.stamp.sec, late.header.stamp.nanosec = 2**31 - 1, 2**32 - 1
    states.publish(late)
    for node in (analyzer, controller):
        graph.wait_until(lambda n=node: n.diagnose()[2]["dropped_messages"] == 1, "dropped")
    states.publish(pack_joint_state(SECOND, (0.0, 0.0), (0.1, 0.4), (0.0, 0.0)))
    graph.wait_until(lambda: controller._answered == 1, "the next one is answered")
    graph.wait_until(lambda: analyzer._activation._newest_recorded == SECOND, "and recorded")


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
def test_messages_of_every_kind_harm_no_node(graph: Graph, tmp_path: Path, pace: str) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    forces = graph.listen(CONTROL_FORCE, raw=True)
    analyzer, controller, plant = start_loop(graph, tmp_path / "bag", pace=pace, reply_timeout=0.5)
    graph.wait_until(lambda: plant._loop.sample_number > 10, "the loop runs")
    strangers = [graph.publisher(topic, 1) for topic in TOPICS]
    sent = messages(17, lambda: plant._loop.sample.stamp)
    chance = random.Random(17)
    for _ in range(30):
        for _ in range(20):
            chance.choice(strangers).publish(next(sent))
        rounds = iter(range(2))
        graph.wait_until(lambda rounds=rounds: next(rounds, None) is None, "they are heard")
    for node in (analyzer, plant):
        graph.wait_until(lambda node=node: node.diagnose()[2]["dropped_messages"] > 10, "dropped")
    for stranger in strangers:
        graph.observer.destroy_publisher(stranger)
    heard.clear()
    forces.clear()
    graph.wait_until(
        lambda: (
            (len(heard) > 20 and len(forces) > 10)
            or (plant._loop.unbounded and not plant.active)  # a force of 1e308 N was for it
        ),
        "the loop goes on, or it was too much",
    )
    for node in (controller, analyzer):
        assert node.active
    graph.deactivate("analyzer")
    report = report_of_recording(tmp_path / "bag")
    assert report["notes"]
    assert all(isfinite(figure) for figure in plant._loop.sample[:-1])  # without a motor


@pytest.mark.long
def test_a_flood_of_garbage_leaves_no_trace_but_a_count(
    graph: Graph, processes: Processes, tmp_path: Path
) -> None:
    """Nodes in processes of their own, beside a neighbour that sends 7,500 messages."""
    started = {
        "analyzer": processes.node("analyzer", bag=tmp_path / "bag"),
        "washout_controller": processes.node("washout_controller", force_limit=1.0),
        "plant": processes.node("plant", pace="realtime"),
    }
    health = [graph.health(name) for name in started]
    heard = graph.listen(JOINT_STATES, raw=True)
    graph.wait_until(lambda: len(heard) > 100 and all(health), "they run")
    strangers = [graph.publisher(topic, 1) for topic in TOPICS]
    newest = unpack_header(heard[-1])
    sent = messages(23, lambda: newest)
    sizes: list[dict[str, int]] = []
    for _ in range(3):  # the first one is to warm up
        rounds = iter(range(50))

        def send(rounds: Iterator[int] = rounds) -> bool:
            for stranger in strangers:
                for message in islice(sent, 10):
                    if not too_strong(message):
                        stranger.publish(message)
            return next(rounds, None) is None

        graph.wait_until(send, "all is sent")
        sizes.append({name: resident(process.pid) for name, process in started.items()})
    for stranger in strangers:
        graph.observer.destroy_publisher(stranger)
    for name in started:
        assert sizes[-1][name] - sizes[0][name] < 10_000_000, name
    for told in health:
        told.clear()
    graph.wait_until(
        lambda: all(told and "messages dropped" not in told[-1].message for told in health),
        "nobody complains any more",
    )
    heard.clear()
    graph.wait_until(lambda: len(heard) > 100, "the plant goes on")
    for process in list(started.values())[::-1]:
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
    assert report_of_recording(tmp_path / "bag")["notes"]
