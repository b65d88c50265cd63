"""Analyzer node: records the topics and reports limit-cycle amplitude and stick fraction."""

import heapq
import json
import sys
import time
from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from operator import attrgetter
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64

from stickslip_ros.measures.cycle_measures import trend_text
from stickslip_ros.measures.run_report import report_of
from stickslip_ros.nodes.analyzing.incoming import Incoming, Message, recorded_topics
from stickslip_ros.nodes.analyzing.live_bag import LiveBag
from stickslip_ros.nodes.analyzing.live_measures import LiveMeasures, PlantTiming
from stickslip_ros.nodes.base.clients import ANSWER_TIME, ParameterCalls
from stickslip_ros.nodes.base.endpoints import waiting_messages
from stickslip_ros.nodes.base.managed import ERROR, FAILURE, OK, Diagnosis, ManagedNode, diagnosis
from stickslip_ros.nodes.base.process import run_node
from stickslip_ros.record.codec import pack_header
from stickslip_ros.record.recorder import check_new_bag
from stickslip_ros.record.topics import (
    AMPLITUDE,
    CONTROL_FORCE,
    DECAY_RATE,
    DEEP,
    DIAGNOSTICS,
    DROPPED_FORCE,
    FREQUENCY,
    JOINT_COMMANDS,
    JOINT_STATES,
    ONSET_SPEED,
    RECORDED,
    RECORDED_IF_PUBLISHED,
    RECORDED_TOPICS,
    RECORDER_DEPTH,
    STICK_FRACTION,
    Topic,
)
from stickslip_ros.scenarios import full_name
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, AnalyzerParameters

VERDICT_TIME = 0.05
"""Time, s, in which a plant that has dropped forces reports the last ones, too."""


