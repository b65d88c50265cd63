"""The tables of parameters: those of a scenario, and those that were recorded."""

import json
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from math import inf

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Parameter
from stickslip_ros.scenarios.parameter_group import NodeParameters
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.scenarios.scenario import DEFAULT, Scenario
from stickslip_ros.scenarios.template import own_first
from stickslip_ros.show.quantities import Units
from stickslip_ros.tables import TextTable

_COMMON = set(NodeParameters().known)
"""What all nodes have: how they start, and their clock."""

_MESSAGES = {
    *("pace", "real_time_factor", "force_timeout", "reply_timeout", "command_rule", "force_type"),
    *("force_number", "command_timeout", "effort", "slide_name", "belt_name", "flow_window"),
    *("publish_clock", "publish_truth"),
}
"""How a plant exchanges messages, which has no effect on a result without nodes."""

_OFF = (0.0, inf, "", "none", "exact", "ideal")
"""Values at which, if they are the default, a part of the model is not there."""


def scenario_tables(
    scenario: Scenario, *, unused: Collection[str] | None = None
) -> Iterator[TextTable]:
    """Yield the parameters of each node: value, unit, and where the value comes from.

    With names that are `unused` in a result without nodes, NODE or NODE.PARAMETER, these and what
    has no effect there are left out.
    """
    units = Units.for_drive(scenario.plant.as_drive())
    for node, values in scenario.as_dict().items():
        left_out = set[str]()
        if unused is not None:
            left_out = _without_effect(getattr(scenario, node)) | _MESSAGES
        rows = [
            [
                parameter.name,
                _text(parameter, values[parameter.name]),
                _unit(node, parameter, units),
                scenario.sources.get(f"{node}.{parameter.name}", DEFAULT),
            ]
            for parameter in own_first(NODE_PARAMETERS[node])
            if parameter.name not in left_out
            and {node, f"{node}.{parameter.name}"}.isdisjoint(unused or ())
            and (
                unused is None or node != "analyzer" or parameter.default != values[parameter.name]
            )
        ]
        if rows:
            yield TextTable("", [node, "value", "unit", "from"], rows)


def recorded_tables(recorded: Mapping[str, Mapping[str, str]], units: Units) -> Iterator[TextTable]:
    """Yield what was recorded of each node: texts by node and name, with units where known."""
    for node, texts in recorded.items():
        known = NODE_PARAMETERS[node].known if node in NODE_PARAMETERS else {}
        left_out = _recorded_without_effect(node, texts)
        rows = [
            [name, text.strip('"'), _unit(node, known[name], units) if name in known else ""]
            for name, text in texts.items()
            if name not in left_out
        ]
        yield TextTable("", [node, "value", "unit"], rows)


def _without_effect(parameters: NodeParameters) -> set[str]:
    """Return the parameters that have no effect beside the others: off, or "as forward"."""
    off = {
        name
        for name, value in parameters.flat().items()
        if value != value or (value in _OFF and value == parameters.known[name].default)
    }
    return off | {name for name, _ in parameters.not_used()} | _COMMON


def _recorded_without_effect(node: str, texts: Mapping[str, str]) -> set[str]:
    """Return the same of recorded parameters; of a friction curve in a file, none."""
    with suppress(KeyError, RecursionError, ValueError, InvalidInputError):
        known = NODE_PARAMETERS[node]
        values = {name: json.loads(text) for name, text in texts.items() if name in known.known}
        if not any(value for name, value in values.items() if name.endswith("file")):
            return _without_effect(known.changed(values, node))
    return _COMMON


def _unit(node: str, parameter: Parameter, units: Units) -> str:
    """Return the unit; where the drive is dimensionless, so are the parameters of the loop."""
    unit = parameter.unit or ""
    return unit if node == "analyzer" else units.of_unit(unit)


def _text(parameter: Parameter, value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else parameter.text(value)
