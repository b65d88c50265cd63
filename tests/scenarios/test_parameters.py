"""The models of the nodes' parameters, and the values derived from them."""

from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.disturbance import Disturbance, DisturbanceKind
from stickslip_ros.physics.model.friction import LAWS
from stickslip_ros.scenarios.parameter_field import Parameter, parameters_of
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, NodeParameters, PlantParameters

# Names and units that people rely on, by node.
UNITS: dict[str, dict[str, str | None]] = {
    "plant": {
        "mass": "kg",
        "damping": "N s/m",
        "stiffness": "N/m",
        "normal_force": "N",
        "belt_speed": "m/s",
        "friction.law": None,
        "friction.static": None,
        "friction.minimum": None,
        "friction.minimum_speed": "m/s",
        "friction.slope": "s/m",
        "friction.kinetic": None,
        "friction.decay_speed": "m/s",
        "friction.viscous": "s/m",
        "friction.exponent": None,
        "friction.file": None,
        "friction.reverse.static": None,
        "friction.reverse.minimum_speed": "m/s",
        "friction.reverse.file": None,
        "initial.position": "m",
        "initial.velocity": "m/s",
        "rate": "Hz",
        "pace": None,
        "real_time_factor": None,
        "force_delay": "s",
        "force_jitter": "s",
        "force_jitter_seed": None,
        "force_timeout": "s",
        "reply_timeout": "s",
        "expects_control": None,
        "flow_window": "samples",
        "publish_clock": None,
        "disturbance.kind": None,
        "disturbance.amplitude": "N",
        "disturbance.start": "s",
        "disturbance.duration": "s",
        "disturbance.frequency": "Hz",
        "disturbance.file": None,
        "load.kind": None,
        "load.amplitude": "N",
        "load.start": "s",
        "load.duration": "s",
        "load.frequency": "Hz",
        "load.file": None,
        "belt.kind": None,
        "belt.amplitude": "m/s",
        "belt.start": "s",
        "belt.duration": "s",
        "belt.frequency": "Hz",
        "belt.file": None,
    },
    "washout_controller": {
        "corner_frequency": "rad/s",
        "linear_gain": "N s/m",
        "cubic_gain": "N s^3/m^3",
        "force_limit": "N",
        "start_after": "s",
    },
    "velocity_feedback_controller": {
        "velocity_gain": "N s/m",
        "position_gain": "N/m",
        "force_limit": "N",
        "start_after": "s",
    },
    "analyzer": {"bag": None, "window": "cycles", "flush_period": "s", "compression": None},
}
# Those that the scenario `paper` does not give.
DEFAULTS: dict[str, dict[str, Any]] = {
    "plant": {
        "real_time_factor": 1.0,
        "force_delay": 0.0,
        "force_jitter": 0.0,
        "force_timeout": 0.1,
        "reply_timeout": 10.0,
        "expects_control": True,
        "flow_window": 1000,
        "publish_clock": False,
        "disturbance.kind": "none",
        "load.kind": "none",
        "belt.kind": "none",
    },
    "washout_controller": {"force_limit": float("inf")},
    "velocity_feedback_controller": {"force_limit": float("inf"), "position_gain": 0.0},
    "analyzer": {"bag": "", "window": 20, "flush_period": 1.0, "compression": "lz4"},
}
# Only while a node is not active; every physical parameter and gain can be set at any time.
FIXED: dict[str, set[str]] = {
    "plant": {"rate", "pace"},
    "washout_controller": set(),
    "velocity_feedback_controller": set(),
    "analyzer": {"bag", "window"},
}
nodes = pytest.mark.parametrize("node", NODE_PARAMETERS)


def known(node: str) -> dict[str, Parameter]:
    return {parameter.name: parameter for parameter in parameters_of(NODE_PARAMETERS[node])}


@nodes
def test_names_and_units(node: str) -> None:
    parameters = known(node)
    assert {name: parameters[name].unit for name in UNITS[node]} == UNITS[node]


@nodes
def test_defaults(node: str) -> None:
    expected = DEFAULTS[node] | {"autostart": True, "wait_for": []}
    values = NODE_PARAMETERS[node]().flat()
    assert {name: values[name] for name in expected} == expected
    for name, parameter in known(node).items():
        assert values[name] == parameter.default or values[name] is parameter.default  # nan


@nodes
def test_what_may_change_while_active(node: str) -> None:
    fixed = {name for name, parameter in known(node).items() if parameter.fixed}
    assert fixed >= FIXED[node]
    physical = {name for name, unit in UNITS[node].items() if unit not in (None, "s", "Hz")}
    assert not fixed & (physical - {"window", "flow_window"})


@nodes
def test_every_parameter_is_described(node: str) -> None:
    for parameter in parameters_of(NODE_PARAMETERS[node]):
        assert parameter.meaning.endswith(".")
        assert parameter.kind in (bool, int, float, str, list)
        if parameter.choices:
            assert parameter.default in parameter.choices


def test_every_friction_law_can_be_chosen_and_made() -> None:
    assert known("plant")["friction.law"].choices == tuple(LAWS)
    for name, law in LAWS.items():
        if name == "table":  # it needs a file
            continue
        plant = PlantParameters.validated({"friction.law": name}, "test")
        assert type(plant.as_drive().friction) is law


