"""Every parameter of every node refuses bad values and accepts good ones unchanged."""

from typing import Any

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Parameter
from stickslip_ros.scenarios.files import load_scenario, parameter_file
from stickslip_ros.scenarios.parameter_group import NodeParameters
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from tests.scenarios.files import refusal, scenario_file
from tests.scenarios.values import CONFLICTS, MODELS, UNKNOWN, bad_values, bits, good_values

TEXTS = ["1" + 400 * "0", 5000 * "9", "0x" + 5000 * "f", "1e400", "[1]", "[yes]"]
models = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())


def changed_or_refused(model: NodeParameters, name: str, value: Any) -> NodeParameters | str:
    try:
        return model.changed({name: value}, "test")
    except InvalidInputError as error:
        return str(error)


@models
def test_bad_values_are_refused_with_name_value_and_what_is_allowed(model: NodeParameters) -> None:
    for parameter in model.known.values():
        for value in bad_values(parameter):
            with pytest.raises(InvalidInputError) as caught:
                model.changed({parameter.name: value}, "test")
            message = str(caught.value)
            assert message.startswith(f"test: {parameter.name} = {value!r:.80}")
            assert " is invalid: must be " in message
            assert parameter.bounds in message or parameter.limits in message
            assert len(message) < 300


@models
def test_good_values_are_taken_as_they_are(model: NodeParameters) -> None:
    """And all parameters, told one by one, make the same ones again."""
    names = {parameter.name for parameter in model.known.values()}
    for parameter in model.known.values():
        for value in good_values(parameter):
            changed = changed_or_refused(model, parameter.name, value)
            if isinstance(changed, str):
                assert any(each in changed for each in CONFLICTS)
                continue
            flat = changed.flat()
            assert bits(flat[parameter.name]) == bits(value)
            assert flat.keys() == names
            assert {type(each) for each in flat.values()} <= {bool, int, float, str, list}
            assert model.changed(flat, "test") == changed


@models
def test_unknown_names_are_refused(model: NodeParameters) -> None:
    for name, value in UNKNOWN.items():
        if name not in {parameter.name for parameter in model.known.values()}:
            with pytest.raises(InvalidInputError, match="unknown parameter") as caught:
                model.changed({name: value}, "test")
            assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("node", NODE_PARAMETERS)
def test_so_are_they_in_a_file_and_as_an_override(tmp_path: Any, node: str) -> None:
    def check(parameter: Parameter, message: str) -> None:
        assert "\n" not in message
        assert f"{parameter.name} = " in message
        assert " is invalid: must be " in message
        assert len(message) < 500

    for number, parameter in enumerate(NODE_PARAMETERS[node].known.values()):
        # ROS reads null as text.
        values = [each for each in bad_values(parameter) if each not in ([b"\1"], [None], None)]
        value = values[number % len(values)]
        path = scenario_file(tmp_path, parameter_file({node: {parameter.name: value}}))
        check(parameter, refusal(path))
        text = TEXTS[number % len(TEXTS)]
        if parameter.kind is not str or parameter.choices:
            law = node.removesuffix("_controller") if node.endswith("_controller") else None
            with pytest.raises(InvalidInputError) as caught:
                load_scenario("paper", [f"{node}.{parameter.name}={text}"], controller=law)
            check(parameter, str(caught.value))


def test_numbers_are_taken_or_refused_as_ros_reads_them() -> None:
    """What `stickslip run` takes, the nodes must be able to read from the file they get."""
    for text in ("5e-324", "1e-400", "-1e-310", "1e309", "-1e999"):
        assert f"damping = '{text}' is invalid" in refusal("paper", f"plant.damping={text}")
    for text in ("0e-400", "0.0", "-0.0", "2.2250738585072014e-308"):
        scenario = load_scenario("paper", [f"plant.belt_speed={text}"])
        assert bits(scenario.plant.belt_speed) == bits(float(text))
