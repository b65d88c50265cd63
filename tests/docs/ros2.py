"""Stand-in for `ros2`, which is not on PyPI: the verbs that the docs use, with rclpy.

It accepts the arguments of the command of ROS 2 Jazzy, or a part of them, prints the same and ends
with the same status, also with 0 for a refused parameter. It has no daemon: it waits for what the
graph does not show yet. It refuses every other argument.
"""

import argparse
import importlib
import os
import signal
import statistics
import sys
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from threading import Event
from typing import Any

import rclpy
import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rcl_interfaces.msg import Parameter
from rclpy.node import Node
from rclpy.parameter import get_parameter_value, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile, QoSReliabilityPolicy, qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

_PATIENCE = 60.0
"""How long to wait, s, for something in the graph."""

_SETTLED = 1.0
"""How long, s, the graph must stay unchanged before it is treated as complete."""

_FOUND_ITS_LIBRARIES = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"

_interrupted = Event()
"""By Ctrl-C. An exception from within rclpy would leave unfinished objects behind."""

_LABELS = {
    bool: "Boolean value is:",
    int: "Integer value is:",
    float: "Double value is:",
    str: "String value is:",
}

Answer = str | int | None
"""Of a verb: the error, or the exit status."""


def main() -> Answer:
    parser = argparse.ArgumentParser(prog="ros2", allow_abbrev=False)
    commands = parser.add_subparsers(required=True)
    run = commands.add_parser("run")
    _arguments(run, _run, "package", "executable")
    run.add_argument("argv", nargs=argparse.REMAINDER)

    topic = commands.add_parser("topic").add_subparsers(required=True)
    echo = _arguments(topic.add_parser("echo"), _topic_echo, "topic")
    echo.add_argument("type", nargs="?")
    echo.add_argument("--once", action="store_true")
    echo.add_argument("--csv", action="store_true")
    echo.add_argument("--field")
    pub = _arguments(topic.add_parser("pub"), _topic_pub, "topic", "type")
    pub.add_argument("values", nargs="?", default="{}")
    pub.add_argument("-r", "--rate", type=float, default=1.0)
    pub.add_argument("-1", "--once", dest="times", action="store_const", const=1)
    pub.add_argument("-t", "--times", type=int, default=0)
    _arguments(topic.add_parser("hz"), _topic_hz, "topic")
    listing = _arguments(topic.add_parser("list"), _topic_list)
    listing.add_argument("-t", "--show-types", action="store_true")
    _arguments(topic.add_parser("info"), _topic_info, "topic")

    param = commands.add_parser("param").add_subparsers(required=True)
    _arguments(param.add_parser("get"), _param_get, "node", "parameter")
    _arguments(param.add_parser("set"), _param_set, "node", "parameter", "value")
    _arguments(param.add_parser("list"), _param_list, "node")

    lifecycle = commands.add_parser("lifecycle").add_subparsers(required=True)
    _arguments(lifecycle.add_parser("get"), _lifecycle_get, "node")
    _arguments(lifecycle.add_parser("set"), _lifecycle_set, "node", "transition")

    service = commands.add_parser("service").add_subparsers(required=True)
    call = _arguments(service.add_parser("call"), _service_call, "service", "type")
    call.add_argument("values", nargs="?", default="{}")

    pkg = commands.add_parser("pkg").add_subparsers(required=True)
    prefix = _arguments(pkg.add_parser("prefix"), _pkg_prefix, "package")
    prefix.add_argument("--share", action="store_true")

    arguments = parser.parse_args()
    sys.stdout.reconfigure(line_buffering=True)
    try:
        return arguments.verb(arguments)
    except KeyboardInterrupt:
        return signal.SIGINT
    except _ConversationError as error:
        return str(error)


class _ConversationError(Exception):
    """No node answers, or the requested object does not exist."""


def _arguments(
    parser: argparse.ArgumentParser, verb: Callable[[argparse.Namespace], Answer], *names: str
) -> argparse.ArgumentParser:
    parser.set_defaults(verb=verb)
    for name in names:
        parser.add_argument(name)
    return parser


def _run(arguments: argparse.Namespace) -> Answer:
    try:
        folder = Path(get_package_prefix(arguments.package), "lib", arguments.package)
    except PackageNotFoundError:
        return f"Package '{arguments.package}' not found"
    file = folder / arguments.executable
    if not os.access(file, os.X_OK):
        return "No executable found"
    environment = dict(os.environ)
    environment.pop(_FOUND_ITS_LIBRARIES, None)  # the executable's environment has its own
    os.execve(file, [str(file), *arguments.argv], environment)


def _topic_echo(arguments: argparse.Namespace) -> Answer:
    done = Future()

    def show(message: Any) -> None:
        if done.done():
            return
        for name in filter(None, (arguments.field or "").split(".")):
            try:
                message = getattr(message, name)
            except AttributeError as error:
                done.set_exception(_ConversationError(f"Invalid field '{name}': {error}"))
                return
        if arguments.csv:
            print(",".join(map(str, _leaves(_plain(message)))))
        else:
            print(_as_yaml(message), end="---\n")
        if arguments.once:
            done.set_result(None)

    with _node() as node:
        _subscribe(node, arguments.topic, show, arguments.type)
        while not done.done():
            _spin(node)
        done.result()
    return None


