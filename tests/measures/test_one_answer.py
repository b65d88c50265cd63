"""The same samples have one answer: as they come, from a bag of ours or of another, from a table.

Drawn and undrawn runs and points of a sweep are compared in `tests/studies/random_scenarios.py`.
"""

import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from typing_extensions import override

from stickslip_ros.measures.cycle_measures import Cycle, Measures, measures_of
from stickslip_ros.measures.sample_meter import SampleMeter
from stickslip_ros.record.bag_layout import BagLayout
from stickslip_ros.record.codec import joint_state_packer, pack_joint_state
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.samples import SampleColumns
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.simulate import simulate
from tests.examples import examples
from tests.record.runs import STATES, write_bag
from tests.studies.random_scenarios import RandomScenario, random_scenario

COLUMNS = {"time": "t", "position": "x", "velocity": "v", "belt_velocity": "b"}
LEAST_SAMPLES = 20.0
"""In a natural period: dropouts are told from a motion with more samples only."""
RESTS = {"equilibrium", "held"}
"""What is one for a sensor of which nothing is known."""


class KeptSamples(SampleMeter):
    """Measures samples as an analyzer does, and keeps them."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario.analyzer.window, reading=scenario.reading)
        self.kept = list[SampleColumns]()

    @override
    def feed(self, samples: SampleColumns) -> list[Cycle]:
        self.kept.append(samples)
        return super().feed(samples)


def encoded(one: RandomScenario, steps: float) -> Scenario:
    """Return a scenario with an encoder of so many steps in an amplitude; an exact one for 0."""
    least = LEAST_SAMPLES / one.period
    one = one.changed(lambda name, value: max(value, least) if name == "rate" else value)
    scenario = one.scenario
    if not steps:
        return scenario
    step = max(one.measures().amplitude or 0.0, 0.02 * one.length) / steps
    sensor = replace(scenario.plant.sensor, position_resolution=step, position_noise=0.3 * step)
    return replace(scenario, plant=replace(scenario.plant, sensor=sensor))


def bag(
    path: Path, samples: SampleColumns, pack: Callable[..., bytes], **tables: Mapping[str, Any]
) -> Path:
    columns = samples.position, samples.velocity, samples.belt_velocity
    states = [
        (STATES, stamp, pack(stamp, (position, 0.0), (velocity, belt), (0.0, 0.0)))
        for stamp, position, velocity, belt in zip(
            samples.stamp.tolist(), *(each.tolist() for each in columns), strict=True
        )
    ]
    texts = {
        f"stickslip_ros/{name}": {key: json.dumps(value) for key, value in table.items()}
        for name, table in tables.items()
    }
    write_bag(path, states, tables=MappingProxyType(texts))
    return path


def table(path: Path, samples: SampleColumns) -> Path:
    columns = samples.stamp * 1e-9, samples.position, samples.velocity, samples.belt_velocity
    np.savetxt(path, np.column_stack(columns), "%.17g", ",", header="t,x,v,b", comments="")
    return path


def agree(known: Measures, unknown: Measures) -> bool:
    """Return whether regimes are the same, or sticks that are within their errors of none."""
    if known.regime == unknown.regime or {known.regime, unknown.regime} <= RESTS:
        return True
    share, other, errors = known.stick_fraction, unknown.stick_fraction, known.errors
    if share is None or other is None or errors is None:
        return False
    return abs(share - other) < 3.0 * errors["stick_fraction"]


@pytest.mark.long
@example(5, 30.0)  # comes to rest on a belt that moves
@examples(quick=2, thorough=10, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 30.0, 1000.0]))
def test_live_bag_and_table_give_one_answer(seed: int, steps: float) -> None:
    """What is known of the plant may tell more, and what is not known says nothing else."""
    one = random_scenario(seed)
    scenario = encoded(one, steps)
    meter = KeptSamples(scenario)
    simulate(scenario, one.periods * one.period, measured=meter)
    live, samples = meter.measures(), meter.kept[0]
    for each in meter.kept[1:]:
        samples = samples.followed_by(each)
    known = {"plant": scenario.plant.flat(), "analyzer": scenario.analyzer.flat()}
    with tempfile.TemporaryDirectory() as folder:
        own = bag(Path(folder) / "own", samples, pack_joint_state, **known)
        other = bag(Path(folder) / "other", samples, joint_state_packer("axis", "table"))
        layout = BagLayout(joint="axis", belt_joint="table")
        of_own = measures_of(report_of_recording(own))
        of_other = report_of_recording(other, layout=layout)
        of_table = report_of_recording(table(Path(folder) / "table.csv", samples), COLUMNS)
    if not one.controlled:  # else the forces may drift, which are not in the bag
        assert of_own == live
    if of_other["samples"] == of_table["samples"]:  # no dropouts, which are told otherwise
        assert measures_of(of_other) == measures_of(of_table)
    # The speed at which a slide with memory sticks is known with its law only.
    if not scenario.reading.stick_speed:
        unknown = of_table["regime"] is None and of_table["notes"]
        assert unknown or agree(live, measures_of(of_table))
