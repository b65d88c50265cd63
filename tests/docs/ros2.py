"""Stand-in for `ros2`, which is not on PyPI: the verbs that the blocks of the docs use.

It has no daemon: it waits for what the graph does not show yet. A parameter or a transition that
is refused is told on standard error, with status 0, as `ros2` does. `ros2 run` is in shell.py.
"""

import argparse
import os
import signal
import sys
from importlib import import_module
from threading import Event
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import get_parameter_value, parameter_value_to_python
from rclpy.qos import qos_profile_sensor_data

from tests.nodes.graph import Graph

_interrupted = Event()
"""By Ctrl-C. An exception from within rclpy would leave unfinished objects behind."""


class Ros2(Graph):
    """The verbs, each with the names that follow it."""

    def topic_hz(self, topic: str) -> None:
        heard = self._hear(topic)
        while not _interrupted.is_set():
            heard.clear()
            self.run_for(1.0)
            print(f"average rate: {len(heard):.3f}", flush=True)

    def topic_echo(self, topic: str, *fields: str) -> None:
        heard = self._hear(topic)
        self.wait_until(lambda: heard or _interrupted.is_set(), topic)
        message = heard[0]
        for name in fields:
            message = getattr(message, name)
        print(message, "---", sep="\n")

    def param_get(self, node: str, name: str) -> None:
        request = GetParameters.Request(names=[name])
        (value,) = self.call(GetParameters, f"{node}/get_parameters", request).values
        print("Value is:", parameter_value_to_python(value))

    def param_set(self, node: str, name: str, value: str) -> None:
        parameter = Parameter(name=name, value=get_parameter_value(string_value=value))
        request = SetParameters.Request(parameters=[parameter])
        (result,) = self.call(SetParameters, f"{node}/set_parameters", request).results
        if not result.successful:
            print(f"Setting parameter failed: {result.reason}", file=sys.stderr)

    def lifecycle_get(self, node: str) -> None:
        state = self.call(GetState, f"{node}/get_state", GetState.Request()).current_state
        print(f"{state.label} [{state.id}]")

    def lifecycle_set(self, node: str, label: str) -> None:
        request = ChangeState.Request(transition=Transition(label=label))
        if not self.call(ChangeState, f"{node}/change_state", request).success:
            print("Transitioning failed", file=sys.stderr)

    def service_call(self, service: str, kind: str) -> None:
        found = _class(kind)
        print(self.call(found, service, found.Request()))

    def _type_of(self, topic: str) -> str:
        def types() -> list[str]:
            return dict(self.observer.get_topic_names_and_types()).get(topic, [])

        self.wait_until(types, topic)
        return types()[0]

    def _hear(self, topic: str) -> list[Any]:
        heard: list[Any] = []
        kind = _class(self._type_of(topic))
        self.observer.create_subscription(kind, topic, heard.append, qos_profile_sensor_data)
        return heard


def _class(name: str) -> Any:
    package, kind, own_name = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), own_name)


def main() -> int:
    parser = argparse.ArgumentParser(prog="ros2", allow_abbrev=False)
    parser.add_argument("command")
    parser.add_argument("verb")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--once", action="store_true", help="always, of an echo")
    parser.add_argument("--field", default="")
    arguments = parser.parse_intermixed_args([word for word in sys.argv[1:] if word != "--"])
    signal.signal(signal.SIGINT, lambda *_: _interrupted.set())
    ros2 = Ros2(int(os.environ["ROS_DOMAIN_ID"]))
    try:
        fields = filter(None, arguments.field.split("."))
        getattr(ros2, f"{arguments.command}_{arguments.verb}")(*arguments.names, *fields)
    finally:
        ros2.close()
    return signal.SIGINT if _interrupted.is_set() else 0


if __name__ == "__main__":
    sys.exit(main())
