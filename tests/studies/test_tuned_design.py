"""Design of any law by the rule: it is simulated, and says where it does not hold."""

from math import pi

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.api.design import TunedProposal
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.design import Task
from stickslip_ros.studies.tuned_design import design_by_rule


def test_a_proposal_holds_in_simulation_and_its_file_has_the_gains() -> None:
    drive = ss.scenario("feed_drive", "plant.force_delay=0.001", controller="velocity_feedback")
    found = ss.design(drive, (0.03, 0.04))
    assert isinstance(found, TunedProposal)
    assert found.remark is None
    assert all(check.outcome.held for check in found.design.checks)
    assert len(found.design.checks) == 10
    gain = found.scenario.controller.control_law.velocity_gain
    assert f'"velocity_gain": {gain}' in found.design.parameter_file
    margin = found.design.tuned.phase_margin
    assert margin is not None
    assert 0.0 < margin < pi
    radius = max(np.abs(poles).max() for poles in found.poles.values())
    assert -np.log(radius) * 1000.0 == pytest.approx(found.design.tuned.decay_rate, rel=1e-6)
    assert len(found.to_pandas()) == 10
    assert found.plot().axes


def test_an_axis_without_a_spring_gets_gains_for_a_feed() -> None:
    axis = load_scenario("axis", controller="pid")
    found = design_by_rule(Task.from_scenario(axis, (0.01, 0.01)))
    assert found.remark is None
    assert [check.outcome.held for check in found.checks] == [True, True]
    assert found.tuned.decay_rate > 0.0
