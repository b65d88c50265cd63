"""The part of a bag to replay: topics, how they are published, and messages."""

from collections.abc import Iterator, Mapping
from dataclasses import fields
from math import inf, nan
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeVar

from rclpy import qos
from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException
from rclpy.qos import QoSPolicyEnum, QoSProfile
from rclpy.validate_full_topic_name import validate_full_topic_name

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.nodes.base.endpoints import message_class
from stickslip_ros.nodes.replaying.player import JITTER, Message, Timeline
from stickslip_ros.record.bag_layout import ANY_LAYOUT, BagLayout
from stickslip_ros.record.codec import pack_joint_state, pack_wrench
from stickslip_ros.record.definitions import message_definition
from stickslip_ros.record.metadata import offered_profiles
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.topics import CLOCK, CONTROL_FORCE, DEEP, JOINT_STATES, RECORDED
from stickslip_ros.scenarios.parameters import ReplayParameters
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import printable

PolicyT = TypeVar("PolicyT", bound=QoSPolicyEnum)


class Selection:
    """The part of a bag to replay.

    Start and duration count the recorded time as it passes in the replay, from the first message of
    the bag. A message that was logged earlier than the messages before it belongs to its own log
    time, or to the start of the bag. If log times go back by more than JITTER, recorded time
    continues from there. Without start and duration, the part is the whole bag.

    Where parameters say where a bag of another machine has motion and force, these are replayed as
    those of our plant, by their stamps.
    """

    def __init__(self, parameters: ReplayParameters, source: str) -> None:
        """Read the topics of the bag.

        Raises BagError if it is no bag or contains nothing that can be replayed, and
        InvalidInputError, with `source` and the parameter, for a request that the bag cannot meet.
        """
        self.topics: dict[str, tuple[Any, QoSProfile]] = {}
        """Message class and quality of service of each topic, by name."""
        self.left_out: list[str] = []
        """Topics that cannot be replayed, and why, in sentences."""
        self.lacking: list[str] = []
        """Sentences on what is missing from the bag, as far as it was read."""
        self._source = source
        self._parameters = parameters
        if not parameters.bag:
            raise self._refused("bag = ''", "must be the path of a bag")
        given = {field.name: getattr(parameters, field.name) for field in fields(BagLayout)}
        self._layout = BagLayout(**{name: value for name, value in given.items() if value})
        self._converted = self._layout != ANY_LAYOUT or parameters.belt_speed != 0.0
        with self._opened() as recording:
            self._types = recording.topics
            if self._converted:
                self._types = {
                    recording.name_of(topic): topic.type_name
                    for topic in (JOINT_STATES, CONTROL_FORCE)
                }
            first = next(self._recorded(recording, *self._types), None)
            if first is None:
                raise BagError(f"the bag {recording.path} holds no messages")
            self.first: int = first[1]
            """Log time of the bag's first message, ns."""
            self._find_topics(recording)
            self._check_part(recording)
            self.length = self._known_length(recording)
            """Recorded time from start to end, s; infinite if the bag does not record it."""

    def messages(self) -> Iterator[Message]:
        """Yield the messages to replay in recorded order; raises BagError if reading fails."""
        with self._opened() as recording:
            yield from self._part(recording)
            self.lacking = [*recording.missing, *recording.notes]

    def _opened(self) -> Recording:
        belt_speed = self._parameters.belt_speed
        return Recording(Path(self._parameters.bag), belt_speed=belt_speed, layout=self._layout)

    def _recorded(self, recording: Recording, *topics: str) -> Iterator[Message]:
        """Yield the messages of the bag, or its motion and forces as those of our plant."""
        if not self._converted:
            yield from recording.messages(*topics)
            return
        states, forces = self._types
        for block in recording.blocks():
            samples, control = block.joint_states, block.control_forces
            motion = (
                *(samples.stamp, samples.position, samples.velocity),
                *(samples.belt_position, samples.belt_velocity),
            )
            messages: list[Message] = []
            if states in topics:
                messages += [
                    (states, stamp, pack_joint_state(stamp, (x, belt), (v, belt_v), (nan, nan)))
                    for stamp, x, v, belt, belt_v in zip(
                        *(column.tolist() for column in motion), strict=True
                    )
                ]
            if forces in topics:
                messages += [
                    (forces, stamp, pack_wrench(stamp, force))
                    for stamp, force in zip(
                        control.stamp.tolist(), control.force.tolist(), strict=True
                    )
                ]
            yield from sorted(messages, key=itemgetter(1))

    def _part(self, recording: Recording) -> Iterator[Message]:
        begin = round(self._parameters.start * NANOSECONDS)
        end = begin + self._parameters.duration * NANOSECONDS
        for (topic, log_time, data), elapsed, newest in self._timed(recording, *self.topics):
            if newest >= end + JITTER:
                return
            # Fast DDS cannot deliver an empty message, and would hold back those after it.
            if begin <= elapsed < end and data:
                yield topic, log_time, data

    def _timed(self, recording: Recording, *topics: str) -> Iterator[tuple[Message, int, int]]:
        """Yield each message with its recorded time, ns, and the newest time so far."""
        timeline = Timeline()
        timeline.go_to(self.first)
        for message in self._recorded(recording, *topics):
            timeline.go_to(message[1])
            elapsed = max(timeline.elapsed_at(message[1]), 0)
            yield message, elapsed, timeline.elapsed_at(timeline.now)

    def _find_topics(self, recording: Recording) -> None:
        asked = self._parameters.topics
        if any(topic not in self._types for topic in asked):
            known = ", ".join(sorted(self._types))
            raise self._refused(
                f"topics = {asked}", f"the topics of the bag {recording.path} are {known}"
            )
        for topic in asked or self._worth_replaying():
            try:
                validate_full_topic_name(topic)
                kind = installed_message_class(self._types[topic])
            except (BagError, InvalidTopicNameException) as error:
                reason = str(error).splitlines()[0]
                self.left_out.append(printable(f"{topic} is omitted: {reason}"))
            else:
                self.topics[topic] = kind, recorded_profile(recording.offered_qos(topic))
        if not self.topics:
            reasons = "; ".join(self.left_out)
            raise BagError(f"no topic of the bag {recording.path} can be replayed: {reasons}")

    def _worth_replaying(self) -> list[str]:
        """Omit what a recorder sent to its plant, and a second clock."""
        states = [topic for topic in self._types if topic.endswith(f"/{JOINT_STATES.name}")]
        live = {topic.removesuffix(JOINT_STATES.name) + RECORDED.name for topic in states}
        if self._parameters.clock:
            live.add(CLOCK.name)
        return [topic for topic in self._types if topic not in live]

    def _check_part(self, recording: Recording) -> None:
        if next(self._part(recording), None) is not None:
            return
        length = max(elapsed for _, elapsed, _ in self._timed(recording, *self._types))
        raise self._refused(
            f"start = {self._parameters.start} s, duration = {self._parameters.duration} s",
            f"nothing was recorded then on {', '.join(self.topics)}; "
            f"the bag {recording.path} is {length * 1e-9:g} s long",
        )

    def _known_length(self, recording: Recording) -> float:
        if self._converted:  # its time is that of the stamps
            return self._parameters.duration
        span, rest = recording.time_span, inf
        if span is not None and span[0] >= self.first - JITTER:
            rest = (span[1] - self.first) * 1e-9 - self._parameters.start
        return min(rest if rest >= 0.0 else inf, self._parameters.duration)

    def _refused(self, what: str, why: str) -> InvalidInputError:
        return InvalidInputError(f"{self._source}: {what} is refused: {why}")


