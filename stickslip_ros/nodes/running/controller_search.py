"""Find controllers in the ROS graph: nodes that close the loop, and nodes that nearly do."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import filterfalse

from rclpy.node import Node, NodeNameNonExistentError
from rclpy.topic_endpoint_info import TopicEndpointInfo, TopicEndpointTypeEnum

from stickslip_ros.nodes.base.endpoints import mismatch, qos_profile
from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES
from stickslip_ros.scenarios import full_name

DASHBOARD = "dashboard"
"""Name of a node that reads joint_states but is not meant to be a controller."""


class ControllerSearch:
    """Looks for the controller of a loop among the nodes of others."""

    def __init__(self, observer: Node, namespace: str, ours: Iterable[str]) -> None:
        """Search through `observer`, a node in the loop's namespace.

        `ours` are the names, relative to the namespace, of nodes that are no candidates.
        """
        self._observer = observer
        self._dashboard = full_name(namespace, DASHBOARD)
        self._ours = {full_name(namespace, node) for node in ours}
        self._joint_states = observer.resolve_topic_name(JOINT_STATES.name)
        self._control_force = observer.resolve_topic_name(CONTROL_FORCE.name)

    @property
    def task(self) -> str:
        """Description of what a controller does."""
        return f"reads {self._joint_states} and publishes {self._control_force}"

    def controllers(self) -> list[str]:
        """Return the full names of the nodes that read joint_states and publish control_force.

        Their types and quality of service match those of the plant. A managed node that publishes
        may read only once it is active.
        """
        readers = self._observer.get_subscriptions_info_by_topic(JOINT_STATES.name)
        writers = self._observer.get_publishers_info_by_topic(CONTROL_FORCE.name)
        reads, writes = (_named(filterfalse(_misfit, ends)) for ends in (readers, writers))
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
        joint_states, control_force = self._joint_states, self._control_force
        readers = self._observer.get_subscriptions_info_by_topic(JOINT_STATES.name)
        writers = self._observer.get_publishers_info_by_topic(CONTROL_FORCE.name)
        reads, writes = _named(readers), _named(writers)
        for node in sorted(reads - writes - {*self._ours, self._dashboard}):
            yield f"{node} reads {joint_states} but does not publish {control_force}"
        for node in sorted(writes - reads - self._ours):
            yield f"{node} publishes {control_force} but does not read {joint_states}"
        for info in readers:
            if misfit := _misfit(info):
                yield f"{_full_name(info)} cannot read {joint_states}: {misfit}"
        for info in writers:
            if misfit := _misfit(info):
                yield f"the plant cannot read {control_force} of {_full_name(info)}: {misfit}"
        yield from self._near_misses_elsewhere()

    def _near_misses_elsewhere(self) -> Iterator[str]:
        """Yield one sentence for each node that uses these topics in a namespace without plant."""
        here = self._joint_states.rpartition("/")[0]
        for topic, _ in self._observer.get_topic_names_and_types():
            namespace, _, name = topic.rpartition("/")
            if namespace == here or self._observer.get_publishers_info_by_topic(
                f"{namespace}/{JOINT_STATES.name}"
            ):
                continue
            if name == JOINT_STATES.name:
                for node in sorted(_named(self._observer.get_subscriptions_info_by_topic(topic))):
                    yield f"{node} reads {topic}, the plant publishes {self._joint_states}"
            elif name == CONTROL_FORCE.name:
                for node in sorted(_named(self._observer.get_publishers_info_by_topic(topic))):
                    yield f"{node} publishes {topic}, the plant reads {self._control_force}"


def _named(endpoints: Iterable[TopicEndpointInfo]) -> set[str]:
    """Return the names of the nodes of endpoints, as far as they are known yet."""
    return {_full_name(info) for info in endpoints if not info.node_name.startswith("_")}


def _full_name(info: TopicEndpointInfo) -> str:
    return full_name(info.node_namespace, info.node_name)


def _misfit(info: TopicEndpointInfo) -> str:
    """Return why an endpoint does not match that of the plant, or an empty string."""
    reads = info.endpoint_type == TopicEndpointTypeEnum.SUBSCRIPTION
    topic = JOINT_STATES if reads else CONTROL_FORCE
    if info.topic_type != topic.type_name:
        return f"its type is {info.topic_type}, not {topic.type_name}"
    ours, theirs = qos_profile(topic), info.qos_profile
    return mismatch(ours, theirs) if reads else mismatch(theirs, ours)