# Name, default, bounds and meaning that people rely on.
FRICTION = [
    (
        "curve",
        "exponential",
        "one of stribeck, coulomb, linear, exponential, table",
        "Static law that a law with a memory has in steady slip "
        "(lugre, elasto_plastic, maxwell_slip).",
    ),
    ("static", 0.4, "at least 0", "Static (break-away) coefficient mu_s."),
    ("minimum", 0.25, "at least 0", "Smallest kinetic coefficient mu_m (stribeck)."),
    (
        "minimum_speed",
        0.5,
        "above 0",
        "Relative speed v_m at which the coefficient is smallest (stribeck).",
    ),
    ("viscous", 0.0, "", "Increase of the coefficient with speed (coulomb, exponential)."),
    ("slope", 0.45, "", "Decrease of the coefficient with relative speed (linear)."),
    ("kinetic", 0.25, "at least 0", "Kinetic coefficient mu_k (exponential, rate_state)."),
    ("decay_speed", 0.5, "above 0", "Speed v_s of the decay from mu_s to mu_k (exponential)."),
    ("exponent", 1.0, "at least 1", "Exponent n of the decay from mu_s to mu_k (exponential)."),
]


def test_the_constants_of_the_laws_are_parameters() -> None:
    found = [each for each in known("plant").values() if each.name.startswith("friction.")]
    assert [
        (each.name.removeprefix("friction."), each.default, each.bounds, each.meaning)
        for each in found[1 : len(FRICTION) + 1]
    ] == FRICTION
    assert {each.kind for each in found[2 : len(FRICTION) + 1]} == {float}


def test_a_law_gets_the_constants_of_its_formula() -> None:
    values = {"static": 0.5, "kinetic": 0.3, "decay_speed": 0.07, "viscous": 0.02}
    flat = {f"friction.{name}": value for name, value in values.items()}
    plant = PlantParameters.validated({"friction.law": "exponential", **flat}, "test")
    assert vars(plant.as_drive().friction) == {**values, "exponent": 1.0}


def test_the_disturbance_of_a_plant() -> None:
    values = {"kind": "sine", "amplitude": 3.0, "start": 1.0, "duration": 2.0, "frequency": 4.0}
    flat = {f"disturbance.{name}": value for name, value in values.items()}
    found = PlantParameters.validated(flat, "test").as_disturbance()
    assert found == Disturbance(DisturbanceKind.SINE, 3.0, 1.0, 2.0, 4.0)


@pytest.mark.parametrize(
    ("duration", "rate", "last"),
    [(2.0, 100.0, 200), (0.1, 3.0, 0), (float("inf"), 100.0, None), (1e308, 100.0, None)],
)
def test_the_last_sample_of_a_plant(duration: float, rate: float, last: int | None) -> None:
    plant = PlantParameters.validated({"duration": duration, "rate": rate}, "test")
    assert plant.last_sample == last


@pytest.mark.parametrize("name", ["1bad", "", "a-b", "/", "a//b", "a/", "a/1b", "ä", "a\n"])
def test_no_node_is_waited_for_that_cannot_be(name: str) -> None:
    with pytest.raises(InvalidInputError, match=r"test: wait_for = .* must be names of nodes"):
        PlantParameters.validated({"wait_for": ["plant", name]}, "test")


def test_parameters_cannot_be_assigned() -> None:
    with pytest.raises(ValidationError):
        PlantParameters().mass = 2.0


@st.composite
def values_of(draw: st.DrawFn, model: type[NodeParameters]) -> dict[str, Any]:
    """Values for some of the parameters, within all bounds."""
    numbers = st.floats(1e-3, 1e3)
    strategies: dict[type, st.SearchStrategy[Any]] = {
        bool: st.booleans(),
        int: st.integers(200, 4_000),
        float: numbers | st.integers(1, 1000),
        str: st.text(),
        list: st.lists(st.from_regex("/?([A-Z]+/)?[a-z_][a-z0-9_]*", fullmatch=True)),
    }
    parameters = {parameter.name: parameter for parameter in parameters_of(model)}
    values: dict[str, Any] = {}
    for name in sorted(draw(st.sets(st.sampled_from(sorted(parameters))))):
        kind, choices = parameters[name].kind, parameters[name].choices
        values[name] = draw(st.sampled_from(choices) if choices else strategies[kind])
    if any(name.endswith((".static", ".minimum", ".kinetic")) for name in values):
        # The largest of the coefficients.
        values |= {"friction.static": 1e6, "friction.reverse.static": 1e6}
    assume(values.get("friction.law") not in ("table", "rate_state"))  # a file; ratios of constants
    values.pop("friction.curve", None)
    values |= {"friction.break_away": 0.5} if "friction.break_away" in values else {}
    values |= {"friction.elements": 3} if "friction.elements" in values else {}
    values |= {"sensor.difference_samples": 3} if "sensor.difference_samples" in values else {}
    values.pop("sensor.velocity", None)  # a difference has no noise of its own
    for name in values.keys() & {"friction.exponent", "friction.reverse.exponent"}:
        values[name] = 2.0
    for part in ("belt", "load", "disturbance"):
        values.pop(f"{part}.kind", None)  # it makes demands on the others
    if values.keys() & {"mass", "stiffness", "rate"}:
        values |= {"rate": 1e3}  # above all natural frequencies
    return values


@nodes
@given(data=st.data())
def test_flat_values_give_the_parameters_again(node: str, data: st.DataObject) -> None:
    model = NODE_PARAMETERS[node]
    values = data.draw(values_of(model))
    delay = values.get("force_delay", 0.0) + values.get("force_jitter", 0.0)
    assume(delay * values.get("rate", 100.0) <= 1e6)
    parameters = model.validated(values, "test")
    flat = parameters.flat()
    assert {name: flat[name] for name in values} == values
    assert set(flat) == set(known(node))
    assert {type(value) for value in flat.values()} <= {bool, int, float, str, list}
    assert model.validated(flat, "test") == parameters
