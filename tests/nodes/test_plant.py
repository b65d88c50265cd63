"""The plant node on the real middleware."""

from math import nan

import numpy as np
import pytest
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from stickslip_ros.motion.controller import answer
from stickslip_ros.motion.motion import Motion
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.codec import joint_state_columns, pack_header, pack_wrench, unpack_wrench
from stickslip_ros.record.topics import (
    APPLIED_DISTURBANCE,
    CONTROL_FORCE,
    DISTURBANCE_FORCE,
    DROPPED_FORCE,
    JOINT_STATES,
    RECORDED,
)
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from tests.nodes.graph import Graph

SECOND = 1_000_000_000


def test_jittered_forces_act_as_they_do_without_ros_and_overtaken_ones_are_published(
    graph: Graph,
) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    forces, dropped = graph.listen(CONTROL_FORCE, raw=True), graph.listen(DROPPED_FORCE, raw=True)
    network = {"force_delay": 0.013, "force_jitter": 0.035, "force_jitter_seed": 7}
    graph.add(WashoutControllerNode)
    listeners = ["observer", "washout_controller"]
    plant = graph.add(PlantNode, duration=3.0, wait_for=listeners, **network)
    graph.wait_until(lambda: len(heard) == 301 and not plant.active, "301 samples")

    motion = Motion(PlantParameters().as_drive(), 0.0, 0.0)
    loop = SampledLoop(motion, 100.0, SECOND, **network)
    controller = CONTROLLER_PARAMETERS["washout"].as_controller()
    positions = [loop.sample.position]
    for _ in range(300):
        answer(loop, controller)
        positions.append(loop.advance().position)
    columns, _ = joint_state_columns(heard)
    assert columns.position.tolist() == positions

    graph.wait_until(lambda: len(forces) == 301, "301 forces")
    overtaken = plant.diagnose()[2]["dropped: overtaken by a newer one"]
    graph.wait_until(lambda: len(dropped) == overtaken, "all that were overtaken")
    assert overtaken > 30
    assert set(dropped) < set(forces)


