"""With any parameters, `simulate` ends with finite results or with a refusal."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from math import isfinite
from typing import Any

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from stickslip_ros.errors import StickslipError
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.studies.simulate import simulate
from tests.examples import examples
from tests.scenarios.values import good_values

PAPER = load_scenario("paper")
SAMPLES = 100


@st.composite
def extremes(draw: st.DrawFn, node: str) -> dict[str, Any]:
    """Values of some parameters of a node, at their bounds more often than not."""
    known = {parameter.name: parameter for parameter in NODE_PARAMETERS[node].known.values()}
    names = draw(st.sets(st.sampled_from(sorted(known)), min_size=1, max_size=5))
    values = {}
    for name in sorted(names):
        choices = st.sampled_from(good_values(known[name]))
        ordinary = st.floats(-6.0, 6.0).map(lambda power: 10.0**power)
        values[name] = draw(choices | ordinary if known[name].kind is float else choices)
    return values


@pytest.fixture(autouse=True, scope="module")
def _little_patience() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("stickslip_ros.motion.hybrid_motion._SPARE_STEPS", 10_000)
        yield


@given(extremes("plant"), extremes(PAPER.controller.node), st.booleans())
@examples(quick=20, thorough=100, suppress_health_check=[HealthCheck.too_slow])
def test_any_scenario_ends(
    plant: dict[str, Any], controller: dict[str, Any], continuous: bool
) -> None:
    with suppress(StickslipError):
        scenario: Scenario = replace(
            PAPER,
            plant=PAPER.plant.changed(plant, "plant"),
            controller=PAPER.controller.changed(controller, "controller"),
        )
        period = scenario.plant.as_drive().natural_period
        duration = min(2.0 * period, SAMPLES / scenario.plant.rate)
        measures = simulate(scenario, duration, continuous=continuous, progress=lambda _: None)
        values = [value for value in measures.as_dict().values() if isinstance(value, float)]
        assert all(isfinite(value) for value in values)
