"""Titles that name what a figure shows, the drive, and the control."""

from collections.abc import Collection

from stickslip_ros.scenarios.files import Scenario

_CONTROL = "plant.expects_control"


def title_of(what: str, scenario: Scenario, varied: Collection[str] = ()) -> str:
    """Return the title of what is shown of a scenario, such as a bifurcation diagram.

    It contains the overrides of the scenario, except of the parameters that are `varied`.
    """
    untold = (*varied, _CONTROL)
    fixed = [text for text in scenario.overrides if text.partition("=")[0] not in untold]
    law = scenario.control_law
    control = "no control" if law is None else f"{law.name} control"
    return ", ".join([what, " ".join([scenario.name, *fixed]), control])