def _topic_hz(arguments: argparse.Namespace) -> Answer:
    heard: list[float] = []
    with _node() as node:
        _subscribe(node, arguments.topic, lambda _: heard.append(time.monotonic()))
        said = time.monotonic()
        while True:
            _spin(node)
            if len(heard) < 2 or heard[-1] < said + 1.0:
                continue
            said = heard[-1]
            times = [later - sooner for sooner, later in pairwise(heard)]
            print(
                f"average rate: {1.0 / statistics.fmean(times):.3f}\n"
                f"\tmin: {min(times):.3f}s max: {max(times):.3f}s "
                f"std dev: {statistics.pstdev(times):.5f}s window: {len(times)}"
            )


def _topic_pub(arguments: argparse.Namespace) -> Answer:
    values = yaml.safe_load(arguments.values)
    if not isinstance(values, dict):
        return "The passed value needs to be a dictionary in YAML format"
    message = _type(arguments.type, "msg")()
    try:
        _fill(message, values)
    except Exception as error:
        return f"Failed to populate field: {error}"
    with _node() as node:
        publisher = node.create_publisher(type(message), arguments.topic, 10)
        if arguments.times:
            _wait(node, lambda: publisher.get_subscription_count() > 0, "a subscription")
        print("publisher: beginning loop")
        count = 0
        while True:
            count += 1
            print(f"publishing #{count}: {message!r}\n")
            publisher.publish(message)
            if count == arguments.times:
                publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=_PATIENCE))
                return None
            if _interrupted.wait(1.0 / arguments.rate):
                raise KeyboardInterrupt


def _topic_list(arguments: argparse.Namespace) -> Answer:
    with _node() as node:
        for name, types in _settled(node, lambda: sorted(node.get_topic_names_and_types())):
            print(f"{name} [{', '.join(types)}]" if arguments.show_types else name)
    return None


def _topic_info(arguments: argparse.Namespace) -> Answer:
    with _node() as node:
        print(f"Type: {_type_of(node, arguments.topic)}")
        for what, count in (
            ("Publisher", node.count_publishers),
            ("Subscription", node.count_subscribers),
        ):
            print(f"{what} count: {_settled(node, lambda c=count: c(arguments.topic))}")
    return None


def _param_get(arguments: argparse.Namespace) -> Answer:
    with _node() as node, _parameters(node, arguments.node) as client:
        values = _result(node, client.get_parameters([arguments.parameter])).values
    if not values:
        return "Parameter not set"
    found = parameter_value_to_python(values[0])
    print(_LABELS[type(found)], found)
    return None


def _param_set(arguments: argparse.Namespace) -> Answer:
    value = get_parameter_value(string_value=arguments.value)
    with _node() as node, _parameters(node, arguments.node) as client:
        parameter = Parameter(name=arguments.parameter, value=value)
        (result,) = _result(node, client.set_parameters([parameter])).results
    said = "Set parameter successful" if result.successful else "Setting parameter failed"
    if result.reason:
        said += f": {result.reason}"
    print(said, file=sys.stdout if result.successful else sys.stderr)
    return None


def _param_list(arguments: argparse.Namespace) -> Answer:
    with _node() as node, _parameters(node, arguments.node) as client:
        for name in sorted(_result(node, client.list_parameters()).result.names):
            print(f"  {name}")
    return None


def _lifecycle_get(arguments: argparse.Namespace) -> Answer:
    with _node() as node:
        _find_node(node, arguments.node)
        state = _call(node, GetState, f"{arguments.node}/get_state").current_state
    print(f"{state.label} [{state.id}]")
    return None


def _lifecycle_set(arguments: argparse.Namespace) -> Answer:
    with _node() as node:
        _find_node(node, arguments.node)
        name = f"{arguments.node}/get_available_transitions"
        known = [
            each.transition
            for each in _call(node, GetAvailableTransitions, name).available_transitions
        ]
        named = [t for t in known if arguments.transition in (t.label, str(t.id))]
        if not named:
            return "Unknown transition requested, available ones are:" + "".join(
                f"\n- {t.label} [{t.id}]" for t in known
            )
        request = ChangeState.Request(transition=named[0])
        done = _call(node, ChangeState, f"{arguments.node}/change_state", request).success
    if done:
        print("Transitioning successful")
    else:
        print("Transitioning failed", file=sys.stderr)
    return None


def _service_call(arguments: argparse.Namespace) -> Answer:
    kind = _type(arguments.type, "srv")
    request = kind.Request()
    try:
        _fill(request, yaml.safe_load(arguments.values))
    except Exception as error:
        return f"Failed to populate field: {error}"
    with _node() as node:
        print(f"requester: making request: {request!r}\n")
        print(f"response:\n{_call(node, kind, arguments.service, request)!r}\n")
    return None