def test_it_runs_no_further_ahead_of_the_recorder_than_the_window(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    recorded = graph.publisher(RECORDED)
    plant = graph.add(
        PlantNode, expects_control=False, wait_for=["observer"], flow_window=200, duration=10.0
    )
    graph.wait_until(lambda: len(heard) == 200, "the window is used up")
    recorded.publish(pack_header(SECOND + 99 * SECOND // 100))
    graph.wait_until(lambda: len(heard) == 300, "the window moves on by 100")
    assert plant.active
    graph.observer.destroy_publisher(recorded)
    graph.wait_until(lambda: len(heard) == 1001, "a recorder that went away is not waited for")


def test_in_lockstep_it_ends_once_the_recorder_has_the_last_sample(graph: Graph) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    recorded = graph.publisher(RECORDED)
    plant = graph.add(PlantNode, expects_control=False, wait_for=["observer"], duration=0.5)
    graph.wait_until(lambda: len(heard) == 51, "the last sample")
    last = SECOND + 50 * SECOND // 100
    for stamp in (last - SECOND // 100, last):
        assert plant.active
        recorded.publish(pack_header(stamp))
        graph.wait_until(lambda s=stamp: plant._pacer._flow.under_way == (last - s > 0), "noted")
    graph.wait_until(lambda: not plant.active, "the end")
    assert plant.diagnose()[2]["finished"]


@pytest.mark.parametrize(("pace", "enough"), [("lockstep", 200), ("realtime", 10)])
def test_a_pause_is_no_end_and_does_not_count_as_duration_and_the_motion_goes_on(
    graph: Graph, pace: str, enough: int
) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    recorded = graph.publisher(RECORDED)
    parameters = {"expects_control": False, "wait_for": ["observer"], "flow_window": 200}
    plant = graph.add(PlantNode, pace=pace, duration=3.0, real_time_factor=2.0, **parameters)
    graph.wait_until(lambda: len(heard) >= enough, "lockstep has used up its window")
    plant.trigger_deactivate()
    paused = plant.diagnose()[2]
    assert not paused["finished"]
    graph.observer.destroy_publisher(recorded)
    left = 300 - (paused["samples"] - 1)
    segments = [paused["samples"]]
    for duration, samples in ((3.0, left + 1), (0.0, 1), (0.3, 31)):
        plant.set_parameters([Parameter("duration", value=duration)])
        plant.trigger_activate()
        graph.wait_until(lambda: not plant.active, "the plant pauses by itself")
        assert plant.diagnose()[2]["finished"]
        assert plant.diagnose()[2]["samples"] == samples
        segments.append(samples)
    graph.wait_until(lambda: len(heard) == sum(segments), "every sample is heard")
    columns, _ = joint_state_columns(heard)
    assert (np.diff(columns.stamp) == SECOND // 100).all() or pace == "realtime"
    for first in np.cumsum(segments[:-1]):  # of a segment: the motion stood still
        assert columns.position[first] == columns.position[first - 1]


def test_what_comes_between_two_samples_acts_from_the_next_one(graph: Graph) -> None:
    """A disturbance, which is told, parameters that change at once, and a reset; time goes on."""
    heard = graph.listen(JOINT_STATES, raw=True)
    applied = graph.listen(APPLIED_DISTURBANCE, raw=True)
    plant = graph.add(PlantNode, wait_for=["observer"], **{"initial.position": 0.1})
    force, tap = graph.publisher(CONTROL_FORCE, 1), graph.publisher(DISTURBANCE_FORCE, 1)
    graph.wait_until(lambda: len(heard) == 1, "sample 0")
    tap.publish(pack_wrench(0, 0.5))
    graph.wait_until(lambda: plant._loop.asked_disturbance == 0.5, "the disturbance came")
    alone = {"friction.minimum": 0.5}
    together = {"belt_speed": 1, "friction.static": 0.5, "friction.minimum": 0.45}
    for values, taken in ((alone, False), (together, True)):
        changes = [Parameter(name, value=value) for name, value in values.items()]
        assert plant.set_parameters_atomically(changes).successful == taken
    force.publish(pack_wrench(SECOND, 0.0))
    graph.wait_until(lambda: applied and len(heard) == 2, "sample 1, and the disturbance is told")
    assert unpack_wrench(applied[0]) == (SECOND + SECOND // 100, 0.5)
    assert graph.call(Trigger, "/test/plant/reset", Trigger.Request()).success
    force.publish(pack_wrench(SECOND + SECOND // 100, 0.0))
    graph.wait_until(lambda: len(heard) == 3, "sample 2")
    columns, _ = joint_state_columns(heard)
    assert columns.belt_velocity.tolist() == [0.4, 1.0, 1.0]
    assert columns.position[1] != 0.1
    assert columns.position[2] == 0.1
    assert columns.stamp[2] == SECOND + 2 * SECOND // 100


def test_a_motion_that_runs_away_deactivates_the_plant(graph: Graph) -> None:
    health = graph.health("plant")
    parameters = {
        "friction.law": "linear",
        "friction.slope": 2.0,
        "initial.position": 0.1,
        "belt_speed": 0.2,
        "expects_control": False,
    }
    plant = graph.add(PlantNode, **parameters)
    graph.wait_until(
        lambda: any("unbounded" in status.message for status in health),
        "the reason is in the diagnostics",
    )
    assert not plant.active


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
def test_forces_that_do_not_act_are_published_as_they_were_sent(graph: Graph, pace: str) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    dropped = graph.listen(DROPPED_FORCE, raw=True)
    plant = graph.add(PlantNode, pace=pace, wait_for=["observer"], rate=0.01)
    force = graph.publisher(CONTROL_FORCE, 1)
    graph.wait_until(lambda: heard, "sample 0")
    stamp = int(joint_state_columns(heard[:1])[0].stamp[0])
    sent = [
        pack_wrench(*given) for given in ((0, 1.0), (stamp + 1, 2.0), (stamp, nan), (stamp, 128.6))
    ]
    for message in (*sent, sent[3], sent[1]):
        force.publish(message)
    graph.wait_until(lambda: len(dropped) == 5, "all but the one that is taken")
    assert dropped == [*sent[:3], sent[3], sent[1]]
    graph.deactivate("plant")
    last = pack_wrench(plant.diagnose()[2]["newest_stamp"], 3.0)
    for message in (last, sent[1]):  # the first would act if the motion went on
        force.publish(message)
    graph.wait_until(lambda: len(dropped) == 6, "what comes while it pauses")
    assert dropped[5] == sent[1]
