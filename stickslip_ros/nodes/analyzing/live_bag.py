"""The bag of the analyzer: a recording goes on without it if it cannot be written."""

import json
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

from rclpy.node import Node

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.installed_packages import versions
from stickslip_ros.nodes.analyzing.incoming import Message
from stickslip_ros.record.recorder import Recorder
from stickslip_ros.record.topics import Topic
from stickslip_ros.scenarios.curve_file import CURVES, Pairs, read_pairs
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, AnalyzerParameters


class LiveBag:
    """One bag after the other, each of one activation of a node; without one, nothing is done."""

    def __init__(self, node: Node) -> None:
        """Prepare for bags with the topics as the node names them, and with its log."""
        self.directory: Path | None = None
        """Directory of the bag of the newest activation; None without one."""
        self.failure = ""
        """Why the bag can no longer be written; empty if it can."""
        self._node = node
        self._opened = Counter[str]()
        self._recorder: Recorder | None = None

    def next_path(self, parameters: AnalyzerParameters) -> Path:
        """Return the path of the next bag of that name: from the second on they are numbered."""
        name, passes = parameters.bag, parameters.bag_exists == "next"
        paths = (Path(name + (f"_{n}" if n > 1 else "")) for n in count(self._opened[name] + 1))
        return next(path for path in paths if not (passes and path.exists()))

    def open(self, parameters: AnalyzerParameters, topics: Iterable[Topic[Any]]) -> None:
        """Start a bag with these topics, if the parameters name one.

        Raises BagError if it cannot be written; then none is left.
        """
        self._recorder, self.failure, self.directory = None, "", None
        self._channels: dict[str, int] = {}
        self._flushed_at = time.monotonic()
        if not parameters.bag:
            return
        recorder = Recorder(
            self.next_path(parameters),
            parameters.compression,
            max_bag_size=parameters.max_bag_size,
            max_bag_duration=parameters.max_bag_duration,
        )
        try:
            for topic in topics:
                self._add(recorder, topic)
        except BagError:  # on a full disk; another attempt may follow immediately
            shutil.rmtree(recorder.directory, ignore_errors=True)
            raise
        self._opened[parameters.bag] += 1
        self.directory = recorder.directory.resolve()
        self._node.get_logger().info(f"recording to {self.directory}")
        self._recorder = recorder
        self.keep("stickslip_ros/versions", versions())
        self.keep("stickslip_ros/analyzer", parameters.flat())

    def add_topics(self, topics: Iterable[Topic[Any]]) -> None:
        """Add those of the topics that the bag does not have yet."""
        for topic in topics:
            if topic.name not in self._channels:
                self._record(lambda recorder, topic=topic: self._add(recorder, topic))

    def write(self, messages: Iterable[Message]) -> None:
        """Append messages."""

        def write(recorder: Recorder) -> None:
            for topic, stamp, data in messages:
                recorder.write(self._channels[topic.name], data, stamp)

        self._record(write)

    def keep(self, name: str, values: Mapping[str, Any]) -> None:
        """Put in a table of metadata: origin or results of the recording."""
        texts = {key: json.dumps(value) for key, value in values.items()}
        self._record(lambda recorder: recorder.add_metadata(name, texts))

    def keep_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        """Put in the parameters of a node, and the curves in the files that they name."""
        self.keep(f"stickslip_ros/{node}", values)
        known, curves = NODE_PARAMETERS[node].known, dict[str, Pairs]()
        for name, path in values.items():
            if known[name].file and path and isinstance(path, str):
                with suppress(InvalidInputError):  # the node may run on another machine
                    curves[path] = read_pairs(path)
        if curves:
            self.keep(CURVES, curves)

    def flush(self, period: float, pause: float) -> None:
        """Flush, unless the next call, after a `pause` (s), is soon enough for the `period` (s)."""
        now = time.monotonic()
        if now + pause >= self._flushed_at + period:
            self._flushed_at = now
            self._record(Recorder.flush)

    def close(self) -> None:
        """Finish the bag."""
        self._record(Recorder.close)
        self._recorder = None

    def _add(self, recorder: Recorder, topic: Topic[Any]) -> None:
        name = self._node.resolve_topic_name(topic.name)
        policies = {"reliability": topic.reliability, "durability": topic.durability}
        channel = recorder.add_topic(name, topic.type_name, topic.depth, **policies)
        self._channels[topic.name] = channel

    def _record(self, act: Callable[[Recorder], None]) -> None:
        if self._recorder is None:
            return
        try:
            act(self._recorder)
        except BagError as error:
            self._recorder = None
            self.failure = str(error)
            self._node.get_logger().error(self.failure)