def _pkg_prefix(arguments: argparse.Namespace) -> Answer:
    try:
        prefix = get_package_prefix(arguments.package)
    except PackageNotFoundError:
        return "Package not found"
    print(f"{prefix}/share/{arguments.package}" if arguments.share else prefix)
    return None


@contextmanager
def _node() -> Generator[Node]:
    signal.signal(signal.SIGINT, lambda *_: _interrupted.set())
    rclpy.init(
        args=["--ros-args", "--disable-external-lib-logs", "--disable-rosout-logs"],
        signal_handler_options=SignalHandlerOptions.NO,
    )
    node = rclpy.create_node(f"_ros2_stand_in_{os.getpid()}", start_parameter_services=False)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _spin(node: Node) -> None:
    rclpy.spin_once(node, timeout_sec=0.05)
    if _interrupted.is_set():
        raise KeyboardInterrupt


def _wait(node: Node, condition: Callable[[], Any], what: str) -> Any:
    deadline = time.monotonic() + _PATIENCE
    while not (found := condition()):
        if time.monotonic() > deadline:
            raise _ConversationError(f"waited {_PATIENCE} s in vain: {what}")
        _spin(node)
    return found


def _result(node: Node, future: Future) -> Any:
    return _wait(node, lambda: future.done() and future.result(), "an answer")


def _call(node: Node, kind: Any, name: str, request: Any = None) -> Any:
    client = node.create_client(kind, name)
    _wait(node, client.service_is_ready, f"service {name}")
    return _result(node, client.call_async(request or kind.Request()))


@contextmanager
def _parameters(node: Node, name: str) -> Generator[AsyncParameterClient]:
    _find_node(node, name)
    client = AsyncParameterClient(node, name)
    _wait(node, client.services_are_ready, f"parameter services of {name}")
    yield client


def _nodes(node: Node) -> list[str]:
    found = node.get_node_names_and_namespaces()
    return sorted(f"{space.rstrip('/')}/{name}" for name, space in found if name[0] != "_")


def _find_node(node: Node, name: str) -> None:
    try:
        _wait(node, lambda: name in _nodes(node), name)
    except _ConversationError:
        raise _ConversationError("Node not found") from None


def _settled(node: Node, query: Callable[[], Any]) -> Any:
    """The state of the graph after it has not changed for a while and has a node."""
    _wait(node, lambda: _nodes(node), "nodes")
    found, since = query(), time.monotonic()
    while time.monotonic() < since + _SETTLED:
        _spin(node)
        if query() != found:
            found, since = query(), time.monotonic()
    return found


def _type_of(node: Node, topic: str) -> str:
    def types() -> list[str]:
        return dict(node.get_topic_names_and_types()).get(topic, [])

    try:
        return _wait(node, types, topic)[0]
    except _ConversationError:
        raise _ConversationError(f"Unknown topic '{topic}'") from None


def _subscribe(
    node: Node, topic: str, callback: Callable[[Any], None], kind: str | None = None
) -> None:
    """Subscribe as `ros2 topic` does: reliably if all publishers are reliable."""
    message = _type(kind or _type_of(node, topic), "msg")
    if kind is None:
        _wait(node, lambda: node.count_publishers(topic), f"a publisher of {topic}")
    offered = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    reliable = all(each.reliability == QoSReliabilityPolicy.RELIABLE for each in offered)
    qos = QoSProfile(depth=10) if offered and reliable else qos_profile_sensor_data
    node.create_subscription(message, topic, callback, qos)


def _type(name: str, what: str) -> Any:
    package, *middle, kind = name.split("/")
    try:
        if middle not in ([], [what]):
            raise ValueError
        return getattr(importlib.import_module(f"{package}.{what}"), kind)
    except (ModuleNotFoundError, AttributeError, ValueError):
        described = {"msg": "message", "srv": "service"}[what]
        raise _ConversationError(f"The passed {described} type is invalid") from None


def _fill(message: Any, values: Mapping[str, Any]) -> None:
    """Set fields; raises AttributeError for one that does not exist."""
    for name, value in values.items():
        field = getattr(message, name)
        if hasattr(field, "get_fields_and_field_types"):
            _fill(field, value)
        else:
            setattr(message, name, value if isinstance(field, list) else type(field)(value))


def _plain(value: Any) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        names = value.get_fields_and_field_types()
        return {name: _plain(getattr(value, name)) for name in names}
    if isinstance(value, str | int | float | bytes):
        return value
    return [_plain(each) for each in value]


def _leaves(value: Any) -> list[Any]:
    if isinstance(value, Mapping):
        value = list(value.values())
    if not isinstance(value, list):
        return [value]
    return [leaf for each in value for leaf in _leaves(each)]


def _as_yaml(message: Any) -> str:
    plain = _plain(message)
    if not isinstance(plain, Mapping):
        return f"{message}\n"
    return yaml.dump(plain, sort_keys=False, allow_unicode=True, width=sys.maxsize)


if __name__ == "__main__":
    sys.exit(main())
