"""Scenarios from names, paths, texts and keywords."""

from pathlib import Path
from typing import Any

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.scenarios.keywords import parameter_of

ScenarioLike = Scenario | str | Path
"""A scenario, its name, or the path of its file."""


def scenario(
    name_or_path: ScenarioLike,
    /,
    *overrides: str,
    base: str | Path | None = None,
    controller: str | None = "scenario",
    **parameters: Any,
) -> Scenario:
    """Return a scenario, with some parameters changed.

    Parameters
    ----------
    name_or_path : Scenario, str or Path
        Name of a scenario that ships (`"feed_drive"`, `"paper"`), path of a scenario file, or a
        scenario that is to be changed.
    *overrides : str
        Texts NODE.PARAMETER=VALUE, as after `-p` on the command line.
    base : str or Path, optional
        Scenario that gives the parameters that the file omits, by its name or path. By default
        this is the one that the section `scenario` of the file names.
    controller : str or None, optional
        Name of the control law in use, such as `"velocity_feedback"`; None for no control. By
        default, `"scenario"`, it is the one that the file, or else its base, has a section for.
    **parameters : Any
        Values in SI units, or texts with a unit (`"30mm/s"`). The keyword is the parameter's name
        with `_` for each `.`, such as `belt_speed` or `friction_static`, where only one of plant,
        analyzer and the controller in use has such a parameter. Keywords act after texts.

    Returns
    -------
    Scenario
        The parameters of every node, checked.

    Raises
    ------
    InvalidInputError
        If the scenario, the controller, a parameter or a value is not allowed, or if several nodes
        have a keyword's parameter.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> drive = ss.scenario("feed_drive", belt_speed=0.03, friction_static=0.35)
    >>> drive.plant.belt_speed, drive.plant.friction.static
    (0.03, 0.35)
    >>> damped = ss.scenario(drive, controller="velocity_feedback", velocity_gain=-2000)
    >>> damped.control_law.velocity_gain
    -2000.0
    """
    law = None if controller == "scenario" else controller
    if not isinstance(name_or_path, Scenario):
        own_base = None if base is None else str(base)
        chosen = load_scenario(str(name_or_path), base=own_base, controller=law)
    elif base is not None:
        raise InvalidInputError(f"base = {base}: {name_or_path.name} is loaded, and needs no base")
    else:
        chosen = name_or_path if law is None else name_or_path.with_controller(law)
    control = ["plant.expects_control=false"] if controller is None else []
    values = {parameter_of(keyword, chosen.nodes): value for keyword, value in parameters.items()}
    texts = [*control, *overrides]
    return chosen.overridden(texts, values) if texts or values else chosen


def as_scenario(given: ScenarioLike) -> Scenario:
    """Return a scenario that is given as such, or by name or path."""
    return given if isinstance(given, Scenario) else load_scenario(str(given))
