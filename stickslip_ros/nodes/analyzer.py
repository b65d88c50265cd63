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
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64

from stickslip_ros.measures.cycle_measures import trend_text
from stickslip_ros.nodes.analyzing.incoming import Incoming, Message, recorded_topics
from stickslip_ros.nodes.analyzing.live_bag import LiveBag
from stickslip_ros.nodes.analyzing.live_measures import LiveMeasures, PlantTiming
from stickslip_ros.nodes.base.clients import ANSWER_TIME, ParameterCalls
from stickslip_ros.nodes.base.endpoints import waiting_messages
from stickslip_ros.nodes.base.managed import ERROR, FAILURE, OK, Diagnosis, ManagedNode, diagnosis
from stickslip_ros.nodes.base.process import run_node
from stickslip_ros.record import topics
from stickslip_ros.record.codec import pack_header
from stickslip_ros.record.recorder import check_new_bag
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
        self._measured = {
            topic: self.advertise(topic)
            for topic in (
                *(topics.AMPLITUDE, topics.STICK_FRACTION, topics.FREQUENCY),
                *(topics.DECAY_RATE, topics.ONSET_SPEED),
            )
        }
        self._health = self.subscribe(
            topics.DIAGNOSTICS, lambda health: self._activation.note_timing(health)
        )

    def start(self) -> None:
        """Open a bag, start to measure, and subscribe last, so that no message is lost."""
        self._activation = Activation(self, self._bag, self._measured)

    def stop(self) -> None:
        """Take in what waits, close the bag with its report, and log the report."""
        self._activation.take_in_the_rest()
        for message in waiting_messages(self._health):
            self._activation.note_timing(deserialize_message(message, DiagnosticArray))
        report = json.dumps(self._activation.close())
        if self._bag.failure:  # then the report is in no bag
            self.get_logger().warning(f"report: {report}")
        else:  # a logger allows one severity for each line of code
            self.get_logger().info(f"report: {report}")

    def publishing_nodes(self) -> set[str]:
        """Return the nodes that publish the recorded topics, or commands to the plant."""
        return {
            writer.node_name
            for topic in (*topics.RECORDED_TOPICS, topics.JOINT_COMMANDS)
            for writer in self.get_publishers_info_by_topic(topic.name)
        }

    def diagnose(self) -> Diagnosis:
        """Return regime and steadiness, counts of samples, and problems with them."""
        bag = {"bag": str(self._bag.directory)} if self._bag.directory is not None else {}
        if not self.active:
            return OK, "", bag
        measures = self._activation.measures
        report = measures.report(quick=True)
        counts = {name: report[name] for name in ("regime", "steady", "samples", "lost_samples")}
        counts["trend"] = trend_text(report)
        notes = {"notes": "; ".join(report["notes"])}
        margin = self.parameters.onset_margin
        stability, near = measures.watch.status(margin, measures.length)
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


