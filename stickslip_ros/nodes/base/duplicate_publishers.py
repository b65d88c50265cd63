"""Topics that should have one publisher, but have several."""

from collections import Counter
from typing import Any

from rclpy.node import Node

from stickslip_ros.messages.topics import Topic


def duplicate_publishers(node: Node, *topics: Topic[Any]) -> list[str]:
    """Return a sentence for each topic with several publishers, with the names of their nodes.

    A killed publisher counts until its lease in the middleware ends.
    """
    sentences: list[str] = []
    for topic in topics:
        name = node.resolve_topic_name(topic.name)
        publishers = Counter(
            f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"
            for publisher in node.get_publishers_info_by_topic(name)
            if publisher.topic_type == topic.type_name
        )
        if publishers.total() > 1:
            names = (f"{node} ({n} times)" if n > 1 else node for node, n in publishers.items())
            sentences.append(
                f"{publishers.total()} publishers of {name}: {', '.join(sorted(names))}"
            )
    return sentences
