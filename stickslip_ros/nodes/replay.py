"""Replay node: publishes the messages of a bag again, unchanged and spaced as they were.

It begins when one of its topics has a reader and, for half a second, no other reader has come. With
wait_for it begins when the nodes named there read what it publishes.
"""

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from stickslip_ros.errors import RunError, StickslipError
from stickslip_ros.messages.codec import unpack_header
from stickslip_ros.messages.topics import CLOCK, JOINT_STATES, RECORDED
from stickslip_ros.nodes.base.managed import ERROR, OK, WARN, Level, ManagedNode
from stickslip_ros.nodes.base.process import initialise, run_node, run_until_stopped
from stickslip_ros.nodes.pacing import FlowWindow
from stickslip_ros.nodes.replaying.player import Message, Player
from stickslip_ros.nodes.replaying.selection import Excerpt
from stickslip_ros.scenarios.parameters import PlantParameters, ReplayParameters
from stickslip_ros.stamps import NANOSECONDS

_FLOW_WINDOW = PlantParameters().flow_window
"""Joint states that may be on their way to a recorder."""
_LOOK_PERIOD = 0.05
_SETTLED = 0.5
"""Time, s, without a new reader after which those that are there count as all."""
_SILENCE = 3.0
"""Time, s, after which it is said what is waited for."""
_PROGRESS_PERIOD = 0.1