def installed_message_class(type_name: str) -> Any:
    """Return the class of a message type such as `sensor_msgs/msg/JointState`.

    Raises BagError for a type that is not installed.
    """
    message_definition(type_name)  # what has no definition must not be imported
    try:
        return message_class(type_name)
    except (ImportError, AttributeError) as error:
        raise BagError(
            f"the message type '{type_name}' is not installed for Python: {error}"
        ) from error


def recorded_profile(recorded: str) -> QoSProfile:
    """Return the quality of service with which a topic was published, from the YAML of rosbag2.

    Writer and reader need not agree on the history. It is deep, except for a latched topic: a late
    reader gets as many messages as the recorded history held. The topic is reliable if nothing was
    recorded, or its publishers differed.
    """
    try:
        profiles = [_profile(values) for values in offered_profiles(recorded)]
    except Exception:  # the file may contain anything
        profiles = []
    if profiles and all(profile == profiles[0] for profile in profiles):
        return profiles[0]
    return _profile({})


def _profile(values: Mapping[str, Any]) -> QoSProfile:
    durability = _policy(qos.DurabilityPolicy.VOLATILE, values.get("durability"))
    latches = durability is qos.DurabilityPolicy.TRANSIENT_LOCAL
    depth = int(values.get("depth", 0))
    return QoSProfile(
        history=qos.HistoryPolicy.KEEP_LAST,
        depth=min(max(depth, 1 if latches else DEEP), 100_000),
        reliability=_policy(qos.ReliabilityPolicy.RELIABLE, values.get("reliability")),
        durability=durability,
        deadline=_duration(values.get("deadline")),
        lifespan=_duration(values.get("lifespan")),
        liveliness=_policy(qos.LivelinessPolicy.AUTOMATIC, values.get("liveliness")),
        liveliness_lease_duration=_duration(values.get("liveliness_lease_duration")),
        avoid_ros_namespace_conventions=bool(values.get("avoid_ros_namespace_conventions")),
    )


def _policy(default: PolicyT, recorded: str | int | None) -> PolicyT:
    """Return the policy of this name or number; the default if it cannot be offered."""
    kind = type(default)
    if recorded is None:
        return default
    number = kind.get_from_short_key(recorded) if isinstance(recorded, str) else recorded
    policy = kind(number)
    none_to_offer = ("SYSTEM_DEFAULT", "UNKNOWN", "BEST_AVAILABLE")
    return default if policy.name in none_to_offer else policy


def _duration(recorded: Mapping[str, int] | None) -> Duration:
    values = recorded or {}
    nanoseconds = int(values.get("sec", 0)) * NANOSECONDS + int(values.get("nsec", 0))
    return Duration(nanoseconds=min(nanoseconds, 2**63 - 1))
