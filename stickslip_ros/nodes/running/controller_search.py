"""Find controllers in the ROS graph: nodes that close the loop, and nodes that nearly do."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import Any

from rclpy.node import Node, NodeNameNonExistentError
from rclpy.topic_endpoint_info import TopicEndpointInfo, TopicEndpointTypeEnum

from stickslip_ros.nodes.base.endpoints import mismatch, qos_profile
from stickslip_ros.record.topics import JOINT_STATES, Topic
from stickslip_ros.scenarios import full_name

DASHBOARD = "dashboard"
"""Name of a node that reads joint_states but is not meant to be a controller."""


class ControllerSearch:
    """Looks for the controller of a loop among the nodes of others."""

    def __init__(
        self,
        observer: Node,
        namespace: str,
        ours: Iterable[str],
        force_topics: Iterable[Topic[Any]],
    ) -> None:
        """Search through `observer`, a node in the loop's namespace.

        `ours` are the names, relative to the namespace, of nodes that are no candidates;
        `force_topics` those from which the plant takes forces.
        """
        self._observer = observer
        self._dashboard = full_name(namespace, DASHBOARD)
        self._ours = {full_name(namespace, node) for node in ours}
        self._joint_states = observer.resolve_topic_name(JOINT_STATES.name)
        self._forces = {observer.resolve_topic_name(topic.name): topic for topic in force_topics}

    @property
    def task(self) -> str:
        """Description of what a controller does."""
        return f"reads {self._joint_states} and publishes {' or '.join(self._forces)}"

    def controllers(self) -> list[str]:
        """Return the full names of the nodes that read joint_states and publish forces.

        Their types and quality of service match those of the plant. A managed node that publishes
        may read only once it is active.
        """
        reads = _named(info for info in self._readers() if not _misfit(info, JOINT_STATES))
        writes = _named(info for name, info in self._writers() if not self._unread(name, info))
        return sorted(writes & {*reads, *self.managed()})

    def managed(self) -> list[str]:
        """Return the full names of all managed (lifecycle) nodes but ours."""
        names: list[str] = []
        for name, namespace in self._observer.get_node_names_and_namespaces():
            with suppress(NodeNameNonExistentError):  # it has left meanwhile
                services = self._observer.get_service_names_and_types_by_node(name, namespace)
                if any("lifecycle_msgs/srv/ChangeState" in types for _, types in services):
                    names.append(full_name(namespace, name))
        return [name for name in names if name not in self._ours]

    def near_misses(self) -> Iterator[str]:
        """Yield one sentence for each node that looks like a controller but is none."""
        joint_states, readers = self._joint_states, self._readers()
        reads, writes = _named(readers), _named(info for _, info in self._writers())
        for node in sorted(reads - writes - {*self._ours, self._dashboard}):
            yield f"{node} reads {joint_states} but does not publish {' or '.join(self._forces)}"
        for name in self._forces:
            writers = _named(info for topic, info in self._writers() if topic == name)
            for node in sorted(writers - reads - self._ours):
                yield f"{node} publishes {name} but does not read {joint_states}"
        for info in readers:
            if misfit := _misfit(info, JOINT_STATES):
                yield f"{_full_name(info)} cannot read {joint_states}: {misfit}"
        for name, info in self._writers():
            if misfit := self._unread(name, info):
                yield f"the plant cannot read {name} of {_full_name(info)}: {misfit}"
        yield from self._near_misses_elsewhere()

    def _readers(self) -> list[TopicEndpointInfo]:
        return self._observer.get_subscriptions_info_by_topic(self._joint_states)

    def _writers(self) -> Iterator[tuple[str, TopicEndpointInfo]]:
        for name in self._forces:
            for info in self._observer.get_publishers_info_by_topic(name):
                yield name, info

    def _unread(self, name: str, writer: TopicEndpointInfo) -> str:
        """Return why the plant cannot read a writer of forces, or an empty string."""
        return _misfit(writer, self._forces[name])

    def _near_misses_elsewhere(self) -> Iterator[str]:
        """Yield one sentence for each node that uses these topics in a namespace without plant."""
        here = self._joint_states.rpartition("/")[0]
        forces = {full.rpartition("/")[2]: full for full in self._forces}
        for topic, _ in self._observer.get_topic_names_and_types():
            namespace, _, name = topic.rpartition("/")
            if namespace == here or self._observer.get_publishers_info_by_topic(
                f"{namespace}/{JOINT_STATES.name}"
            ):
                continue
            if name == JOINT_STATES.name:
                for node in sorted(_named(self._observer.get_subscriptions_info_by_topic(topic))):
                    yield f"{node} reads {topic}, the plant publishes {self._joint_states}"
            elif name in forces:
                for node in sorted(_named(self._observer.get_publishers_info_by_topic(topic))):
                    yield f"{node} publishes {topic}, the plant reads {forces[name]}"


def _named(endpoints: Iterable[TopicEndpointInfo]) -> set[str]:
    """Return the names of the nodes of endpoints, as far as they are known yet."""
    return {_full_name(info) for info in endpoints if not info.node_name.startswith("_")}


def _full_name(info: TopicEndpointInfo) -> str:
    return full_name(info.node_namespace, info.node_name)


def _misfit(info: TopicEndpointInfo, topic: Topic[Any]) -> str:
    """Return why an endpoint does not match that of the plant, or an empty string."""
    if info.topic_type != topic.type_name:
        return f"its type is {info.topic_type}, not {topic.type_name}"
    ours, theirs = qos_profile(topic), info.qos_profile
    reads = info.endpoint_type == TopicEndpointTypeEnum.SUBSCRIPTION
    return mismatch(ours, theirs) if reads else mismatch(theirs, ours)
