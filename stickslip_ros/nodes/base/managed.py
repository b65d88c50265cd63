"""What every node of this package has: life cycle, parameters from one model, diagnostics."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar, cast

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.messages.topics import DIAGNOSTICS, Topic, mismatch, type_name
from stickslip_ros.nodes.base.polling import Collecting
from stickslip_ros.scenarios.files import LONGEST_NAMESPACE
from stickslip_ros.scenarios.parameter import Fixed, known_parameters
from stickslip_ros.scenarios.parameter import Parameter as OwnParameter
from stickslip_ros.scenarios.parameters import NodeParameters
from stickslip_ros.scenarios.ros_yaml import number_in
from stickslip_ros.text import shown

ParametersT = TypeVar("ParametersT", bound=NodeParameters)

RCLError: type[Exception] = rclpy_implementation.RCLError

Level = bytes
OK: Level = DiagnosticStatus.OK
WARN: Level = DiagnosticStatus.WARN
ERROR: Level = DiagnosticStatus.ERROR

STATE = "state"
"""Key under which a node's diagnostics say in which state of its life cycle it is."""

_DIAGNOSTICS_PERIOD = 1.0
_AUTOSTART_PERIOD = 0.05
_DELIVERY_TIMEOUT = 1.0
_LARGEST_ON_SLIDER = 2**31 - 1
_OWNED_BY_ROS = ("start_type_description_service",)


