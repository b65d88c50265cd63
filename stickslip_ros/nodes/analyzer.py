"""Analyzer node: records the topics and reports limit-cycle amplitude and stick fraction."""

import heapq
import json
import shutil
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice
from math import inf
from operator import attrgetter
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.subscription import Subscription
from std_msgs.msg import Float64

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError, InvalidInputError, MessageError
from stickslip_ros.measures.cycle_measures import trend_text
from stickslip_ros.measures.noise import import_for_noise
from stickslip_ros.measures.onset_watch import OnsetWatch
from stickslip_ros.measures.run_meter import RunMeter
from stickslip_ros.measures.sample_assumptions import SampleAssumptions
from stickslip_ros.measures.timing import Timing
from stickslip_ros.model.drive import Drive
from stickslip_ros.nodes.base.clients import (
    ANSWER_TIME,
    NEXT_TRANSITION,
    ServiceCall,
    parameters_call,
)
from stickslip_ros.nodes.base.endpoints import qos_profile, timed_messages, waiting_messages
from stickslip_ros.nodes.base.managed import (
    ERROR,
    FAILURE,
    FIRST_STAMP,
    OK,
    STATE,
    Diagnosis,
    ManagedNode,
    diagnosis,
)
from stickslip_ros.nodes.base.process import run_node
from stickslip_ros.record.bag_layout import BagLayout
from stickslip_ros.record.cdr import Messages, Refused, joined
from stickslip_ros.record.codec import (
    UNSTAMPED,
    force_layouts,
    pack_header,
    unpack_header,
    wrenches_in,
)
from stickslip_ros.record.force_reader import read_forces
from stickslip_ros.record.motion_reader import MotionReader
from stickslip_ros.record.recorder import Recorder, check_new_bag
from stickslip_ros.record.topics import (
    AMPLITUDE,
    CONTROL_FORCE,
    DECAY_RATE,
    DEEP,
    DIAGNOSTICS,
    DROPPED_FORCE,
    FREQUENCY,
    JOINT_STATES,
    ONSET_SPEED,
    RECORDED,
    RECORDED_IF_PUBLISHED,
    RECORDED_TOPICS,
    RECORDER_DEPTH,
    REFERENCE,
    STICK_FRACTION,
    Topic,
)
from stickslip_ros.samples import NO_FORCES, NO_SAMPLES, ForceColumns
from stickslip_ros.scenarios import full_name
from stickslip_ros.scenarios.curve_file import CURVES, Pairs, read_pairs
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, AnalyzerParameters
from stickslip_ros.stamps import END_OF_TIME, NANOSECONDS
from stickslip_ros.text import number_in, quantity
from stickslip_ros.versions import versions

VERDICT_TIME = 0.05
"""Time, s, in which a plant that has dropped forces reports the last ones, too."""

_REFERENCE_AGE = 60 * NANOSECONDS
"""Time, ns, by which the stamp of a reference of the run may differ from that of the newest sample.
"""


class _Message(NamedTuple):
    """A received message."""

    topic: Topic[Any]
    stamp: int
    data: bytes


