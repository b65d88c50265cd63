"""Titles that name what a figure shows, the drive, and the control."""

from collections.abc import Collection

from stickslip_ros.scenarios.files import Scenario

_CONTROL = "plant.expects_control"


def title_of(what: str, scenario: Scenario, varied: Collection[str] = ()) -> str:
    """Return the title of what is shown of a scenario, such as a bifurcation diagram.

    It contains the overrides of the scenario, except of the parameters that are `varied`; of those
    of one parameter the last one, which counts.
    """
    last = {text.partition("=")[0]: text for text in scenario.overrides}
    fixed = [text for name, text in last.items() if name not in (*varied, _CONTROL)]
    law = scenario.control_law
    control = "no control" if law is None else f"{law.name} control"
    return ", ".join([what, " ".join([scenario.name, *fixed]), control])