class ManagedNode(Collecting, LifecycleNode, ABC, Generic[ParametersT]):
    """A managed (lifecycle) node whose parameters come from one validated model.

    A subclass says in `connect`, `start` and `stop` what it does when it is configured, activated
    and deactivated; what they raise is logged and makes the transition fail.
    """

    def __init__(
        self,
        name: str,
        model: type[ParametersT],
        *,
        context: Context | None = None,
        namespace: str | None = None,
        overrides: Mapping[str, Any] | None = None,
    ) -> None:
        """Declare the parameters: those of the command line, then `overrides` by flat name.

        Raises InvalidInputError for a parameter that is refused.
        """
        given = [Parameter(name, value=value) for name, value in (overrides or {}).items()]
        try:
            super().__init__(
                name,
                context=context,
                namespace=namespace,
                parameter_overrides=given,
                automatically_declare_parameters_from_overrides=True,
            )
        except (ParameterException, ValueError) as error:  # an empty list, for one
            raise InvalidInputError(
                f"{name}: ROS refuses a parameter (an empty list is to be left out): {error}"
            ) from None
        except (NameValidationException, RCLError) as error:
            raise InvalidInputError(
                f"{name}: ROS refuses to make the node, maybe because its namespace has more than "
                f"{LONGEST_NAMESPACE} characters: {first_line(error)}"
            ) from None
        self.stopped = Future()
        """Done when the node's process may end; carries the refusal, if that was the reason."""
        self.active = False
        """Whether the node is in the state active."""
        self.steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        """Wall time, whatever simulated time does."""
        self._model = model
        self.parameters = self._declare(model)
        """The parameters in force."""
        self._connections: list[Any] = []
        self._last_refusal = ""
        self._waiting = False
        self._diagnostics = self.create_publisher(
            DIAGNOSTICS.type, DIAGNOSTICS.name, DIAGNOSTICS.qos()
        )
        self.every(_DIAGNOSTICS_PERIOD, self.publish_diagnostics)
        self._autostart_timer: Timer | None = None
        if self.parameters.autostart:
            self._autostart_timer = self.every(_AUTOSTART_PERIOD, self._autostart)

    @abstractmethod
    def connect(self) -> None:
        """Make publishers and subscriptions and prepare what takes time (configure)."""

    @abstractmethod
    def start(self) -> None:
        """Begin to work (activate)."""

    @abstractmethod
    def stop(self) -> None:
        """Stop working (deactivate)."""

    def apply_parameters(self) -> None:
        """Act on `self.parameters` having changed while the node lives."""

    def diagnose(self) -> tuple[Level, str, dict[str, Any]]:
        """Return the node's health, a sentence on it, and figures."""
        return OK, "", {}

    def heard(self) -> set[str]:
        """Return the names of the nodes that are there for it, besides those that read from it."""
        return set()

    def every(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call back every `period` seconds of wall time."""
        return self.create_timer(period, callback, clock=self.steady_clock)

    def call_soon(self, callback: Callable[[], None]) -> None:
        """Call back from the executor, behind what it has to do already; from any thread."""
        if self.executor is not None:
            self.executor.create_task(callback)

    def advertise(self, topic: Topic, depth: int | None = None) -> Publisher:
        """Publish a topic until the node is cleaned up."""
        publisher = self.create_publisher(topic.type, topic.name, topic.qos(depth))
        self._connections.append(publisher)
        return publisher

    def subscribe(
        self, topic: Topic, callback: Callable[[bytes], None], depth: int | None = None
    ) -> Subscription:
        """Pass the serialized messages of a topic to `callback` until the node is cleaned up."""
        subscription = self.create_subscription(
            topic.type, topic.name, callback, topic.qos(depth), raw=True
        )
        self._connections.append(subscription)
        return subscription

    def collect(self, topic: Topic) -> Subscription:
        """Let the serialized messages of a topic wait until they are taken."""
        subscription = self.collect_from(topic, topic.qos())
        self._connections.append(subscription)
        return subscription

    def disconnect(self, connection: Any) -> None:
        """Give up what `connect` or `start` has made, before the node is cleaned up."""
        self._connections.remove(connection)
        # The node has to let go of it, too: what is only destroyed by itself goes on to be heard.
        match connection:
            case Publisher():
                self.destroy_publisher(connection)
            case Subscription():
                self.destroy_subscription(connection)
            case Service():
                self.destroy_service(connection)
            case Timer():
                self.destroy_timer(connection)
            case _:
                connection.destroy()

    def wait_for_delivery(self, publisher: Publisher) -> None:
        """Wait, within bounds, until every reader has what was published."""
        publisher.wait_for_all_acked(Duration(seconds=_DELIVERY_TIMEOUT))

    def publish_diagnostics(self) -> None:
        """Publish the node's health."""
        level, message, figures = self.diagnose()
        status = DiagnosticStatus(
            level=level,
            name=self.get_fully_qualified_name(),
            message=message or self._state_machine.current_state[1],
            values=[
                KeyValue(key=key, value=str(value))
                for key, value in {STATE: self._state_machine.current_state[1], **figures}.items()
            ],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def refuse(self, error: InvalidInputError) -> None:
        """End the process because of what came in."""
        if not self.stopped.done():
            self.stopped.set_result(error)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Connect."""
        self._waiting = False
        return self._transition(self.connect, "configured")

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start, if those waited for are there."""
        missing = self.unmatched()
        if missing:
            self._tell_waiting(missing)
            return TransitionCallbackReturn.FAILURE
        self._waiting = False
        result = self._transition(self.start, "active")
        self.active = result is TransitionCallbackReturn.SUCCESS
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop."""
        return self._transition(self._stop_and_tell, "paused")

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Disconnect."""
        return self._transition(self._disconnect, "cleaned up")

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop if need be, and disconnect."""
        if self.active:
            self._transition(self._stop_and_tell)
        return self._transition(self._disconnect)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Disconnect, to start afresh."""
        return self._transition(self._disconnect)

    def _stop_and_tell(self) -> None:
        try:
            self.stop()
            self.publish_diagnostics()
        finally:
            self.active = False

    def _disconnect(self) -> None:
        for connection in list(self._connections):
            self.disconnect(connection)

    def _transition(self, action: Callable[[], None], done: str = "") -> TransitionCallbackReturn:
        """Do what a transition asks for, and log what the node is then."""
        try:
            action()
        except InvalidInputError as error:
            if self._autostart_timer is not None:
                self.refuse(error)
            elif str(error) != self._last_refusal:  # whoever brings us up may try again and again
                self._last_refusal = str(error)
                self.get_logger().error(self._last_refusal)
            return TransitionCallbackReturn.FAILURE
        except Exception as error:  # rclpy would swallow it without a word
            self.get_logger().error(f"{type(error).__name__}: {error}")
            self._end_autostart()
            return TransitionCallbackReturn.ERROR
        if done:
            self.get_logger().info(done)
        return TransitionCallbackReturn.SUCCESS

    def _tell_waiting(self, missing: str) -> None:
        """Log once, until the node is active, whom it waits for."""
        if not self._waiting:
            self._waiting = True
            whom = " for " + ", ".join(self.parameters.wait_for) if self.parameters.wait_for else ""
            self.get_logger().info(f"waiting{whom}: {missing}")

    def _autostart(self) -> None:
        """Configure, then try to activate until those waited for are there."""
        if self._state_machine.current_state[1] == "unconfigured":
            self.trigger_configure()
        # In one go, if nobody is missing: a plant may take whoever is there for one that answers.
        if self._state_machine.current_state[1] == "inactive":
            missing = self.unmatched()
            if missing:
                self._tell_waiting(missing)
            else:
                self.trigger_activate()
        if self.active or self.stopped.done():
            self._end_autostart()

    def _end_autostart(self) -> None:
        if self._autostart_timer is not None:
            self._autostart_timer.cancel()
            self._autostart_timer = None

    def unmatched(self) -> str:
        """Return what is missing of the nodes waited for, or nothing."""
        waiting_for = {name.rsplit("/", 1)[-1] for name in self.parameters.wait_for}
        if not waiting_for:
            return ""
        found = self.heard()
        for end in self._connections:
            if isinstance(end, Publisher):
                readers = [
                    reader
                    for reader in self.get_subscriptions_info_by_topic(end.topic_name)
                    if reader.topic_type == type_name(end.msg_type)
                    and not mismatch(end.qos_profile, reader.qos_profile)
                ]
                found |= {reader.node_name for reader in readers}
                matched = end.get_subscription_count() >= len(readers)
            elif isinstance(end, Subscription):
                writers = [
                    writer
                    for writer in self.get_publishers_info_by_topic(end.topic_name)
                    if writer.topic_type == type_name(end.msg_type)
                    and not mismatch(writer.qos_profile, end.qos_profile)
                ]
                matched = end.get_publisher_count() >= len(writers)
            else:
                continue
            if not matched:
                return f"{end.topic_name} is not yet matched"
        absent = waiting_for - found
        return f"not there: {', '.join(sorted(absent))}" if absent else ""

    def _declare(self, model: type[ParametersT]) -> ParametersT:
        given = {
            name: cast(Parameter, parameter).value
            for name, parameter in self.get_parameters_by_prefix("").items()
            if name not in _OWNED_BY_ROS
        }
        validated = model.validated(given, self.get_fully_qualified_name())
        for parameter in known_parameters(model).values():
            if parameter.name == "use_sim_time":
                continue  # declared by rclpy
            if self.has_parameter(parameter.name):
                self.undeclare_parameter(parameter.name)
            self.declare_parameter(
                parameter.name,
                _ROS_TYPES[parameter.kind],
                _descriptor(parameter),
                ignore_override=True,
            )
        super().set_parameters(self._as_ros(validated.flat()))
        return validated

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Set each parameter by itself."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set all parameters or none; what is refused is named, with what is allowed.

        Whole numbers are taken where numbers are declared, as parameter files and -p do, and text
        that is a number: `ros2 param load` sends inf and 1e-05 in no other way. It also sends back
        what ROS keeps to itself, which may be as it is.
        """
        given = {parameter.name: parameter for parameter in parameter_list}
        owned = [
            parameter
            for name, parameter in given.items()
            if name in _OWNED_BY_ROS and parameter.value != self.get_parameter(name).value
        ]
        values = {n: self._as_meant(n, p.value) for n, p in given.items() if n not in _OWNED_BY_ROS}
        source = self.get_fully_qualified_name()
        try:
            changed = self._model.validated(self.parameters.flat() | values, source)
            self._check_fixed(values, source)
        except InvalidInputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        flat = changed.flat()
        taken = self._as_ros({name: flat[name] for name in values})
        result = super().set_parameters_atomically([*owned, *taken])
        if result.successful:
            self.parameters = changed
            self.apply_parameters()
        return result

    def _check_fixed(self, values: Mapping[str, Any], source: str) -> None:
        """Refuse to change what must stay in the present state."""
        present = self.parameters.flat()
        known = known_parameters(self._model)
        configured = self._state_machine.current_state[1] != "unconfigured"
        states = {Fixed.NEVER: False, Fixed.ACTIVE: self.active, Fixed.CONFIGURED: configured}
        for name, value in values.items():
            fixed = known[name].fixed
            if states[fixed] and value != present[name]:
                raise InvalidInputError(
                    f"{source}: {name} = {shown(value)} is refused: {name} cannot be changed while "
                    f"the node is {fixed}, and is {shown(present[name])}"
                )

    def _as_meant(self, name: str, value: Any) -> Any:
        known = known_parameters(self._model)
        if isinstance(value, str) and name in known and known[name].kind is float:
            number = number_in(value)
            return value if number is None else number
        return value

    def _as_ros(self, values: Mapping[str, Any]) -> list[Parameter]:
        known = known_parameters(self._model)
        return [Parameter(name, _ROS_TYPES[known[name].kind], v) for name, v in values.items()]


def first_line(error: Exception) -> str:
    """Return what an exception of ROS's says, without where in its code and what follows."""
    return str(error).strip().split("\n", 1)[0].split(", at ", 1)[0].rstrip(":")


_ROS_TYPES = {
    bool: Parameter.Type.BOOL,
    int: Parameter.Type.INTEGER,
    float: Parameter.Type.DOUBLE,
    str: Parameter.Type.STRING,
    list: Parameter.Type.STRING_ARRAY,
}


def _descriptor(parameter: OwnParameter) -> ParameterDescriptor:
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    descriptor = ParameterDescriptor(
        name=parameter.name,
        description=parameter.meaning + unit,
        additional_constraints=parameter.bounds,
    )
    # rqt_reconfigure makes a slider of a range, which fails with an infinite end or a long integer.
    if parameter.range is not None and parameter.kind is float:
        least, largest = parameter.range
        descriptor.floating_point_range = [FloatingPointRange(from_value=least, to_value=largest)]
    elif parameter.range is not None and parameter.range[1] <= _LARGEST_ON_SLIDER:
        least, largest = (int(end) for end in parameter.range)
        descriptor.integer_range = [IntegerRange(from_value=least, to_value=largest)]
    return descriptor