class AnalyzerNode(ManagedNode[AnalyzerParameters]):
    """Subscribes to joint_states and control_force; writes a bag, publishes limit_cycle/*."""

    def __init__(self, **options: Any) -> None:
        super().__init__("analyzer", AnalyzerParameters(), **options)
        self._bags_opened = Counter[str]()
        self._bag: Path | None = None

    def connect(self) -> None:
        """Refuse a bag that cannot be written; publish the measures."""
        if self.parameters.bag:
            check_new_bag(self._next_bag())
        self._limit_cycle = [self.advertise(t) for t in (AMPLITUDE, STICK_FRACTION, FREQUENCY)]
        self._stability = {topic: self.advertise(topic) for topic in (DECAY_RATE, ONSET_SPEED)}
        self._health = self.subscribe(DIAGNOSTICS, self._note_timing)
        self._channels: dict[str, int] = {}
        # Messages are taken in batches: single ones would each wake a thread and find cold caches.
        self._batch_period = min(0.02, self.parameters.flush_period / 2.0)

    def start(self) -> None:
        """Open a bag, start to measure, and subscribe last, so that no message is lost."""
        own = self.parameters
        by_effort = own.force_type == "effort"
        kind = CONTROL_FORCE.type_name if by_effort else own.force_type
        self._force = replace(CONTROL_FORCE, type_name=kind)
        self._topics = [
            self._force if topic == CONTROL_FORCE else topic for topic in RECORDED_TOPICS
        ]
        self._force_layout = force_layouts(own.joint or None, own.force_number or None)[kind]
        layout = BagLayout(
            own.joint or None, own.belt_joint or None, force="effort" if by_effort else "topic"
        )
        self._motion = MotionReader(JOINT_STATES.name, layout, own.belt_speed)
        self._meter = RunMeter(own.window, reading=own.reading_of({}))
        self._watch = OnsetWatch()
        self._cycles = self._newest = self._newest_recorded = 0
        self._heard_at = inf
        self._timings: dict[str, Timing] = {}
        self._logged = ""
        self._bag_failure = ""
        self._recorder: Recorder | None = None
        self._flushed_at = time.monotonic()
        self._published = set[str]()
        if self.parameters.bag:
            self._open_bag()
        # The plant waits for the recorder while this publisher exists.
        self._recorded = self.advertise(RECORDED)
        self._parameter_calls: dict[str, ServiceCall] = {}
        self._ask_for_parameters("plant")
        self._to_measure: dict[Topic[Any], list[_Message]] = {
            JOINT_STATES: [],
            self._force: [],
            DROPPED_FORCE: [],
        }
        self._behind = False
        self._listening = {
            topic: self._listen(topic)
            for topic in reversed(self._topics)  # joint states last, see `missing_peers`
        }
        self._listens_since = time.time_ns()
        self._look_for_controllers()
        self._periodic = [
            self.keep(self.every(self._batch_period, partial(self._if_active, self._take_in))),
            self.keep(self.every(0.1, partial(self._if_active, self._measure_unless_behind))),
        ]

    def stop(self) -> None:
        """Take in what waits, close the bag with its report, and log the report."""
        for _ in range(RECORDER_DEPTH // DEEP + 1):  # a publisher may go on
            self._take_in()
            self._measure()
            if not self._behind:
                break
        if self._meter.dropped:
            time.sleep(VERDICT_TIME)
            self._write(self._take(DROPPED_FORCE))
        self._measure()
        self._meter.finish()
        timing = self._counted_timing()
        report = self._meter.report()
        for end in (self._recorded, *self._listening.values(), *self._periodic):
            self.release(end)
        for call in self._parameter_calls.values():
            call.close()
        if timing:
            self._keep("stickslip_ros/timing", timing)
        self._keep("stickslip_ros/report", report)
        self._record(Recorder.close)
        self._recorder = None
        if self._bag_failure:  # then the report is in no bag
            self.get_logger().warning(f"report: {json.dumps(report)}")
        else:
            self.get_logger().info(f"report: {json.dumps(report)}")

    def publishing_nodes(self) -> set[str]:
        """Return the nodes that publish the recorded topics."""
        return {
            writer.node_name
            for topic in RECORDED_TOPICS
            for writer in self.get_publishers_info_by_topic(topic.name)
        }

    def diagnose(self) -> Diagnosis:
        """Return regime and steadiness, counts of samples, and problems with them."""
        bag = {"bag": str(self._bag)} if self._bag is not None else {}
        if not self.active:
            return OK, "", bag
        report = self._meter.report(quick=True)
        counts = {name: report[name] for name in ("regime", "steady", "samples", "lost_samples")}
        counts["trend"] = trend_text(report)
        notes = {"notes": "; ".join(report["notes"])}
        stability, near = self._watch.status(self.parameters.onset_margin)
        values = {**counts, "stability": stability, **self.dropped.values, **notes, **bag}
        if self._bag_failure:
            return ERROR, self._bag_failure, {**values, FAILURE: self._bag_failure}
        complaints = [self.dropped.complaint, *self.duplicate_publishers(*self._topics)]
        if report["lost_samples"]:
            complaints.append(f"{report['lost_samples']} samples were lost")
        if near:
            complaints.append(f"vibration may start near this feed: {stability}")
        return diagnosis(complaints, values)

    def _if_active(self, callback: Callable[[], None]) -> None:
        """Call back unless the node has stopped since the timer was due."""
        if self.active:
            callback()

    def _take_in(self) -> None:
        """Record the messages received since the last call, and keep them for the measures."""
        taken = {topic: self._take(topic) for topic in self._topics}
        self._behind = any(len(messages) >= DEEP for messages in taken.values())
        for topic in RECORDED_IF_PUBLISHED:
            if topic.name not in self._published and (
                taken[topic] or self._listening[topic].get_publisher_count() > 0
            ):
                self._published.add(topic.name)
                self._record(lambda recorder, topic=topic: self._add_topic(recorder, topic))
        # Without this topic drops are unknown.
        self._meter.dropped_known = DROPPED_FORCE.name in self._published
        if taken[JOINT_STATES]:
            self._heard_at = min(self._heard_at, time.monotonic())
        if self._newest != self._newest_recorded and self._parameters_known():
            self._newest_recorded = self._newest
            self._recorded.publish(pack_header(self._newest_recorded))
        taken[REFERENCE] = [self._within_the_run(message) for message in taken[REFERENCE]]
        self._write(heapq.merge(*taken.values(), key=attrgetter("stamp")))
        # Flush now if the next call would be too late.
        now = time.monotonic()
        if now + self._batch_period >= self._flushed_at + self.parameters.flush_period:
            self._flushed_at = now
            self._record(Recorder.flush)

    def _listen(
        self, topic: Topic[Any], reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    ) -> Subscription:
        qos = qos_profile(topic, RECORDER_DEPTH, reliability)
        return self.keep(self.create_polled_subscription(topic, qos))

    def _take(self, topic: Topic[Any]) -> list[_Message]:
        """Take the waiting messages of a topic; drop those without a valid stamp."""
        taken: list[_Message] = []
        # A publisher that sends faster than this must not block all other work.
        for data, sent in islice(timed_messages(self._listening[topic]), DEEP):
            try:
                stamp = 0 if topic.type_name in UNSTAMPED else unpack_header(data)
            except MessageError as error:
                self.dropped.add(f"{topic.name}: {error}")
                continue
            if stamp == 0 and topic is self._force and topic != CONTROL_FORCE:
                simulated = self._newest and abs(sent - self._newest) > NANOSECONDS
                stamp = self._newest if simulated else sent
            if topic is not REFERENCE and not 0 < stamp < END_OF_TIME:
                self.dropped.add(f"{topic.name}: a message with the stamp {stamp} ns")
                continue
            taken.append(_Message(topic, stamp, data))
        if topic is JOINT_STATES and taken:
            self._newest = taken[-1].stamp
        if topic in self._to_measure:
            self._to_measure[topic] += taken
        return taken

    def _within_the_run(self, message: _Message) -> _Message:
        """Return a reference with the time of the run: its publisher may have any clock, or none.

        A stamp that is not of the run is replaced by that of the newest sample.
        """
        newest = max(self._newest, 1)
        in_run = message.stamp > 0 and abs(message.stamp - newest) <= _REFERENCE_AGE
        return message if in_run else message._replace(stamp=newest)

    def _ask_for_parameters(self, node: str) -> None:
        """Ask a node for its parameters, to be kept in the bag."""
        names = list(NODE_PARAMETERS[node].known)
        self._parameter_calls[node] = parameters_call(
            self, node, names, partial(self._keep_parameters, node)
        )

    def _parameters_known(self) -> bool:
        """Return whether all nodes have told their parameters, or it is no longer waited for.

        Until then no sample counts as recorded: a short run would be over without them.
        """
        return time.monotonic() - self._heard_at > ANSWER_TIME or all(
            call.pursue() or not call.exists for call in self._parameter_calls.values()
        )

    def _look_for_controllers(self) -> None:
        """Ask each controller of this package for its parameters, once it publishes forces.

        The middleware may name the node of a publisher later than it counts the publisher.
        """
        own = self.get_namespace()
        for publisher in self.get_publishers_info_by_topic(CONTROL_FORCE.name):
            node = publisher.node_name
            here = publisher.node_namespace == own and node in NODE_PARAMETERS
            if here and node not in self._parameter_calls:
                self._ask_for_parameters(node)

    def _note_timing(self, health: DiagnosticArray) -> None:
        """Take the plant's counts of late forces and missed deadlines, and add up its activations.

        What a paused plant repeats is left out: it may be from before this recording.
        """
        plant, before = full_name(self.get_namespace(), "plant"), self._meter.timing
        for status in health.status:
            values = {entry.key: entry.value for entry in status.values}
            paused = values.get(STATE) in NEXT_TRANSITION
            if status.name == plant and FIRST_STAMP in values and not paused:
                counts = (int(number_in(values.get(name, ""))) for name in Timing._fields)
                self._timings[values[FIRST_STAMP]] = Timing(*counts)
                self._meter.timing = Timing(*map(sum, zip(*self._timings.values(), strict=True)))
        if self._meter.timing is not None and (
            before is None or self._meter.timing[1:] != before[1:]
        ):
            self._keep("stickslip_ros/timing", self._meter.timing._asdict())

    def _counted_timing(self) -> dict[str, int]:
        """Return the counts of the plant for the bag, none if it told none.

        What it published counts only if it started while this recorder listened. The stamps of
        lockstep are no time of day, and do not tell that.
        """
        for message in waiting_messages(self._health):
            self._note_timing(deserialize_message(message, DiagnosticArray))
        if self._meter.timing is None:
            return {}
        counts = self._meter.timing._asdict()
        if all(number_in(first) >= self._listens_since for first in self._timings):
            self._meter.published = counts["published"] = self._meter.timing.samples
        return counts

    def _measure_unless_behind(self) -> None:
        """Measure what was taken in, or give it up while more waits to be recorded."""
        if self._behind:
            self._meter.unmeasured += len(self._to_measure[JOINT_STATES])
            self._to_measure = {topic: [] for topic in self._to_measure}
        else:
            self._measure()

    def _measure(self) -> None:
        states, efforts = self._measured(
            JOINT_STATES, lambda messages, _: self._motion.read(messages), NO_SAMPLES, NO_FORCES
        )
        if self._motion.estimated and self._meter.motion.reading.noisy is None:
            self._assume(SampleAssumptions(noisy=True))
        windows = self._cycles // self.parameters.window
        for cycle in self._meter.motion.feed(states):
            values = (cycle.amplitude, cycle.stick_fraction, cycle.frequency)
            for publisher, value in zip(self._limit_cycle, values, strict=True):
                publisher.publish(Float64(data=value))
            self._cycles += 1
        for ring_down in self._watch.feed(states):
            self._tell(DECAY_RATE, ring_down.decay_rate)
            if self._watch.onset.speed is not None:
                self._tell(ONSET_SPEED, self._watch.onset.speed)
        if self._cycles // self.parameters.window > windows:
            self._log_measures()
        (dropped,) = self._measured(DROPPED_FORCE, _wrenches, NO_FORCES)
        self._meter.feed_forces(efforts if len(efforts) else self._forces(), dropped)
        self._match_publishers()
        self._look_for_controllers()
        for call in self._parameter_calls.values():
            call.pursue()

    def _tell(self, topic: Topic[Any], value: float) -> None:
        """Publish a number of the stability, and record it with the stamp of the newest sample."""
        message, stamp = Float64(data=value), self._newest
        self._stability[topic].publish(message)
        if topic.name not in self._published:
            self._published.add(topic.name)
            self._record(lambda recorder: self._add_topic(recorder, topic))
        self._record(
            lambda recorder: recorder.write(
                self._channels[topic.name], serialize_message(message), stamp
            )
        )

    def _log_measures(self) -> None:
        """Log the measures of the last window of cycles, unless the text is unchanged."""
        measures = self._meter.motion.measures(quick=True)
        if measures.amplitude is None or measures.frequency is None:
            text = f"{measures.regime}"
        else:
            text = (
                f"{measures.regime}: amplitude {quantity(measures.amplitude, 'm')}, "
                f"frequency {quantity(measures.frequency, 'Hz')}, "
                f"stick fraction {measures.stick_fraction:.3g}"
            )
        if text != self._logged:
            self._logged = text
            self.get_logger().info(text)

    def _forces(self) -> ForceColumns:
        """Return the control forces to measure."""
        read = partial(read_forces, self._force_layout, by_log=True)
        if self._force == CONTROL_FORCE:
            read = _wrenches
        return self._measured(self._force, read, NO_FORCES)[0]

    def _measured(
        self,
        topic: Topic[Any],
        read: Callable[[Messages, IntArray], tuple[Any, ...]],
        *nothing: Any,
    ) -> Sequence[Any]:
        """Return what `read` makes of the messages of a topic to measure, or nothing.

        It gets messages and their stamps, and returns values and what it refused, which is dropped.
        """
        messages, self._to_measure[topic] = self._to_measure[topic], []
        stamps = np.array([each.stamp for each in messages], np.int64)
        try:
            *values, refused = read(joined([each.data for each in messages]), stamps)
        except BagError as error:
            self.dropped.add(str(error), len(messages))
            return nothing
        if refused.number > 0:
            self.dropped.add(f"{topic.name}: {refused.reason}", refused.number)
        return values

    def _match_publishers(self) -> None:
        """Hear best-effort publishers of other machines, too, which no reliable reader matches."""
        for topic in (JOINT_STATES, self._force):
            listening = self._listening[topic]
            best_effort = any(
                each.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
                for each in self.get_publishers_info_by_topic(listening.topic_name)
            )
            if best_effort and listening.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
                self.release(listening)
                self._listening[topic] = self._listen(topic, ReliabilityPolicy.BEST_EFFORT)

    def _next_bag(self) -> Path:
        before = self._bags_opened[self.parameters.bag]
        return Path(self.parameters.bag + (f"_{before + 1}" if before else ""))

    def _open_bag(self) -> None:
        recorder = Recorder(
            self._next_bag(),
            self.parameters.compression,
            max_bag_size=self.parameters.max_bag_size,
            max_bag_duration=self.parameters.max_bag_duration,
        )
        try:
            for topic in self._topics:
                if topic not in RECORDED_IF_PUBLISHED:
                    self._add_topic(recorder, topic)
        except BagError:  # on a full disk; another attempt may follow immediately
            shutil.rmtree(recorder.directory, ignore_errors=True)
            raise
        self._bags_opened[self.parameters.bag] += 1
        self._bag = recorder.directory.resolve()
        self.get_logger().info(f"recording to {self._bag}")
        self._recorder = recorder
        self._keep("stickslip_ros/versions", versions())
        self._keep("stickslip_ros/analyzer", self.parameters.flat())

    def _add_topic(self, recorder: Recorder, topic: Topic[Any]) -> None:
        name = self.resolve_topic_name(topic.name)
        self._channels[topic.name] = recorder.add_topic(name, topic.type_name, topic.depth)

    def _keep_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        """Put the parameters of a node into the bag, and the curves in the files that they name."""
        self._keep(f"stickslip_ros/{node}", values)
        if node == "plant":
            self._assume(self.parameters.reading_of(values))
            with suppress(InvalidInputError, KeyError, TypeError):  # a plant of another version
                period = Drive(mass=values["mass"], stiffness=values["stiffness"]).natural_period
                self._watch.pause = max(1.0, period if period < inf else 0.0)
        known, curves = NODE_PARAMETERS[node].known, dict[str, Pairs]()
        for name, path in values.items():
            if known[name].file and path and isinstance(path, str):
                with suppress(InvalidInputError):  # the node may run on another machine
                    curves[path] = read_pairs(path)
        if curves:
            self._keep(CURVES, curves)

    def _assume(self, reading: SampleAssumptions) -> None:
        self._meter.motion.reading = reading
        if reading.noisy:  # imported when first used, it would hold up the recording for long
            Thread(target=import_for_noise, name="imports").start()

    def _keep(self, name: str, values: Mapping[str, Any]) -> None:
        """Put a table of metadata into the bag: origin or results of the recording."""
        texts = {key: json.dumps(value) for key, value in values.items()}
        self._record(lambda recorder: recorder.add_metadata(name, texts))

    def _write(self, messages: Iterable[_Message]) -> None:
        def write(recorder: Recorder) -> None:
            for topic, stamp, data in messages:
                recorder.write(self._channels[topic.name], data, stamp)

        self._record(write)

    def _record(self, act: Callable[[Recorder], None]) -> None:
        """Apply `act` to the bag, if any; continue without the bag if it cannot be written."""
        if self._recorder is None:
            return
        try:
            act(self._recorder)
        except BagError as error:
            self._recorder = None
            self._bag_failure = str(error)
            self.get_logger().error(self._bag_failure)


def _wrenches(messages: Messages, _: IntArray) -> tuple[ForceColumns, Refused]:
    return wrenches_in(*messages)


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(AnalyzerNode, AnalyzerParameters()))


if __name__ == "__main__":
    main()