class Activation:
    """What exists while the analyzer is active: subscriptions, measures, questions to nodes."""

    def __init__(
        self,
        node: ManagedNode[AnalyzerParameters],
        bag: LiveBag,
        measured: Mapping[topics.Topic[Any], Publisher],
    ) -> None:
        """Open the bag and subscribe through the node; publish what is `measured`, by topic."""
        self._node, self._bag, self._measured = node, bag, measured
        parameters = node.parameters
        recorded = recorded_topics(parameters.force_type)
        self.measures = LiveMeasures(parameters, node.dropped)
        self._newest_recorded = 0
        self._heard_at = inf
        self._logged = ""
        bag.open(parameters, [t for t in recorded if t not in topics.RECORDED_IF_PUBLISHED])
        # The plant waits for the recorder while this publisher exists.
        self._recorded = node.advertise(topics.RECORDED)
        self._parameter_calls = ParameterCalls(node, self._take_parameters)
        self._parameter_calls.ask("plant")
        self._incoming = Incoming(node, recorded)
        self._timing = PlantTiming(full_name(node.get_namespace(), "plant"))
        self._look_for_controllers()
        # Messages are taken in batches: single ones would each wake a thread and find cold caches.
        self._batch_period = min(0.02, parameters.flush_period / 2.0)
        self._periodic = [
            node.keep(node.every(period, partial(self._if_active, act)))
            for period, act in (
                (self._batch_period, self._take_in),
                (0.1, self._measure_unless_behind),
            )
        ]

    def take_in_the_rest(self) -> None:
        """Record and measure what waits."""
        for _ in range(topics.RECORDER_DEPTH // topics.DEEP + 1):  # a publisher may go on
            self._take_in()
            self._measure()
            if not self._incoming.behind:
                break
        if self.measures.meter.dropped:
            time.sleep(VERDICT_TIME)
            dropped = self._incoming.take(topics.DROPPED_FORCE)
            self.measures.add({topics.DROPPED_FORCE: dropped})
            self._bag.write(dropped)
        self._measure()
        self.measures.meter.finish()

    def close(self) -> dict[str, Any]:
        """Listen no more, and close the bag with the report; return the report."""
        meter = self.measures.meter
        if meter.timing is not None and self._timing.complete:
            meter.published = meter.timing.samples
        report = self.measures.report()
        self._incoming.close()
        for end in (self._recorded, *self._periodic):
            self._node.release(end)
        self._parameter_calls.close()
        self._keep_timing()
        self._bag.keep("stickslip_ros/report", report)
        self._bag.close()
        return report

    def note_timing(self, health: DiagnosticArray) -> None:
        """Keep the plant's counts of late forces and missed deadlines once they change."""
        meter, before = self.measures.meter, self.measures.meter.timing
        self._timing.take(health)
        meter.timing = self._timing.total
        if meter.timing is not None and (before is None or meter.timing[1:] != before[1:]):
            self._keep_timing()

    def _if_active(self, callback: Callable[[], None]) -> None:
        """Call back unless the node has stopped since the timer was due."""
        if self._node.active:
            callback()

    def _take_in(self) -> None:
        """Record the messages received since the last call, and keep them for the measures."""
        messages = self._incoming.take_all()
        self.measures.add(messages)
        self._bag.add_topics(self._incoming.published)
        # Without this topic drops are unknown.
        self.measures.meter.dropped_known = topics.DROPPED_FORCE in self._incoming.published
        if messages[topics.JOINT_STATES]:
            self._heard_at = min(self._heard_at, time.monotonic())
        if self._incoming.newest != self._newest_recorded and self._parameters_known():
            self._newest_recorded = self._incoming.newest
            self._recorded.publish(pack_header(self._newest_recorded))
        self._bag.write(heapq.merge(*messages.values(), key=attrgetter("stamp")))
        self._bag.flush(self._node.parameters.flush_period, self._batch_period)

    def _parameters_known(self) -> bool:
        """Return whether all nodes have told their parameters, or it is no longer waited for.

        Until then no sample counts as recorded: a short run would be over without them.
        """
        return time.monotonic() - self._heard_at > ANSWER_TIME or self._parameter_calls.pursue()

    def _take_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        self._bag.keep_parameters(node, values)
        if node == "plant":
            self.measures.assume_plant(values)

    def _look_for_controllers(self) -> None:
        """Ask each controller of this package for its parameters, once it publishes forces.

        The middleware may name the node of a publisher later than it counts the publisher.
        """
        here, calls = self._node.get_namespace(), self._parameter_calls
        for publisher in self._node.get_publishers_info_by_topic(topics.CONTROL_FORCE.name):
            node = publisher.node_name
            if publisher.node_namespace == here and node in NODE_PARAMETERS and node not in calls:
                calls.ask(node)

    def _keep_timing(self) -> None:
        meter = self.measures.meter
        if meter.timing is not None:
            published = {} if meter.published is None else {"published": meter.published}
            self._bag.keep("stickslip_ros/timing", meter.timing._asdict() | published)

    def _measure_unless_behind(self) -> None:
        """Measure what was taken in, or give it up while more waits to be recorded."""
        if self._incoming.behind:
            self.measures.give_up()
        else:
            self._measure()

    def _measure(self) -> None:
        windows = self.measures.cycles // self._node.parameters.window
        cycles, ring_downs = self.measures.measure()
        for cycle in cycles:
            for topic, value in (
                (topics.AMPLITUDE, cycle.amplitude),
                (topics.STICK_FRACTION, cycle.stick_fraction),
                (topics.FREQUENCY, cycle.frequency),
            ):
                self._measured[topic].publish(Float64(data=value))
        for ring_down in ring_downs:
            self._tell(topics.DECAY_RATE, ring_down.decay_rate)
            if (speed := self.measures.watch.onset.speed) is not None:
                self._tell(topics.ONSET_SPEED, speed)
        if self.measures.cycles // self._node.parameters.window > windows:
            self._log_measures()
        self._incoming.match_publishers()
        self._look_for_controllers()
        self._parameter_calls.pursue()

    def _tell(self, topic: topics.Topic[Any], value: float) -> None:
        """Publish a number of the stability, and record it with the stamp of the newest sample."""
        message = Float64(data=value)
        self._measured[topic].publish(message)
        self._bag.add_topics([topic])
        self._bag.write([Message(topic, self._incoming.newest, serialize_message(message))])

    def _log_measures(self) -> None:
        """Log the measures of the last window of cycles, unless the text is unchanged."""
        text = self.measures.text()
        if text != self._logged:
            self._logged = text
            self._node.get_logger().info(text)


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(AnalyzerNode, AnalyzerParameters()))


if __name__ == "__main__":
    main()