class ReplayNode(ManagedNode[ReplayParameters]):
    """Publishes the topics of a bag under the names they were recorded under."""

    def __init__(self, **options: Any) -> None:
        super().__init__("replay", ReplayParameters, **options)
        self._player: Player | None = None
        self._waiting_for = ""

    def connect(self) -> None:
        """Refuse what cannot be replayed; offer the topics."""
        excerpt = self._excerpt = Excerpt(self.parameters, self.get_fully_qualified_name())
        for sentence in excerpt.left_out:
            self.get_logger().warning(sentence)
        self._writers = {
            topic: self.create_publisher(offer.message_type, topic, offer.profile)
            for topic, offer in excerpt.offers.items()
        }
        self._connections.extend(self._writers.values())
        self._clock_writer = self.advertise(CLOCK) if self.parameters.clock else None
        self._recorders = {
            topic: self._hear_recorder(topic, writer)
            for topic, writer in self._writers.items()
            if writer.msg_type is JOINT_STATES.type and topic.endswith(f"/{JOINT_STATES.name}")
        }
        for name, act in (("pause", Player.pause), ("resume", Player.resume)):
            service = self.create_service(Trigger, f"~/{name}", partial(self._steer, act))
            self._connections.append(service)
        self._readers: list[int] = []
        self._connected_at = self._readers_changed_at = time.monotonic()
        self._connections.append(self.every(_LOOK_PERIOD, self._look_for_readers))

    def start(self) -> None:
        """Publish the first message now, further ones when they are due."""
        self._clock_time: int | None = None
        self._player = Player(
            self._messages,
            self._publish,
            self._delivered,
            lambda: self.call_soon(self._end),
            rate=self.parameters.rate,
            loop=self.parameters.loop,
            windows={
                topic: FlowWindow(_FLOW_WINDOW, partial(self._has_publisher, recorded))
                for topic, recorded in self._recorders.items()
            },
        )
        self._player.start()

    def stop(self) -> None:
        """Fall silent, once the messages sent have arrived."""
        if self._player is not None:
            self._player.stop()
        for writer in self._writers.values():
            self.wait_for_delivery(writer)

    def diagnose(self) -> tuple[Level, str, dict[str, Any]]:
        """Return how far the replay has come and how late it was, or what it waits for."""
        player = self._player
        if player is None:
            return OK, self._waiting_for, {}
        figures = {
            "messages": player.sent,
            "position": self._position,
            "paused": player.paused,
            "worst_lateness": player.worst_lateness,
        }
        if player.failure is not None:
            return ERROR, str(player.failure), figures
        return (WARN if player.complaint else OK), player.complaint or self._waiting_for, figures

    @property
    def _position(self) -> float:
        """Recorded time from the bag's first message to the last one that was sent, s."""
        if self._player is None or self._player.sent == 0:
            return 0.0
        return (self._player.recorded_time - self._excerpt.first) * 1e-9

    def _messages(self) -> Iterator[Message]:
        yield from self._excerpt.messages()
        if self._excerpt.lacking:
            lacking = "; ".join(self._excerpt.lacking)
            self.get_logger().warning(f"the bag is not complete: {lacking}", once=True)

    def _publish(self, message: Message, recorded_time: int) -> None:
        if self._clock_writer is not None and recorded_time != self._clock_time:
            self._clock_time = recorded_time
            clock = Clock()
            clock.clock.sec, clock.clock.nanosec = divmod(recorded_time, NANOSECONDS)
            self._clock_writer.publish(clock)
        topic, _, data = message
        self._writers[topic].publish(data)

    def _delivered(self) -> bool:
        return all(writer.wait_for_all_acked(Duration()) for writer in self._writers.values())

    def _end(self) -> None:
        """Pause by itself: the bag has come to its end, or cannot be read any further."""
        player = self._player
        if player is not None and player.failure is not None:
            self.get_logger().error(f"the replay ended early: {player.failure}")
        elif player is not None and player.complaint:
            self.get_logger().warning(player.complaint)
        if self.active:
            self.trigger_deactivate()

    def unmatched(self) -> str:
        """Return what is missing of the readers: those named or, if none are, any."""
        missing = super().unmatched()
        if not missing and not any(self._readers):
            missing = f"nobody reads {', '.join(self._writers)}"
        now = time.monotonic()
        if missing and missing != self._waiting_for and now - self._connected_at > _SILENCE:
            self.get_logger().warning(f"waiting: {missing}")
            self._waiting_for = missing
        if missing:
            return missing
        self._waiting_for = ""
        return "readers are still coming" if now - self._readers_changed_at < _SETTLED else ""

    def _look_for_readers(self) -> None:
        readers = [writer.get_subscription_count() for writer in self._writers.values()]
        if readers != self._readers:
            self._readers, self._readers_changed_at = readers, time.monotonic()

    def _hear_recorder(self, topic: str, writer: Publisher) -> str:
        """Listen to the recorder that may be among a topic's readers; return what it speaks on."""
        name = f"{writer.topic_name.rpartition('/')[0]}/{RECORDED.name}"
        self.subscribe(replace(RECORDED, name=name), partial(self._on_recorded, topic))
        return name

    def _has_publisher(self, topic: str) -> bool:
        return self.count_publishers(topic) > 0

    def _on_recorded(self, topic: str, message: bytes) -> None:
        if self._player is not None:
            self._player.recorder_came_to(topic, unpack_header(message))

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
    """Replay a bag in this process; return whether a signal ended it before the bag did.

    `parameters` are those of the node by name. `offering` is told the topics when they are offered,
    `progress` now and then which share of the recorded time is done. Raises InvalidInputError for
    what is refused, BagError where the bag cannot be read on, and RunError where all else fails.
    """
    initialise()
    try:
        node = _OneReplay(offering, progress, overrides=parameters)
        return node.run()
    finally:
        rclpy.try_shutdown()


class _OneReplay(ReplayNode):
    """Runs until the bag or a signal ends it, and says how far it has come."""

    def __init__(
        self,
        offering: Callable[[Sequence[str]], None],
        progress: Callable[[float], None],
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._offering = offering
        self._progress = progress
        self._ended = False
        self.every(_PROGRESS_PERIOD, self._tell_progress)

    def run(self) -> bool:
        """Return whether a signal ended it."""
        run_until_stopped(self)
        if self._player is not None and self._player.failure is not None:
            raise self._player.failure
        return not self._ended

    def connect(self) -> None:
        super().connect()
        self._offering(list(self._writers))

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._finish(RunError("the replay failed for the reason above"))
        return super().on_error(state)

    def _end(self) -> None:
        super()._end()
        self._ended = True
        self._finish(None)

    def _finish(self, failure: StickslipError | None) -> None:
        if not self.stopped.done():
            self.stopped.set_result(failure)

    def _tell_progress(self) -> None:
        if self._position > 0.0:
            done = self._position - self.parameters.start
            self._progress(done / max(self._excerpt.length, 1e-9))


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(ReplayNode, ReplayParameters))


if __name__ == "__main__":
    main()
