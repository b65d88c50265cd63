"""Replay node: publishes the messages of a bag again, unchanged and with their recorded spacing.

Active, it publishes the first message when one of its topics has a reader and no new reader has
appeared for half a second. With wait_for it becomes active when the nodes named there read its
topics.
"""

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleState
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from stickslip_ros.errors import RunError
from stickslip_ros.nodes.base.endpoints import message_class
from stickslip_ros.nodes.base.managed import ERROR, OK, WARN, Diagnosis, ManagedNode, Transition
from stickslip_ros.nodes.base.process import ros_session, run_node, run_until_stopped
from stickslip_ros.nodes.pacing import FlowWindow
from stickslip_ros.nodes.replaying.player import Message, Player
from stickslip_ros.nodes.replaying.selection import Selection
from stickslip_ros.record.topics import CLOCK, JOINT_STATES, RECORDED
from stickslip_ros.scenarios.parameters import ReplayParameters
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.stamps import NANOSECONDS

_FLOW_WINDOW = PlantParameters().flow_window
"""Joint states that may be sent and not yet recorded."""
_SETTLING_TIME = 0.5
"""Time, s, without a new reader after which the readers count as complete."""
_SILENCE = 3.0
"""Time, s, after which the node logs what it waits for."""


class ReplayNode(ManagedNode[ReplayParameters]):
    """Publishes the topics of a bag under their recorded names."""

    def __init__(self, **options: Any) -> None:
        super().__init__("replay", ReplayParameters(), **options)
        self._player: Player | None = None
        self._recorded_time: int | None = None
        """Recorded time of the newest message sent, ns."""
        self._waiting_for = ""

    def connect(self) -> None:
        """Refuse what cannot be replayed; create the publishers."""
        self._selection = Selection(self.parameters, self.get_fully_qualified_name())
        for sentence in self._selection.left_out:
            self.get_logger().warning(sentence)
        self._writers = {
            name: self.keep(self.create_publisher(kind, name, qos))
            for name, (kind, qos) in self._selection.topics.items()
        }
        self._clock_writer = self.advertise(CLOCK) if self.parameters.clock else None
        joint_state = message_class(JOINT_STATES.type_name)
        self._recorders = {
            topic: self._listen_to_recorder(topic, writer)
            for topic, writer in self._writers.items()
            if writer.msg_type is joint_state and topic.endswith(f"/{JOINT_STATES.name}")
        }
        for name, act in (("pause", Player.pause), ("resume", Player.resume)):
            self.keep(self.create_service(Trigger, f"~/{name}", partial(self._steer, act)))
        self._readers: list[int] = []
        self._connected_at = self._readers_changed_at = time.monotonic()
        self.keep(self.every(0.05, self._look_for_readers))

    def start(self) -> None:
        """Publish the first message when the readers are complete, the others when due."""
        self._recorded_time = None
        self._player = Player(
            self._messages,
            self._publish,
            self._delivered,
            lambda: self.call_soon(self._end),
            rate=self.parameters.rate,
            loop=self.parameters.loop,
            windows={
                topic: FlowWindow(
                    _FLOW_WINDOW, lambda recorded=recorded: self.count_publishers(recorded) > 0
                )
                for topic, recorded in self._recorders.items()
            },
        )

    def stop(self) -> None:
        """Stop once the messages sent have arrived."""
        if self._player is not None:
            self._player.stop()
        super().stop()

    def diagnose(self) -> Diagnosis:
        """Return the progress and lateness of the replay, or what it waits for."""
        player = self._player
        if player is None:
            return OK, self._waiting_for, {}
        values = {
            "messages": player.sent,
            "position": self._position,
            "paused": player.paused,
            "worst_lateness": player.worst_lateness,
        }
        if player.failure is not None:
            return ERROR, str(player.failure), values
        return (WARN if player.complaint else OK), player.complaint or self._waiting_for, values

    @property
    def _position(self) -> float:
        """Recorded time from the first message of the bag to the last one sent, s."""
        if self._recorded_time is None:
            return 0.0
        return (self._recorded_time - self._selection.first) * 1e-9

    def _messages(self) -> Iterator[Message]:
        yield from self._selection.messages()
        if self._selection.lacking:
            lacking = "; ".join(self._selection.lacking)
            self.get_logger().warning(f"the bag is not complete: {lacking}", once=True)

    def _publish(self, message: Message, recorded_time: int) -> None:
        changed = recorded_time != self._recorded_time
        self._recorded_time = recorded_time
        if self._clock_writer is not None and changed:
            clock = Clock()
            clock.clock.sec, clock.clock.nanosec = divmod(recorded_time, NANOSECONDS)
            self._clock_writer.publish(clock)
        topic, _, data = message
        self._writers[topic].publish(data)

    def _delivered(self) -> bool:
        return all(writer.wait_for_all_acked(Duration()) for writer in self._writers.values())

    def _end(self) -> None:
        """Pause: the bag has ended, or cannot be read further."""
        player = self._player
        if player is not None and player.failure is not None:
            self.get_logger().error(f"the replay ended early: {player.failure}")
        elif player is not None and player.complaint:
            self.get_logger().warning(player.complaint)
        if self.active:
            self.trigger_deactivate()
        if self.parameters.on_end == "exit":
            self.end_process(None if player is None else player.failure)

    def _look_for_readers(self) -> None:
        """Start to publish once there are readers, and no further ones appear."""
        readers = [writer.get_subscription_count() for writer in self._writers.values()]
        now = time.monotonic()
        if readers != self._readers:
            self._readers, self._readers_changed_at = readers, now
        if any(readers):
            self._waiting_for = ""
            if (
                self.active
                and self._player is not None
                and now - self._readers_changed_at > _SETTLING_TIME
            ):
                self._player.start()
        elif not self._waiting_for and now - self._connected_at > _SILENCE:
            self._waiting_for = f"no node reads {', '.join(self._writers)}"
            self.get_logger().warning(f"waiting: {self._waiting_for}")

    def _listen_to_recorder(self, topic: str, writer: Publisher) -> str:
        """Subscribe to a recorder that may read the topic; return the name of its own topic."""
        name = f"{writer.topic_name.rpartition('/')[0]}/{RECORDED.name}"
        self.subscribe(replace(RECORDED, name=name), partial(self._on_recorded, topic))
        return name

    def _on_recorded(self, topic: str, stamp: int) -> None:
        if self._player is not None:
            self._player.recorder_came_to(topic, stamp)

    def _steer(
        self, act: Callable[[Player], None], _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        player = self._player if self.active else None
        response.success = player is not None
        response.message = "not active: nothing is being replayed"
        if player is not None:
            act(player)
            state = "paused" if player.paused else "playing"
            response.message = f"{state} at {self._position:.3f} s of the bag"
        return response


def replay_bag(
    parameters: Mapping[str, Any],
    offering: Callable[[Sequence[str]], None],
    progress: Callable[[float], None],
) -> bool:
    """Replay a bag in this process; return whether a signal ended the replay before the bag did.

    `parameters` are those of the node, by name. `offering` receives the topics when the node
    publishes them, and `progress` receives the share of the recorded time that is done. Raises
    InvalidInputError for refused parameters, BagError if the bag cannot be read further, and
    RunError for other failures.
    """
    with ros_session() as spinner:
        node = _OneReplay(offering, progress, overrides=parameters)
        run_until_stopped(spinner, node)
        return not node.ended


class _OneReplay(ReplayNode):
    """A replay that runs until the bag or a signal ends it, and reports its progress."""

    def __init__(
        self,
        offering: Callable[[Sequence[str]], None],
        progress: Callable[[float], None],
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._offering = offering
        self._progress = progress
        self.ended = False
        """Whether the replay reached the end of the bag."""
        self.every(0.1, self._tell_progress)

    def connect(self) -> None:
        super().connect()
        self._offering(sorted(self._writers))

    def on_error(self, state: LifecycleState) -> Transition:
        self.end_process(RunError("the replay failed for the reason above"))
        return super().on_error(state)

    def _end(self) -> None:
        super()._end()
        self.ended = True
        self.end_process(self._player.failure if self._player is not None else None)

    def _tell_progress(self) -> None:
        if self._position > 0.0:
            done = self._position - self.parameters.start
            self._progress(done / max(self._selection.length, 1e-9))


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(ReplayNode, ReplayParameters()))


if __name__ == "__main__":
    main()
