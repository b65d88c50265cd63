"""ROS parameters of a node, from a group of parameters."""

from collections.abc import Mapping
from typing import Any, Generic, TypeVar, cast

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Changes
from stickslip_ros.model.constants import Parameter as ModelParameter
from stickslip_ros.scenarios import LONGEST_NAMESPACE
from stickslip_ros.scenarios.parameter_group import NodeParameters
from stickslip_ros.scenarios.ros_yaml import number_in
from stickslip_ros.text import shown

ParametersT = TypeVar("ParametersT", bound=NodeParameters)

_RCL_ERROR: type[Exception] = rclpy_implementation.RCLError
_OWNED_BY_ROS = ("start_type_description_service",)
_ROS_TYPES = {
    bool: Parameter.Type.BOOL,
    int: Parameter.Type.INTEGER,
    float: Parameter.Type.DOUBLE,
    str: Parameter.Type.STRING,
    list: Parameter.Type.STRING_ARRAY,
}


def first_line(error: Exception) -> str:
    """Return the message of a ROS exception without the place in its source code."""
    return str(error).strip().split("\n", 1)[0].split(", at ", 1)[0].rstrip(":")


class ParameterNode(LifecycleNode, Generic[ParametersT]):
    """A lifecycle node with a group of parameters, fixed in the states that these say."""

    def __init__(
        self,
        name: str,
        defaults: ParametersT,
        *,
        overrides: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        """Declare the parameters: values of the command line, then `overrides` by flat name.

        Others are at their `defaults`. The other options are those of `rclpy.node.Node`.

        Raises InvalidInputError for a parameter that is refused.
        """
        given = [Parameter(name, value=value) for name, value in (overrides or {}).items()]
        try:
            super().__init__(
                name,
                parameter_overrides=given,
                automatically_declare_parameters_from_overrides=True,
                **options,
            )
        except (ParameterException, ValueError) as error:  # an empty list, for one
            raise InvalidInputError(
                f"{name}: ROS refuses a parameter (omit an empty list): {error}"
            ) from None
        except (NameValidationException, _RCL_ERROR) as error:
            raise InvalidInputError(
                f"{name}: ROS refuses to make the node, possibly because its namespace has more "
                f"than {LONGEST_NAMESPACE} characters: {first_line(error)}"
            ) from None
        self.active = False
        """Whether the node is in the state active."""
        self._known = defaults.known
        self.parameters = self._declare(defaults)
        """The parameters in effect."""

    @property
    def lifecycle_state(self) -> str:
        """`unconfigured`, `inactive`, `active` or `finalized`, or that of a transition."""
        return self._state_machine.current_state[1]

    @property
    def configured(self) -> bool:
        """Whether the node is in any state but unconfigured."""
        return self.lifecycle_state != "unconfigured"

    def apply_parameters(self) -> None:
        """Use the new `self.parameters` after a change."""

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Set each parameter by itself."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set all parameters or none; a refusal names the parameter and what is allowed.

        Integers are accepted for numbers, as in parameter files and with -p, and so is text that is
        a number: `ros2 param load` sends inf and 1e-05 in this way. It also sends the parameters
        that ROS itself declares; these are accepted if unchanged. What has no effect is accepted,
        with the reason: one by one, constants come before their law, and those of a ramp must.
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
            # First of all: a request from the network must not make the node read a file.
            self._check_fixed(values, source)
            changed = self.parameters.changed(values, source)
        except InvalidInputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        flat = changed.flat()
        taken = self._as_ros({name: flat[name] for name in values})
        result = super().set_parameters_atomically([*owned, *taken])
        if result.successful:
            unused = changed.unused().items()
            before, self.parameters = self.parameters.flat(), changed
            self.apply_parameters()
            new = (f"{source}: {why}" for name, why in unused if flat[name] != before[name])
            result.reason = "; ".join(new)
        return result

    def _declare(self, defaults: ParametersT) -> ParametersT:
        given = {
            name: cast(Parameter, parameter).value
            for name, parameter in self.get_parameters_by_prefix("").items()
            if name not in _OWNED_BY_ROS
        }
        validated = defaults.changed(given, self.get_fully_qualified_name())
        for name, parameter in self._known.items():
            if name == "use_sim_time":
                continue  # declared by rclpy
            if self.has_parameter(name):
                self.undeclare_parameter(name)
            self.declare_parameter(
                name, _ROS_TYPES[parameter.kind], _descriptor(parameter), ignore_override=True
            )
        super().set_parameters(self._as_ros(validated.flat()))
        return validated

    def _check_fixed(self, values: Mapping[str, Any], source: str) -> None:
        """Refuse changes of parameters that are fixed in the present state."""
        present = self.parameters.flat()
        states = {
            Changes.LIVE: ("", False),
            Changes.AT_REST: ("active", self.active),
            Changes.AT_BUILD: ("configured", self.configured),
            Changes.AT_START: ("running", True),
        }
        for name, value in values.items():
            if name not in self._known:
                continue
            state, fixed = states[self._known[name].changes]
            if fixed and value != present[name]:
                raise InvalidInputError(
                    f"{source}: {name} = {shown(value)} is refused: {name} cannot be changed while "
                    f"the node is {state}, and is {shown(present[name])}"
                )

    def _as_meant(self, name: str, value: Any) -> Any:
        if isinstance(value, str) and name in self._known and self._known[name].kind is float:
            number = number_in(value)
            return value if number is None else number
        return value

    def _as_ros(self, values: Mapping[str, Any]) -> list[Parameter]:
        return [
            Parameter(name, _ROS_TYPES[self._known[name].kind], v) for name, v in values.items()
        ]


def _descriptor(parameter: ModelParameter) -> ParameterDescriptor:
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    descriptor = ParameterDescriptor(
        name=parameter.name,
        description=parameter.meaning + unit,
        additional_constraints=parameter.bounds,
    )
    # rqt_reconfigure makes a slider for a range; it fails for infinite ends and long integers.
    if parameter.range is not None and parameter.kind is float:
        least, largest = parameter.range
        descriptor.floating_point_range = [FloatingPointRange(from_value=least, to_value=largest)]
    elif parameter.range is not None and parameter.range[1] < 2**31:
        least, largest = (int(end) for end in parameter.range)
        descriptor.integer_range = [IntegerRange(from_value=least, to_value=largest)]
    return descriptor