class AnalyzerNode(ManagedNode[AnalyzerParameters]):
    """Subscribes to joint_states and control_force; writes a bag, publishes limit_cycle/*."""

    def __init__(self, **options: Any) -> None:
        super().__init__("analyzer", AnalyzerParameters(), **options)
        self._bag = LiveBag(self)

    def connect(self) -> None:
        """Refuse a bag that cannot be written; publish the measures."""
        if self.parameters.bag:
            check_new_bag(self._bag.next_path(self.parameters))
        self._limit_cycle = [self.advertise(t) for t in (AMPLITUDE, STICK_FRACTION, FREQUENCY)]
        self._stability = {topic: self.advertise(topic) for topic in (DECAY_RATE, ONSET_SPEED)}
        self._health = self.subscribe(DIAGNOSTICS, self._note_timing)
        # Messages are taken in batches: single ones would each wake a thread and find cold caches.
        self._batch_period = min(0.02, self.parameters.flush_period / 2.0)

    def start(self) -> None:
        """Open a bag, start to measure, and subscribe last, so that no message is lost."""
        topics = recorded_topics(self.parameters.force_type)
        self._measures = LiveMeasures(self.parameters, self.dropped)
        self._newest_recorded = 0
        self._heard_at = inf
        self._logged = ""
        self._bag.open(self.parameters, [t for t in topics if t not in RECORDED_IF_PUBLISHED])
        # The plant waits for the recorder while this publisher exists.
        self._recorded = self.advertise(RECORDED)
        self._parameter_calls = ParameterCalls(self, self._take_parameters)
        self._parameter_calls.ask("plant")
        self._incoming = Incoming(self, topics)
        self._timing = PlantTiming(full_name(self.get_namespace(), "plant"))
        self._look_for_controllers()
        self._periodic = [
            self.keep(self.every(self._batch_period, partial(self._if_active, self._take_in))),
            self.keep(self.every(0.1, partial(self._if_active, self._measure_unless_behind))),
        ]

    def stop(self) -> None:
        """Take in what waits, close the bag with its report, and log the report."""
        meter = self._measures.meter
        for _ in range(RECORDER_DEPTH // DEEP + 1):  # a publisher may go on
            self._take_in()
            self._measure()
            if not self._incoming.behind:
                break
        if meter.dropped:
            time.sleep(VERDICT_TIME)
            dropped = self._incoming.take(DROPPED_FORCE)
            self._measures.add({DROPPED_FORCE: dropped})
            self._bag.write(dropped)
        self._measure()
        meter.finish()
        for message in waiting_messages(self._health):
            self._note_timing(deserialize_message(message, DiagnosticArray))
        if meter.timing is not None and self._timing.complete:
            meter.published = meter.timing.samples
        report = report_of(meter)
        self._incoming.close()
        for end in (self._recorded, *self._periodic):
            self.release(end)
        self._parameter_calls.close()
        self._keep_timing()
        self._bag.keep("stickslip_ros/report", report)
        self._bag.close()
        if self._bag.failure:  # then the report is in no bag
            self.get_logger().warning(f"report: {json.dumps(report)}")
        else:  # a logger allows one severity for each line of code
            self.get_logger().info(f"report: {json.dumps(report)}")

    def publishing_nodes(self) -> set[str]:
        """Return the nodes that publish the recorded topics, or commands to the plant."""
        return {
            writer.node_name
            for topic in (*RECORDED_TOPICS, JOINT_COMMANDS)
            for writer in self.get_publishers_info_by_topic(topic.name)
        }

    def diagnose(self) -> Diagnosis:
        """Return regime and steadiness, counts of samples, and problems with them."""
        bag = {"bag": str(self._bag.directory)} if self._bag.directory is not None else {}
        if not self.active:
            return OK, "", bag
        meter = self._measures.meter
        report = report_of(meter, meter.motion.measured(quick=True))
        counts = {name: report[name] for name in ("regime", "steady", "samples", "lost_samples")}
        counts["trend"] = trend_text(report)
        notes = {"notes": "; ".join(report["notes"])}
        stability, near = self._measures.watch.status(self.parameters.onset_margin)
        values = {**counts, "stability": stability, **self.dropped.values, **notes, **bag}
        if failure := self._bag.failure:
            return ERROR, failure, {**values, FAILURE: failure}
        complaints = [
            self.dropped.complaint,
            *self.duplicate_publishers(*recorded_topics(self.parameters.force_type)),
        ]
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
        messages = self._incoming.take_all()
        self._measures.add(messages)
        self._bag.add_topics(self._incoming.published)
        # Without this topic drops are unknown.
        self._measures.meter.dropped_known = DROPPED_FORCE in self._incoming.published
        if messages[JOINT_STATES]:
            self._heard_at = min(self._heard_at, time.monotonic())
        if self._incoming.newest != self._newest_recorded and self._parameters_known():
            self._newest_recorded = self._incoming.newest
            self._recorded.publish(pack_header(self._newest_recorded))
        self._bag.write(heapq.merge(*messages.values(), key=attrgetter("stamp")))
        self._bag.flush(self.parameters.flush_period, self._batch_period)

    def _parameters_known(self) -> bool:
        """Return whether all nodes have told their parameters, or it is no longer waited for.

        Until then no sample counts as recorded: a short run would be over without them.
        """
        return time.monotonic() - self._heard_at > ANSWER_TIME or self._parameter_calls.pursue()

    def _take_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        self._bag.keep_parameters(node, values)
        if node == "plant":
            self._measures.assume_plant(values)

    def _look_for_controllers(self) -> None:
        """Ask each controller of this package for its parameters, once it publishes forces.

        The middleware may name the node of a publisher later than it counts the publisher.
        """
        for publisher in self.get_publishers_info_by_topic(CONTROL_FORCE.name):
            node = publisher.node_name
            here = publisher.node_namespace == self.get_namespace() and node in NODE_PARAMETERS
            if here and node not in self._parameter_calls:
                self._parameter_calls.ask(node)

    def _note_timing(self, health: DiagnosticArray) -> None:
        """Keep the plant's counts of late forces and missed deadlines once they change."""
        meter, before = self._measures.meter, self._measures.meter.timing
        self._timing.take(health)
        meter.timing = self._timing.total
        if meter.timing is not None and (before is None or meter.timing[1:] != before[1:]):
            self._keep_timing()

    def _keep_timing(self) -> None:
        meter = self._measures.meter
        if meter.timing is not None:
            published = {} if meter.published is None else {"published": meter.published}
            self._bag.keep("stickslip_ros/timing", meter.timing._asdict() | published)

    def _measure_unless_behind(self) -> None:
        """Measure what was taken in, or give it up while more waits to be recorded."""
        if self._incoming.behind:
            self._measures.give_up()
        else:
            self._measure()

    def _measure(self) -> None:
        windows = self._measures.cycles // self.parameters.window
        cycles, ring_downs = self._measures.measure()
        for cycle in cycles:
            values = (cycle.amplitude, cycle.stick_fraction, cycle.frequency)
            for publisher, value in zip(self._limit_cycle, values, strict=True):
                publisher.publish(Float64(data=value))
        for ring_down in ring_downs:
            self._tell(DECAY_RATE, ring_down.decay_rate)
            if (speed := self._measures.watch.onset.speed) is not None:
                self._tell(ONSET_SPEED, speed)
        if self._measures.cycles // self.parameters.window > windows:
            self._log_measures()
        self._incoming.match_publishers()
        self._look_for_controllers()
        self._parameter_calls.pursue()

    def _tell(self, topic: Topic[Any], value: float) -> None:
        """Publish a number of the stability, and record it with the stamp of the newest sample."""
        message = Float64(data=value)
        self._stability[topic].publish(message)
        self._bag.add_topics([topic])
        self._bag.write([Message(topic, self._incoming.newest, serialize_message(message))])

    def _log_measures(self) -> None:
        """Log the measures of the last window of cycles, unless the text is unchanged."""
        text = self._measures.text()
        if text != self._logged:
            self._logged = text
            self.get_logger().info(text)


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(AnalyzerNode, AnalyzerParameters()))


if __name__ == "__main__":
    main()
