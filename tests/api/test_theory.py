"""Stability and design as objects."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.stability import stability


def test_stability_is_that_of_the_command_twice() -> None:
    found, notes = stability(ss.scenario("paper"))
    for _ in range(2):
        ours = ss.stability("paper")
        assert {
            name: value for name, value in vars(ours).items() if name not in ("scenario", "notes")
        } == found
        assert ours.notes == notes
    assert repr(ours).splitlines()[0] == "paper, by theory"
    assert "Hopf speeds" in repr(ours)
    assert ours._repr_html_().count("<table>") == 2  # pyright: ignore
    assert isinstance(ours.plot(), Figure)


def test_without_control_the_figure_is_the_bifurcation_diagram() -> None:
    figure = ss.stability(ss.scenario("paper", expects_control=False)).plot()
    assert figure.get_suptitle() == "Bifurcation diagram, paper, no control"
    (axes,) = figure.axes
    assert axes.get_xlabel() == "belt speed $v_0$ (dimensionless)"


def test_friction_that_differs_between_the_directions_has_no_bifurcation_diagram() -> None:
    scenario = ss.scenario("paper", expects_control=False, friction_reverse_static=0.5)
    with pytest.raises(InvalidInputError, match="nothing to draw: the bifurcation diagram needs"):
        ss.stability(scenario).plot()


def test_under_another_control_law_there_is_no_map_and_no_design() -> None:
    scenario = load_scenario("feed_drive", controller="velocity_feedback")
    with pytest.raises(InvalidInputError, match="nothing to draw: this exists for the washout law"):
        ss.stability(scenario).plot()
    with pytest.raises(InvalidInputError, match="control law = velocity_feedback is refused"):
        ss.design(scenario, force_limit=200.0)


def test_a_design_runs_and_keeps_to_its_limit() -> None:
    one = ss.design("feed_drive", belt_speed=(0.03, 0.04), force_limit=200)
    other = ss.design("feed_drive", belt_speed=(0.03, 0.04), force_limit=200.0)
    assert one.controller == other.controller
    scenario = one.scenario
    assert scenario.controller.as_law() == one.controller
    assert scenario.washout_controller.force_limit == 200.0
    run = ss.simulate(ss.scenario(scenario, start_after=3.0), duration=8)
    assert run.measures.regime == "equilibrium"
    assert np.abs(run.trajectory.control_force).max() <= 200.0
    assert "proposal" in repr(one)
    frame = one.to_pandas()
    assert frame["belt_speed"].tolist() == [check.belt_speed for check in one.checks]
    assert frame.attrs["units"]["peak_force"] == "N"
    assert isinstance(one.plot(), Figure)
    assert one.margins is not None


def test_one_speed_is_enough() -> None:
    found = ss.design("feed_drive", belt_speed=0.04)
    assert found.design.task.belt_speeds == (0.04, 0.04)
    assert found.scenario.plant.belt_speed == 0.04


def test_without_a_proposal_it_says_why() -> None:
    found = ss.design("feed_drive", belt_speed=0.04, force_limit=1e-3)
    assert found.controller is None
    assert "nothing to propose" in repr(found)
    with pytest.raises(RunError, match="there is nothing to propose: "):
        _ = found.scenario
    with pytest.raises(RunError, match="there is nothing to propose: "):
        found.plot()


def test_jitter_is_remarked_on() -> None:
    found = ss.design(ss.scenario("feed_drive", force_jitter=0.001), belt_speed=0.04)
    assert "force_jitter is omitted" in (found.remark or "")


@pytest.mark.parametrize("speed", ["fast", (0.01, 0.02, 0.03), (0.05, 0.01), -0.04, ("a", "b")])
def test_speeds_that_are_none_are_refused(speed: object) -> None:
    with pytest.raises(InvalidInputError, match=r"belt.speeds? .*must be"):
        ss.design("feed_drive", belt_speed=speed)  # pyright: ignore


def test_there_are_no_gains_without_control() -> None:
    with pytest.raises(InvalidInputError, match="without control there are no gains"):
        ss.design(ss.scenario("feed_drive", expects_control=False))
